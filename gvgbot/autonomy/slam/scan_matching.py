"""Registration of points on the walls of a map: Gauss-Newton, point to line, with a prior.

The prior is the odometry's own covariance, so the direction that the walls do not constrain (along
a bare corridor) is left to odometry. A point is laid onto a wall's face that was seen from its own
side: what a room shows of a thin wall is not what the corridor showed of it.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.geometry import Array, Pose
from gvgbot.ranges import Range

Index = NDArray[np.intp]

_NEIGHBOURS = 5
_FEWEST = 3  # of them make a line
_FLATNESS = 0.08  # smallest over largest spread of the neighbours of a point on a wall
_REACH_M = 0.35  # as far away as neighbours on one wall may be
_ITERATIONS = 6
_SAME_PAIRS_M, _SAME_PAIRS_RAD = 0.02, 0.005  # moved less, points are near to the same walls


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanMatchingConfig:
    """How far points are paired, and how much one pair is worth."""

    # a point farther from every wall has no pair
    max_pair_m: Annotated[float, Range(0.05, 1.0)] = 0.25
    pair_sigma_m: Annotated[float, Range(0.005, 0.5)] = 0.03  # of a point's distance from its wall
    independent_share: Annotated[float, Range(0.001, 1.0)] = 0.3  # neighbouring pairs err together
    points: Annotated[int, Range(50, 5000)] = 300  # of a scan that are matched
    min_pairs: Annotated[int, Range(10, 1000)] = 40  # with fewer there is no match
    min_inliers: Annotated[float, Range(0.0, 1.0)] = 0.5  # share of a scan that must find a wall
    coarse_pair_m: Annotated[float, Range(0.0, 2.0)] = 0.0  # of a first match; 0: there is none
    search_rad: Annotated[float, Range(0.0, 1.0)] = 0.0  # for the heading first, to either side


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """A pose, its covariance (3, 3) in its own frame, and how well the points lie on the walls."""

    pose: Pose
    covariance: Array
    inliers: float  # share of the points that found a wall
    rms: float  # metres from the walls


class Sides(NamedTuple):
    """From which side walls are seen: directions to there, of any length; 0 is either side.

    `of_walls` (M, 2) are those from the wall points, `of_points` (N, 2) those from the points that
    are registered, in their frame.
    """

    of_walls: Array
    of_points: Array

    def turned(self, angle: float) -> "Sides":
        """With the points turned by an angle."""
        return Sides(self.of_walls, Pose(theta=angle).transform(self.of_points))


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Points by their index (K,), and the walls they are near to: centre and normal (K, 2)."""

    index: Index
    centre: Array
    normal: Array


def register(
    points: Array,
    tree: cKDTree,
    walls: Array,
    prior: Pose,
    Q: Array,
    config: ScanMatchingConfig,
    hits: Array | None = None,
    sides: Sides | None = None,
) -> Registration | None:
    """The pose that lays points (N, 2) of its frame onto wall points (M, 2), near a prior.

    `hits` (M,) is how much each wall point counts beside its neighbours, by default all the same;
    without `sides` a point may lie on either face of a wall.
    Q (3, 3) is the prior's covariance in its own frame. None when too few points find a wall.
    """
    information = np.linalg.inv(Q)
    counts = np.ones(len(walls)) if hits is None else hits
    step = np.zeros(3)  # of the pose, in the prior's frame
    pose, A = prior, information
    inliers, rms = 0.0, 0.0

    def paired(pose: Pose) -> _Pairs:
        turned = None if sides is None else sides.turned(pose.theta)
        return _pairs(pose.transform(points), tree, walls, counts, config.max_pair_m, turned)

    paired_at, pairs = pose, paired(pose)
    for _ in range(_ITERATIONS):
        world = pose.transform(points)
        if _is_elsewhere(paired_at.to(pose)):
            paired_at, pairs = pose, paired(pose)
        index, normal, residual = _near(world, pairs, config.max_pair_m)
        if len(index) < config.min_pairs:
            return None
        weight = (
            config.independent_share
            / config.pair_sigma_m**2
            / np.maximum(1.0, np.abs(residual) / (2 * config.pair_sigma_m))
        )
        J = _jacobian(points[index], normal, pose, prior)
        A = information + (J * weight[:, None]).T @ J
        change = -np.linalg.solve(A, information @ step + J.T @ (weight * residual))
        step = step + change
        pose = prior.compose(Pose.from_array(step))
        inliers, rms = len(index) / len(points), float(np.sqrt(np.mean(residual**2)))
        if np.abs(change).max() < 1e-4:
            break
    return Registration(pose, np.linalg.inv(A), inliers, rms)


def register_coarsely(
    points: Array,
    tree: cKDTree,
    walls: Array,
    prior: Pose,
    Q: Array,
    config: ScanMatchingConfig,
    reaches: tuple[float, ...],
    hits: Array | None = None,
    sides: Sides | None = None,
) -> Registration | None:
    """As `register`, from farther away: pairs first reach as far as each of `reaches`, m.

    A match is where the next one starts, with the same Q around it.
    """
    for reach in reaches:
        near = register(
            points, tree, walls, prior, Q, replace(config, max_pair_m=reach), hits, sides
        )
        prior = prior if near is None else near.pose
    return register(points, tree, walls, prior, Q, config, hits, sides)


def _is_elsewhere(motion: Pose) -> bool:
    """Whether points have moved so far that they may be near to another part of the walls."""
    return math.hypot(motion.x, motion.y) > _SAME_PAIRS_M or abs(motion.theta) > _SAME_PAIRS_RAD


def _pairs(
    world: Array, tree: cKDTree, walls: Array, hits: Array, reach: float, sides: Sides | None
) -> _Pairs:
    """The points that are near to a wall, and its line there."""
    found = tree.query(world, k=_NEIGHBOURS, distance_upper_bound=max(reach, _REACH_M))
    distance, near = np.asarray(found[0]), np.asarray(found[1])
    index = np.nonzero(np.isfinite(distance[:, _FEWEST - 1]) & (distance[:, 0] < reach))[0]
    present = np.isfinite(distance[index])
    near = np.where(present, near[index], near[index][:, :1])
    group, weight = walls[near], present * hits[near]
    centre, normal, flat = _lines(group, weight)
    if sides is not None:
        before = np.einsum("kij,kj->ki", sides.of_walls[near], normal)
        now = (sides.of_points[index] * normal).sum(axis=1)
        facing = before * now[:, None] >= 0.0
        weight *= facing
        enough = np.count_nonzero(weight, axis=1) >= _FEWEST
        mixed = np.flatnonzero(enough & (present & ~facing).any(axis=1))
        centre[mixed], normal[mixed], flat[mixed] = _lines(group[mixed], weight[mixed])
        flat &= enough
    return _Pairs(index[flat], centre[flat], normal[flat])


def _near(world: Array, pairs: _Pairs, reach: float) -> tuple[Index, Array, Array]:
    """Indices of the points near a wall, the wall's normals (K, 2), and signed distances (K,)."""
    residual = ((world[pairs.index] - pairs.centre) * pairs.normal).sum(axis=1)
    near = np.abs(residual) < reach
    return pairs.index[near], pairs.normal[near], residual[near]


def _lines(group: Array, weight: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Centres (K, 2) and normals (K, 2) of groups of points (K, G, 2), and which are lines (K,)."""
    weight = weight / weight.sum(axis=1, keepdims=True)
    x, y = group[..., 0], group[..., 1]
    centre = np.stack([(weight * x).sum(axis=1), (weight * y).sum(axis=1)], axis=1)
    dx, dy = x - centre[:, :1], y - centre[:, 1:]
    xx, yy, xy = ((weight * p).sum(axis=1) for p in (dx * dx, dy * dy, dx * dy))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)  # of the wall
    spread = np.hypot((xx - yy) / 2, xy)
    large, small = (xx + yy) / 2 + spread, (xx + yy) / 2 - spread
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    return centre, normal, small < _FLATNESS * large


def _jacobian(points: Array, normal: Array, pose: Pose, prior: Pose) -> Array:
    """Derivative (K, 3) of the distances by a step of the pose in the prior's frame."""
    c, s = np.cos(prior.theta), np.sin(prior.theta)
    along = np.stack(
        [c * normal[:, 0] + s * normal[:, 1], -s * normal[:, 0] + c * normal[:, 1]], axis=1
    )
    c, s = np.cos(pose.theta), np.sin(pose.theta)
    turned = np.stack(
        [-s * points[:, 0] - c * points[:, 1], c * points[:, 0] - s * points[:, 1]], axis=1
    )
    return np.concatenate([along, (turned * normal).sum(axis=1)[:, None]], axis=1)
