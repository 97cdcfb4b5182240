"""Registration of points on the walls of a map: Gauss-Newton, point to line, with a prior.

The prior is the odometry's own covariance, so the direction that the walls do not constrain (along
a bare corridor) is left to odometry. A point is laid onto a wall's face that was seen from its own
side: what a room shows of a thin wall is not what the corridor showed of it. A wall is a parabola
through the wall points near by, which count the less the farther they are, as in Cleveland, "Robust
locally weighted regression", JASA 74(368), 1979: a line lies inside columns, and cuts corners.
"""

import cmath
import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.small_systems import inverse, solved
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.ranges import Range

_NEIGHBOURS = 5
_FEWEST = 3  # of them make a line
_BEYOND = 1.05  # of the square of the farthest one's distance: there a wall point would not count
_BEND_M4 = 5e-6  # wall points that are spread by less tell no bend of a wall
_CORNER = 0.4  # rad that a wall turns among them: it is no parabola
_FLATNESS = 0.12  # of the variance along a wall, what the neighbours of a point may have across
_REACH_M = 0.35  # as far away as neighbours on one wall may be; from farther off it is but a line
_ITERATIONS = 6
_BATCH = 10  # neighbouring points, of which the mean distance from the walls is taken
_GRAZING = 0.2  # of how steeply a wall was seen: what is seen less steeply may be its other face
_CONVERGED, _ROUGHLY = 1e-4, 2e-2  # metres and radians
_SAME_PAIRS_M, _SAME_PAIRS_RAD = 0.02, 0.005  # moved less, points are near to the same walls
_LED_ALIKE = 2.5  # times that from where another prior has led, no place is clearly better

Complexes = NDArray[np.complex128]


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
    # for the heading, to either side, where a scan does not fit; with base.heading: wheels, 0
    # stands for 0.4
    search_rad: Annotated[float, Range(0.0, 1.0)] = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """A pose, its covariance (3, 3) in its own frame, and how well the points lie on the walls."""

    pose: Pose
    covariance: Array
    inliers: float  # share of the points that found a wall
    rms: float  # metres from the walls
    scatter: float  # m^2, variance of a point's distance, if each of them erred by itself
    walls: NDArray[np.intp]  # the nearest wall point (K,) of each pair
    J: Array  # (3, K), of each pair's distance from its wall, by a step in the prior's frame
    JW: Array  # (3, K), the same times what the pair counts

    @property
    def information(self) -> Array:
        """What each pair tells of the pose (K, 3, 3): the covariance is by their sum."""
        told: Array = self.JW.T[:, :, None] * self.J.T[:, None]
        return told


class Sides(NamedTuple):
    """From which side walls are seen: directions to there, of any length; 0 is either side.

    `of_walls` (M, 2) are those from the wall points, `of_points` (N, 2) those from the points that
    are registered, in their frame.
    """

    of_walls: Array
    of_points: Array


class _Pairs(NamedTuple):
    """Points (2, K) of the frame that is registered, and the walls they are near to.

    Of a wall its normal (2, K), and its distance (K,) from the origin along that.
    """

    points: Array
    normal: Array
    distance: Array
    walls: NDArray[np.intp]  # the nearest wall point (K,) of each


def register(
    points: Array,
    walls: cKDTree,
    prior: Pose,
    Q: Array,
    config: ScanMatchingConfig,
    hits: Array | None = None,
    sides: Sides | None = None,
    within: float = _CONVERGED,
    found: Pose | None = None,
) -> Registration | None:
    """The pose that lays points (N, 2) of its frame onto points of walls (M, 2), near a prior.

    `hits` (M,) is how much each wall point counts beside its neighbours, by default all the same;
    without `sides` a point may lie on either face of a wall. It is found when a step is less than
    `within`, m and rad.
    Q (3, 3) is the prior's covariance in its own frame. None when too few points find a wall, or
    when it comes near to where another prior has led, which has been `found`.
    """
    if found is not None and not _is_elsewhere(found, prior, _LED_ALIKE):
        return None
    information = inverse(Q)
    counts = np.ones(walls.n) if hits is None else hits

    def paired(pose: Pose) -> _Pairs:
        return _pairs(points, pose, walls, counts, config.max_pair_m, sides)

    pose, step = prior, np.zeros(3)  # from the prior to the pose
    A, near, residual = information, np.empty(0, bool), np.empty(0)
    J = JW = np.empty((3, 0))
    paired_at, pairs = pose, paired(pose)
    for _ in range(_ITERATIONS):
        if found is not None and not _is_elsewhere(found, pose, _LED_ALIKE):
            return None
        if _is_elsewhere(paired_at, pose):
            paired_at, pairs = pose, paired(pose)
        near, residual, J = _linear(pairs, pose, prior, config.max_pair_m)
        if len(residual) < config.min_pairs:
            return None
        JW = J * _weights(residual, config)
        A = information + JW @ J.T
        change = -solved(A, information @ step + JW @ residual)
        step = step + change
        pose = prior.compose(Pose.from_array(step))
        if max(map(abs, change.tolist())) < within:
            break
    rms = math.sqrt(float(residual @ residual) / len(residual))
    share = len(residual) / len(points)
    scatter, nearest = _scatter(residual), pairs.walls[near]
    return Registration(pose, inverse(A), share, rms, scatter, nearest, J, JW)


def register_coarsely(
    points: Array,
    walls: cKDTree,
    prior: Pose,
    Q: Array,
    config: ScanMatchingConfig,
    reaches: tuple[float, ...],
    hits: Array | None = None,
    sides: Sides | None = None,
    found: Pose | None = None,
) -> Registration | None:
    """As `register`, from farther away: pairs first reach as far as each of `reaches`, m.

    A match is where the next one starts, with the same Q around it.
    """
    for reach in reaches:
        far = replace(config, max_pair_m=reach)
        near = register(points, walls, prior, Q, far, hits, sides, _ROUGHLY)
        prior = prior if near is None else near.pose
    return register(points, walls, prior, Q, config, hits, sides, found=found)


def _scatter(residual: Array) -> float:
    """The variance that means of neighbouring residuals (K,) tell of, m^2.

    Neighbours that err together do not cancel (batch means).
    """
    means = residual[: len(residual) // _BATCH * _BATCH].reshape(-1, _BATCH).sum(axis=1) / _BATCH
    return _BATCH * float(means @ means) / len(means)


def _weights(residual: Array, config: ScanMatchingConfig) -> Array:
    """What pairs count, 1/m^2, by their residuals (K,), less from two sigmas on.

    By the square, as Cauchy's: what has changed, or just come into view, lets go in the end.
    """
    sigma = config.pair_sigma_m
    far = np.maximum(1.0, np.abs(residual) * (0.5 / sigma))
    weights: Array = config.independent_share / sigma**2 / far**2
    return weights


def _is_elsewhere(before: Pose, now: Pose, times: float = 1.0) -> bool:
    """Whether points have moved some times as far as it takes to be near to other walls."""
    turned = abs(wrap_angle(now.theta - before.theta))
    return before.distance(now) > times * _SAME_PAIRS_M or turned > times * _SAME_PAIRS_RAD


def _pairs(
    points: Array,
    pose: Pose,
    walls: cKDTree,
    hits: Array,
    reach: float,
    sides: Sides | None,
) -> _Pairs:
    """The points (N, 2) that are near to a wall when laid down at a pose, and where that is."""
    world = pose.transform(points)
    is_close, farthest = reach <= _REACH_M, max(reach, _REACH_M)
    found = walls.query(world, k=_NEIGHBOURS, distance_upper_bound=farthest)
    distance, near = np.asarray(found[0]), np.asarray(found[1])
    present = np.isfinite(distance)
    paired = (present[:, _FEWEST - 1] & (distance[:, 0] < reach)).nonzero()[0]
    present, points = present.take(paired, axis=0), points.take(paired, axis=0)
    distance, near = distance.take(paired, axis=0), near.take(paired, axis=0)
    z = _complex(walls.data).take(near, mode="clip")
    counts = present * hits.take(near, mode="clip")  # those that are not present have no index
    closeness: Array | float = 1.0
    if is_close:  # the distance from the wall is in all squares, and makes no difference
        square = np.minimum(distance, farthest) ** 2
        closeness = (_BEYOND * square[:, -1:] - square) ** 2
    raw = counts * closeness
    weight, centre, turned = _lines(z, raw)
    if sides is not None:
        of_points = _complex(sides.of_points).take(paired)
        of_walls = _complex(sides.of_walls).take(near, mode="clip")
        facing = _facing(of_points * cmath.rect(1.0, pose.theta), of_walls, turned) & present
        shown = np.einsum("kg->k", facing.view(np.int8))
        enough = shown >= _FEWEST
        counts *= facing & enough[:, None]
        mixed = (enough & (shown < np.einsum("kg->k", present.view(np.int8)))).nonzero()[0]
        if len(mixed):
            shown_only = raw.take(mixed, axis=0) * facing.take(mixed, axis=0)
            fitted = _lines(z.take(mixed, axis=0), shown_only)
            weight[mixed], centre[mixed], turned[mixed] = fitted
    off = (z - centre[:, None]) * turned[:, None]  # along the wall, and across
    across, spread = (np.einsum("kg,kg->k", counts, d * d) for d in (off.imag, off.real))
    lines = (across < _FLATNESS * spread).nonzero()[0]
    centre, turned = centre.take(lines), turned.take(lines)
    normal = np.array([turned.imag, turned.real])
    to_wall = (centre * turned).imag
    if is_close:
        at = _complex(world).take(paired.take(lines))
        beside = ((at - centre) * turned).real
        to_wall += _bulge(off.take(lines, axis=0), weight.take(lines, axis=0), beside)
    return _Pairs(points.take(lines, axis=0).T, normal, to_wall, near[lines, 0])


def _complex(points: Array) -> Complexes:
    """Points (N, 2) as x + iy (N,)."""
    return points.view(np.complex128).ravel()


def _facing(of_points: Complexes, of_walls: Complexes, turned: Complexes) -> NDArray[np.bool_]:
    """Which of the wall points (K, G) beside points (K,) were seen from the side these show.

    Directions to there are `of_points` (K,) and `of_walls` (K, G); walls that are `turned` by (K,)
    lie along x.
    """
    now, before = (of_points * turned).imag, (of_walls * turned[:, None]).imag
    least = _GRAZING * np.abs(of_points)
    return np.asarray(before * now[:, None] >= before**2 * least[:, None])


def _linear(
    pairs: _Pairs, pose: Pose, prior: Pose, reach: float
) -> tuple[NDArray[np.bool_], Array, Array]:
    """Which walls are within reach, signed distances (K,) from these, and the derivative (3, K).

    That is the derivative by a step of the pose in the prior's frame.
    """
    (x, y), (nx, ny) = pairs.points, pairs.normal
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    u, v = c * x - s * y, s * x + c * y
    residual = (u + pose.x) * nx + (v + pose.y) * ny - pairs.distance
    c, s = math.cos(prior.theta), math.sin(prior.theta)
    J = np.array([c * nx + s * ny, c * ny - s * nx, u * ny - v * nx])
    near = np.abs(residual) < reach
    return (near, residual, J) if near.all() else (near, residual[near], J[:, near])


def _lines(z: Complexes, weight: Array) -> tuple[Array, Complexes, Complexes]:
    """Groups of points (K, G): weights that add up to 1, centres (K,), what turns lines along x.

    The mean square of what complex numbers are off their centre has twice the angle of the line.
    """
    weight = weight / np.einsum("kg->k", weight)[:, None]
    centre = np.einsum("kg,kg->k", weight, z)
    off = z - centre[:, None]
    return weight, centre, np.exp(-0.5j * np.angle(np.einsum("kg,kg->k", weight, off * off)))


def _bulge(off: Complexes, weight: Array, beside: Array) -> Array:
    """How far (K,) walls are off lines through groups of points (K, G), at so many m along them.

    Walls are parabolas, bend (u^2 - spread) off the line, u m from its centre, and beyond the last
    of the points as far off as there; at corners they are lines. Points are where they are `off`
    the centre, along the line and across.
    """
    square = off.real**2
    weighted = weight * square
    spread = np.einsum("kg->k", weighted)
    told = np.einsum("kg,kg->k", weighted, square) - spread * spread
    bend = np.einsum("kg,kg->k", weighted, off.imag) / (told + _BEND_M4)
    bulge = bend * (np.minimum(beside * beside, 2.0 * spread) - spread)
    return np.where(4.0 * bend * bend * spread < _CORNER**2, bulge, 0.0)
