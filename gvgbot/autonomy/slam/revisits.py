"""Places that were passed twice: the walls seen on one visit, laid onto those of an earlier one.

Vertices close loops where lines of the GVG meet, while the robot drives. This closes them anywhere,
whenever a map is made of what it has seen. A match must lie where the uncertainty since the last
one allows it, and explain most of what both visits saw; smoothing doubts one that then disagrees
with all the others.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.slam.ekf import Belief, predict
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, Sides, register_coarsely
from gvgbot.autonomy.slam.smoothing import Constraint, PoseGraph
from gvgbot.geometry import Array, Pose, rotated_covariance, rows_of, wrap_angle

_AROUND = 4  # scans before and after one, whose walls belong to its place
_LEAST_LOOP_M = 10.0  # driven in between, or it is the same visit
_EVERY_M = 1.5  # driven between two tries
_NEAR_M, _FARTHEST_M = 2.0, 7.0  # between two visits of a place, without and with uncertainty
_POINTS = 250  # of a place that are laid onto another
_CELL_M = 0.1  # of the grid that thins the walls of a place
_REACHES_M = (2.5, 1.2, 0.6)  # of pairs, at first
_OVERRATED = 9.0  # what steps err alike adds up: so much more variance
_SLACK = np.diag([0.1**2, 0.1**2, 0.03**2])  # of the earlier place
_GATE = 16.3  # squared Mahalanobis distance, 3 degrees of freedom
_WALL_M = 0.15  # a point so near to a wall lies on it
_IN_VIEW_M = 1.0  # a point farther from all walls was not seen on the other visit
_LEAST_IN_VIEW = 0.6  # share of the points
_LEAST_AGREEMENT = 0.75  # share of the points in view that lie on walls
_FLOOR = np.diag([0.012**2, 0.012**2, 0.003**2])  # what matching cannot know of itself
_TELLING_M = 0.02  # sigma of a match by its walls: less certain, they only seem to tell the place
_NO_NEWS_M = 0.05  # a match that moves the robot less need not be accounted for at once
_ROUGHLY_M = 5e-3  # so well must be known where places are in which matches are looked for
_ROW = 1 << 32  # more cells than any building has side by side


@dataclass(frozen=True, eq=False)
class Traverse:
    """A whole run: the steps from keyframe to keyframe, and what walls were seen at some of them.

    A step is a motion and its covariance (3, 3), both in the frame of its start; walls are points
    (K, 2) in the frame of the base. Surveyors call such a chain of legs a traverse.
    """

    steps: list[tuple[Pose, Array]]
    walls: dict[int, Array]

    @cached_property
    def looks(self) -> NDArray[np.int64]:
        """The keyframes (K,) at which walls were seen, in order."""
        return np.array(sorted(self.walls), np.int64)

    @cached_property
    def driven(self) -> Array:
        """Metres driven until each keyframe (N,)."""
        steps = [math.hypot(motion.x, motion.y) for motion, _ in self.steps]
        return np.concatenate([[0.0], np.cumsum(steps)])


def revisits(traverse: Traverse, matching: ScanMatchingConfig) -> list[Constraint]:
    """How later visits of a place see earlier ones, by numbers of keyframes."""
    chain = [
        Constraint(i, i + 1, motion, np.asarray(np.linalg.inv(P), np.float64))
        for i, (motion, P) in enumerate(traverse.steps)
    ]
    x, found = _laid_out(traverse), list[Constraint]()
    for i, belief in _tries(traverse):
        j = _earlier_visit(x, traverse, i, belief)
        match = None if j is None else _match(x, traverse, j, i, belief, matching)
        if match is None:
            continue
        found.append(match)
        belief.P[:] = 0.0
        if np.abs(_residual(x, match)[:2]).max() > _NO_NEWS_M:
            _bend(x, i, PoseGraph(chain[:i] + found))
    return found


def _bend(x: Array, last: int, graph: PoseGraph) -> None:
    """Let the poses (N, 3) up to a last one agree, and move those that follow along with it."""
    before = _pose(x, last)
    x[: last + 1] = graph.solve(x[: last + 1], within=_ROUGHLY_M)
    moved = _pose(x, last).compose(before.inverse())
    x[last + 1 :, :2] = moved.transform(x[last + 1 :, :2])
    x[last + 1 :, 2] += moved.theta


def _laid_out(traverse: Traverse) -> Array:
    """The poses (N, 3) by the steps alone."""
    poses = [Pose()]
    for motion, _ in traverse.steps:
        poses.append(poses[-1].compose(motion))
    return rows_of(poses)


def _tries(traverse: Traverse) -> Iterator[tuple[int, Belief]]:
    """The keyframes to look from, and the motion since the last place that was known again.

    Whoever knows a place again sets the covariance of that motion to zero.
    """
    belief, last, tried = Belief(), 0, 0.0
    for i in traverse.looks.tolist():
        for motion, covariance in traverse.steps[last:i]:
            belief = predict(belief, motion, _OVERRATED * covariance)
        last = i
        if traverse.driven[i] - tried >= _EVERY_M:
            tried = traverse.driven[i]
            yield i, belief


def _earlier_visit(x: Array, traverse: Traverse, i: int, belief: Belief) -> int | None:
    """The nearest keyframe of an earlier visit to the place of one."""
    looks, driven = traverse.looks, traverse.driven
    earlier = looks[driven[looks] < driven[i] - _LEAST_LOOP_M]
    if len(earlier) == 0:
        return None
    distance = np.hypot(*(x[earlier, :2] - x[i, :2]).T)
    sigma = float(np.sqrt(np.linalg.eigvalsh(belief.P[:2, :2])[-1]))
    near = distance.min() < min(_NEAR_M + 2 * sigma, _FARTHEST_M)
    return int(earlier[distance.argmin()]) if near else None


def _match(
    x: Array, traverse: Traverse, j: int, i: int, belief: Belief, matching: ScanMatchingConfig
) -> Constraint | None:
    """Keyframe i seen from keyframe j, if the walls around both agree."""
    walls, of_walls = _place(x, traverse, j)
    points, of_points = _place(x, traverse, i)
    tree = cKDTree(walls)
    prior = _pose(x, j).to(_pose(x, i))
    Q = rotated_covariance(belief.P, -float(belief.x[2])) + _SLACK
    some = slice(None, None, max(1, len(points) // _POINTS))
    found = register_coarsely(
        points[some],
        tree,
        prior,
        Q,
        matching,
        _REACHES_M,
        sides=Sides(of_walls, of_points[some]),
    )
    if found is None:
        return None
    off = _array(prior.to(found.pose))
    if off @ np.linalg.solve(Q, off) > _GATE or not _tells(found.covariance):
        return None
    laid = found.pose.transform(points)
    distance = np.asarray(tree.query(laid, distance_upper_bound=_IN_VIEW_M)[0])
    in_view = np.isfinite(distance)
    if in_view.mean() < _LEAST_IN_VIEW or (distance[in_view] < _WALL_M).mean() < _LEAST_AGREEMENT:
        return None
    seen = found.covariance + _spread(traverse, i) + _FLOOR
    covariance = rotated_covariance(seen, found.pose.theta) + _spread(traverse, j)
    return Constraint(
        j, i, found.pose, np.asarray(np.linalg.inv(covariance), np.float64), doubtful=True
    )


def _tells(covariance: Array) -> bool:
    """Whether walls tell a place: in a round corridor the noise of many feigns a little of it."""
    return bool(np.linalg.eigvalsh(covariance[:2, :2])[-1] < _TELLING_M**2)


def _spread(traverse: Traverse, i: int) -> Array:
    """By what the walls of a place may lie apart: the covariance (3, 3) of the way to a keyframe.

    In its frame, from the first look that its place is made of.
    """
    at = int(np.searchsorted(traverse.looks, i))
    belief = Belief()
    for motion, covariance in traverse.steps[int(traverse.looks[max(0, at - _AROUND)]) : i]:
        belief = predict(belief, motion, covariance)
    return rotated_covariance(belief.P, -float(belief.x[2]))


def _place(x: Array, traverse: Traverse, i: int) -> tuple[Array, Array]:
    """The walls (K, 2) around a keyframe in its frame, as seen there, just before and just after.

    One point for each cell of a grid, and vectors (K, 2) to where they were seen from.
    """
    at, here = int(np.searchsorted(traverse.looks, i)), _pose(x, i)
    seen, from_ = list[Array](), list[Array]()
    for k in traverse.looks[max(0, at - _AROUND) : at + _AROUND + 1].tolist():
        there = here.to(_pose(x, k))
        seen.append(there.transform(traverse.walls[k]))
        from_.append(there.position - seen[-1])
    points = np.concatenate(seen)
    cells = np.floor(points / _CELL_M).astype(np.int64) @ (_ROW, 1)
    kept = np.unique(cells, return_index=True)[1]
    return points[kept], np.concatenate(from_)[kept]


def _residual(x: Array, match: Constraint) -> Array:
    """Expected minus measured, in the frame of the first pose."""
    expected = _array(_pose(x, match.a).to(_pose(x, match.b)))
    r = expected - _array(match.a_b)
    r[2] = wrap_angle(r[2])
    return r


def _pose(x: Array, i: int) -> Pose:
    return Pose.from_array(x[i])


def _array(pose: Pose) -> Array:
    return np.array([pose.x, pose.y, pose.theta])
