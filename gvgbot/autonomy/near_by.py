"""A robot that may have been pushed unnoticed: where near the believed place is it on its map?

All it has seen since is drawn where it believes to be, so the walls of its local map say nothing.
Those of its map do, as they were known before.
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.autonomy.known_walls import REACH_M, KnownWalls
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, register
from gvgbot.geometry import Array, Pose, thinned, wrap_angle
from gvgbot.hal.packed_scan import AnyScan

_FAR_M, _STEP_M = 1.2, 0.2  # around the believed pose
_FAR_RAD, _STEP_RAD = 0.45, 0.075
_APART_M, _APART_RAD = 0.2, 0.15  # poses nearer to each other are the same
_TRIED = 12  # poses that are looked at closely
_GUESSED = np.diag([0.2**2, 0.2**2, 0.08**2])  # covariance of one
_CELL_M, _FEWEST = 0.1, 40  # walls
_ON_M, _OFF_M = 0.08, 0.2  # walls so near to each other are one, and so far off are two
_FITS, _CLEARLY = 0.7, 0.08  # share of the walls that agree, and by how much more than elsewhere


class Fit(NamedTuple):
    """A pose, map_base, and the share of the walls that agree there."""

    map_base: Pose
    share: float
    is_clear: bool = True  # they agree so well nowhere else


def walls_known(mapper: Mapper, old: Sequence[Keyframe]) -> Array:
    """The walls (N, 2) of the map around: of its vertices, and of scans of old keyframes.

    Once a map was finished, vertices that came later may have been drawn at a wrong place.
    """
    belief, vertices = mapper.belief, mapper.graph.vertices
    is_finished = any(vertex.established for vertex in vertices.values())
    walls = [
        belief.map_vertex(vertex).transform(vertices[vertex].snapshot)
        for vertex in belief.ids
        if vertices[vertex].established or not is_finished
    ]
    here = belief.map_base
    near = (k for k in old if k.map_base.distance(here) < REACH_M)
    walls += [k.map_base.transform(_base_ends(k.scan)) for k in near if k.scan is not None]
    found = np.concatenate([np.empty((0, 2)), *walls])
    is_near = np.hypot(*(found - here.position).T) < REACH_M + _FAR_M
    return thinned(found[is_near], _CELL_M)


def walls_seen(keyframes: Sequence[Keyframe], local_base: Pose) -> Array:
    """The walls (N, 2) that scans of keyframes show around a base, in its frame."""
    walls = (
        local_base.to(k.local_base).transform(_base_ends(k.scan))
        for k in keyframes
        if k.scan is not None
    )
    found = np.concatenate([np.empty((0, 2)), *walls])
    return thinned(found[np.hypot(*found.T) < REACH_M], _CELL_M)


def _base_ends(scan: AnyScan) -> Array:
    """What a scan shows (N, 2), in the frame of the base."""
    return scan.base_laser.transform(scan.unpacked().ends)


def misplaced(
    base_walls: Array, walls: Array, map_base: Pose, matching: ScanMatchingConfig
) -> Fit | None:
    """Where the robot is, if that is clearly not where it believes to be.

    `base_walls` (N, 2) are what it sees around, in its own frame, `walls` (M, 2) those of the map.
    """
    if min(len(base_walls), len(walls)) < _FEWEST:
        return None
    known = KnownWalls(walls, np.empty((0, 2)))
    guesses = [map_base, *_guesses(base_walls, known, map_base)]
    fits = [fit for guess in guesses if (fit := _fit(base_walls, known, guess, matching))]
    best = max(fits, key=lambda fit: fit.share, default=None)
    if best is None or best.share < _FITS:
        return None
    elsewhere = [
        fit.share for fit in fits if not fit.map_base.is_near(best.map_base, _APART_M, _APART_RAD)
    ]
    if best.share <= _share(base_walls, known, map_base) + _CLEARLY:
        return None
    return best._replace(is_clear=best.share > max(elsewhere, default=0.0) + _CLEARLY)


def _guesses(base_walls: Array, known: KnownWalls, map_base: Pose) -> list[Pose]:
    """Poses around where the walls fit roughly, none near a better one, the best first."""
    steps = np.arange(-_FAR_M, _FAR_M + 1e-9, _STEP_M)
    turns = np.arange(-_FAR_RAD, _FAR_RAD + 1e-9, _STEP_RAD)
    tried = np.array([g for g in product(steps, steps, turns) if math.hypot(*g[:2]) <= _FAR_M])
    tried += [map_base.x, map_base.y, map_base.theta]
    scores = known.scores_at(tried, base_walls)
    found: list[Pose] = []
    for x, y, theta in tried[np.argsort(-scores, kind="stable")].tolist():
        pose = Pose(x, y, wrap_angle(theta))
        if not any(pose.is_near(other, _APART_M, _APART_RAD) for other in found):
            found.append(pose)
        if len(found) == _TRIED:
            break
    return found


def _fit(
    base_walls: Array, known: KnownWalls, pose: Pose, matching: ScanMatchingConfig
) -> Fit | None:
    """Lay walls onto those of the map near a pose; None if too few of them lie on any."""
    found = register(base_walls, known.tree, pose, _GUESSED, matching)
    if found is None:
        return None
    return Fit(found.pose, _share(base_walls, known, found.pose))


def _share(base_walls: Array, known: KnownWalls, map_base: Pose) -> float:
    """How many of the walls agree with those of the map."""
    away = np.asarray(known.tree.query(map_base.transform(base_walls))[0])
    return 1.0 - float(np.clip((away - _ON_M) / (_OFF_M - _ON_M), 0.0, 1.0).mean())
