"""How far two vertices of different charts look alike, once these are laid on each other."""

import math

import numpy as np

from gvgbot.autonomy.slam.recognition import match_bearings
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.registration import SAME_RAD, rigid_fit
from gvgbot.team.chart import ChartVertex
from gvgbot.team.side import Side
from gvgbot.team.stretches import as_clear

_BEYOND_M = 1.2  # of a vertex's disc, walls must agree
_SECTORS, _THICK_M = 90, 0.3  # around a vertex; in each, walls farther behind the first are hidden
_WALL_M = 0.15  # a point so near to a wall lies on it
_SHIFT_M, _TURN_RAD = 0.35, 0.1  # by which charts may be bent against each other at a vertex
_LAID_OUT = 3  # rounds of laying walls on walls
_HOPELESS_SHARE = 0.5  # if fewer of them lie twice as near, they need not be laid out further
_LEAST_POINTS = 4  # of walls, to lay them on others
UNLIKE_SHARE = 0.6  # of the walls around a vertex: one of both robots may not have seen all


def likeness(a: Side, b: Side, i: int, j: int, pose: Pose) -> float:
    """How far (0..1) two vertices agree: by their walls, or 0 if their clearances are not the same.

    Departures may be seen in other directions by each: if they differ, that tells nothing.
    """
    ours, theirs = a.vertices[i], b.vertices[j]
    known = {d.key: d.bearing for d in ours.departures}
    seen = tuple(bearing + pose.theta for bearing in theirs.bearings)
    paired = match_bearings(seen, known, SAME_RAD)
    apart = math.hypot(*(pose.transform(theirs.position) - ours.position))
    if not as_clear(np.array(ours.clearance), np.array(theirs.clearance), apart):
        return 0.0
    agreement = _agreement(a, b, ours, theirs, pose)
    is_same = abs(len(known) - len(seen)) <= 1 and len(paired) >= min(len(known), len(seen))
    return agreement if is_same else min(agreement, UNLIKE_SHARE)


def _agreement(a: Side, b: Side, ours: ChartVertex, theirs: ChartVertex, pose: Pose) -> float:
    """Share of the walls around a vertex that the other chart has as well, the worse of both."""
    near_a, near_b = _around(ours), _around(theirs)
    if not len(near_a) or not len(near_b):
        return 0.0
    local = pose
    for _ in range(_LAID_OUT):
        laid = local.transform(near_b)
        away, index = a.walls.query(laid, distance_upper_bound=2 * _WALL_M)
        found = np.isfinite(np.asarray(away))
        if np.count_nonzero(found) < max(_LEAST_POINTS, _HOPELESS_SHARE * len(found)):
            return 0.0
        local, _ = rigid_fit(a.walls.data[np.asarray(index)[found]], near_b[found])
    shift = local.transform(theirs.position) - pose.transform(theirs.position)
    if np.hypot(*shift) > _SHIFT_M or abs(wrap_angle(local.theta - pose.theta)) > _TURN_RAD:
        return 0.0
    of_theirs = np.asarray(a.walls.query(local.transform(near_b))[0]) < _WALL_M
    of_ours = np.asarray(b.walls.query(local.inverse().transform(near_a))[0]) < _WALL_M
    return float(min(of_theirs.mean(), of_ours.mean()))


def _around(vertex: ChartVertex) -> Array:
    """The walls so near to a vertex, and not behind others, that whoever comes by sees them."""
    offsets = vertex.walls - vertex.position
    away = np.hypot(*offsets.T)
    sector = ((np.arctan2(offsets[:, 1], offsets[:, 0]) / math.tau) % 1.0 * _SECTORS).astype(int)
    nearest = np.full(_SECTORS, np.inf)
    np.minimum.at(nearest, sector % _SECTORS, away)
    in_sight = away < nearest[sector % _SECTORS] + _THICK_M
    near: Array = vertex.walls[(away < vertex.clearance + _BEYOND_M) & in_sight]
    return near
