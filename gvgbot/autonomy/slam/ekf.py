"""EKF-SLAM over the robot's pose and one pose per vertex.

State x = (x, y, theta, then x, y, psi of each vertex), map frame; P its covariance. A vertex's
frame has its origin on the vertex and the orientation that the local frame had when the vertex was
first seen, so that bearings and snapshots stored with the vertex turn with it. Behind the vertices
may be old poses of the robot (`trail`), which are corrected with all the rest. Letters as in the
literature: F, G Jacobians, H measurement Jacobian, K gain, S innovation covariance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.small_systems import solved
from gvgbot.geometry import Array, Pose, turn_matrix, wrap_angle, wrap_angles
from gvgbot.ranges import Range

Index = NDArray[np.intp]

_LARGE_M = 0.3  # an innovation from which on Jacobians are taken again
_ITERATIONS = 5
_ROWS = 128  # of P that are corrected at a time: they fit into a cache


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """How the variance of dead reckoning grows with distance, turning and time."""

    along_m_per_sqrt_m: Annotated[float, Range(0.0, 1.0)] = 0.03  # along the way, by driving
    along_m_per_sqrt_rad: Annotated[float, Range(0.0, 1.0)] = 0.01  # along the way, by turning
    turn_rad_per_sqrt_rad: Annotated[float, Range(0.0, 1.0)] = 0.02  # heading, by turning
    turn_rad_per_sqrt_m: Annotated[float, Range(0.0, 1.0)] = 0.01  # heading, by driving
    turn_rad_per_sqrt_s: Annotated[float, Range(0.0, 1.0)] = 0.003  # heading, by time alone

    def covariance(self, motion: Pose, duration: float) -> Array:
        """Covariance (3, 3) of a short motion, in the frame of its start."""
        return np.asarray(self.parts(motion, duration).sum(axis=0), np.float64)

    def parts(self, motion: Pose, duration: float) -> Array:
        """What that covariance is the sum of (4, 3, 3).

        It is the way by driving, the place by turning, the heading by turning, and the heading by
        driving and by time. White noise on distance and heading along an almost straight stretch
        of length d: heading noise that accrues evenly shows up sideways with d^2/3 and correlated
        with d/2.
        """
        d, turn = math.hypot(motion.x, motion.y), abs(motion.theta)
        along = self.along_m_per_sqrt_m**2 * d + 1e-8
        beside = self.along_m_per_sqrt_rad**2 * turn
        by_turning = self.turn_rad_per_sqrt_rad**2 * turn
        by_driving = self.turn_rad_per_sqrt_m**2 * d + self.turn_rad_per_sqrt_s**2 * duration
        c, s = (motion.x / d, motion.y / d) if d > 0.0 else (1.0, 0.0)
        chord = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        heading = np.array([[0.0, 0.0, 0.0], [0.0, d * d / 3, d / 2], [0.0, d / 2, 1.0]])
        along_chord = np.array(
            [
                [[along, 0.0, 0.0], [0.0, 1e-8, 0.0], [0.0, 0.0, 0.0]],
                [[beside, 0.0, 0.0], [0.0, beside, 0.0], [0.0, 0.0, 0.0]],
                by_turning * heading,
                (by_driving + 1e-10) * heading,
            ]
        )
        return np.asarray(chord @ along_chord @ chord.T, np.float64)


class Clone(NamedTuple):
    """An old pose of the robot that is in the state, for so many looks at walls from one on."""

    local_base: Pose  # where the local frame has it
    first: int  # look, by its number
    looks: int
    slot: int  # its place in the trail's part of the state


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Mean x (3 + 3n,) and covariance P of the robot and the vertices, in the order of `ids`.

    With a `trail`, oldest pose first, both go on behind the vertices as module `trail` has it.
    """

    x: Array = field(default_factory=lambda: np.zeros(3))
    P: Array = field(default_factory=lambda: np.zeros((3, 3)))
    ids: tuple[int, ...] = ()
    trail: tuple[Clone, ...] = ()

    @property
    def map_base(self) -> Pose:
        """The robot's pose."""
        return Pose.from_array(self.x[:3])

    @property
    def positions(self) -> Array:
        """Where the vertices are (N, 2), in the order of `ids`."""
        return self.x[3 : self.end].reshape(-1, 3)[:, :2]

    @property
    def end(self) -> int:
        """The size of the part of the state that is the robot and the vertices."""
        return 3 + 3 * len(self.ids)

    def row_of(self, vertex: int) -> int:
        """The first of the three rows of a vertex in the state."""
        return 3 + 3 * self.ids.index(vertex)

    def map_vertex(self, vertex: int) -> Pose:
        """The pose of a vertex's frame."""
        i = self.row_of(vertex)
        return Pose.from_array(self.x[i : i + 3])

    def vertex_covariance(self, vertex: int) -> Array:
        """Position covariance (2, 2) of a vertex, m^2."""
        i = self.row_of(vertex)
        return self.P[i : i + 2, i : i + 2].copy()  # an old belief's P may be that of a later one


def predict(belief: Belief, motion: Pose, Q: Array) -> Belief:
    """The belief after a motion (base seen from where it was) with covariance Q (3, 3)."""
    return predict_in_place(replace(belief, P=belief.P.copy()), motion, Q)


def predict_in_place(belief: Belief, motion: Pose, Q: Array) -> Belief:
    """As `predict`, but in the covariance of the old belief, which is valid no more.

    What vertices know of each other stays where it is, however many there are.
    """
    moved, F, G = composed(belief.map_base, motion)
    x, P = belief.x.copy(), belief.P
    x[:3] = moved.x, moved.y, moved.theta
    P[:3, 3:] = F @ P[:3, 3:]
    P[3:, :3] = P[:3, 3:].T
    P[:3, :3] = F @ P[:3, :3] @ F.T + G @ Q @ G.T
    return replace(belief, x=x, P=P)


def without_trail(belief: Belief) -> Belief:
    """The belief of the robot and the vertices alone; it shares its parts with the other one."""
    return Belief(belief.x[: belief.end], belief.P[: belief.end, : belief.end], belief.ids)


def add_vertex(belief: Belief, vertex: int, base_vertex: Pose, R: Array) -> Belief:
    """The belief with a vertex first seen at a pose in the base frame, with covariance R (3, 3)."""
    n, end = len(belief.x), belief.end
    placed, J_r, J_z = composed(belief.map_base, base_vertex)
    across = J_r @ belief.P[:3]
    P, own = np.empty((n + 3, n + 3)), slice(end, end + 3)
    kept = ((slice(end), slice(end)), (slice(end, n), slice(end + 3, n + 3)))
    for old, new in kept:
        for other_old, other_new in kept:
            P[new, other_new] = belief.P[old, other_old]
        P[own, new], P[new, own] = across[:, old], across[:, old].T
    P[own, own] = J_r @ belief.P[:3, :3] @ J_r.T + J_z @ R @ J_z.T
    x = np.insert(belief.x, end, [placed.x, placed.y, placed.theta])
    return replace(belief, x=x, P=P, ids=(*belief.ids, vertex))


def place_robot(belief: Belief, vertex: int, vertex_base: Pose, R: Array) -> Belief:
    """The belief of a robot of which is known where a vertex has it, with covariance R (3, 3).

    Pose and covariance are in the vertex's frame. What it believed of its own place is forgotten.
    """
    belief, i = without_trail(belief), belief.row_of(vertex)
    placed, J_v, J_z = composed(belief.map_vertex(vertex), vertex_base)
    x, P = belief.x.copy(), belief.P.copy()
    x[:3] = placed.x, placed.y, placed.theta
    P[:3, 3:] = J_v @ belief.P[i : i + 3, 3:]
    P[3:, :3] = P[:3, 3:].T
    P[:3, :3] = J_v @ belief.P[i : i + 3, i : i + 3] @ J_v.T + J_z @ R @ J_z.T
    return Belief(x, P, belief.ids)


def composed(a_b: Pose, b_c: Pose) -> tuple[Pose, Array, Array]:
    """The pose a_c, and its Jacobians (3, 3) by either pose."""
    by_second = turn_matrix(a_b.theta)
    c, s = by_second[:2, 0]
    by_first = np.array(
        [
            [1.0, 0.0, -s * b_c.x - c * b_c.y],
            [0.0, 1.0, c * b_c.x - s * b_c.y],
            [0.0, 0.0, 1.0],
        ]
    )
    return a_b.compose(b_c), by_first, by_second


def remove_vertex(belief: Belief, vertex: int) -> Belief:
    """The belief without a vertex that proved to be none."""
    i = belief.row_of(vertex)
    keep = np.delete(np.arange(len(belief.x)), slice(i, i + 3))
    ids = tuple(v for v in belief.ids if v != vertex)
    return replace(belief, x=belief.x[keep], P=belief.P[np.ix_(keep, keep)], ids=ids)


def expected(belief: Belief, vertex: int) -> tuple[Pose, Array]:
    """Pose of a vertex in the base frame, and its Jacobian H (3, 3 + 3n)."""
    i = belief.row_of(vertex)
    base_vertex = belief.map_base.to(belief.map_vertex(vertex))
    c, s = math.cos(belief.x[2]), math.sin(belief.x[2])
    H = np.zeros((3, len(belief.x)))
    H[:2, :2] = [[-c, -s], [s, -c]]
    H[:2, 2] = base_vertex.y, -base_vertex.x
    H[:2, i : i + 2] = [[c, s], [-s, c]]
    H[2, 2], H[2, i + 2] = -1.0, 1.0
    return base_vertex, H


def innovation(
    belief: Belief, vertex: int, base_vertex: Pose, R: Array
) -> tuple[Array, Array, Array]:
    """Measured minus expected pose of a vertex r, its covariance S, and H.

    R of shape (2, 2) uses the position alone, (3, 3) the heading as well.
    """
    r, H = _residual(belief, vertex, base_vertex, len(R))
    used = _used(belief, vertex)
    H_used = H[:, used]
    return r, H_used @ belief.P[used[:, None], used] @ H_used.T + R, H


def _used(belief: Belief, vertex: int) -> Index:
    """The part (6,) of the state that a sight of a vertex depends on: H is 0 elsewhere."""
    i = belief.row_of(vertex)
    used: Index = np.array([0, 1, 2, i, i + 1, i + 2])
    return used


def _residual(belief: Belief, vertex: int, base_vertex: Pose, k: int) -> tuple[Array, Array]:
    """The first k components of measured minus expected pose of a vertex, and their Jacobian."""
    foreseen, H = expected(belief, vertex)
    r = [
        base_vertex.x - foreseen.x,
        base_vertex.y - foreseen.y,
        wrap_angle(base_vertex.theta - foreseen.theta),
    ]
    return np.array(r[:k]), H[:k]


def distances(belief: Belief, base_point: Array, R: Array) -> tuple[Array, Array]:
    """How far a point (2,) in the base frame, with covariance R (2, 2), is from each vertex.

    Squared Mahalanobis distances and metres, both (N,), in the order of the belief's ids.
    """
    r, S = offsets(belief, base_point, R)
    d2 = (r * np.linalg.solve(S, r[:, :, None])[:, :, 0]).sum(axis=1)
    return d2, np.hypot(r[:, 0], r[:, 1])


def offsets(belief: Belief, base_point: Array, R: Array) -> tuple[Array, Array]:
    """A point (2,) in the base frame, with covariance R (2, 2), as seen from each vertex.

    Offsets (N, 2) in the base frame and their covariances (N, 2, 2), in the order of the ids.
    """
    c, s = math.cos(belief.x[2]), math.sin(belief.x[2])
    base_map = np.array([[c, s], [-s, c]])  # rotation
    foreseen = (belief.positions - belief.x[:2]) @ base_map.T
    r = base_point - foreseen
    n = len(r)
    H = np.empty((n, 2, 5))  # by the pose of the robot and the vertex's position
    H[:, :, :2], H[:, :, 3:] = -base_map, base_map
    H[:, 0, 2], H[:, 1, 2] = foreseen[:, 1], -foreseen[:, 0]
    at = np.tile(np.arange(5), (n, 1))
    at[:, 3:] += 3 * np.arange(n)[:, None]
    return r, H @ belief.P[at[:, :, None], at[:, None, :]] @ H.swapaxes(1, 2) + R


def apart(belief: Belief, vertex: int, others: Sequence[int]) -> tuple[Array, Array]:
    """A vertex as seen from others, map frame: offsets (N, 2) and their covariances (N, 2, 2)."""
    i = belief.row_of(vertex)
    at = np.array([belief.row_of(other) for other in others], int)
    j = at[:, None] + np.arange(2)
    P, here = belief.P, slice(i, i + 2)
    across = P[here][:, j].transpose(1, 0, 2)
    S = P[here, here] + P[j[:, :, None], j[:, None, :]] - across - across.swapaxes(1, 2)
    return belief.x[here] - belief.x[j], S


def unite(belief: Belief, kept: int, gone: int, R: Array) -> Belief:
    """The belief when two vertices are one, whose places were seen with R (2, 2); one id goes."""
    return remove_vertex(coincide(belief, kept, gone, R), gone)


def coincide(belief: Belief, one: int, other: int, R: Array) -> Belief:
    """The belief when two vertices stand in one place, which was seen with R (2, 2) both times."""
    i, j = (belief.row_of(vertex) for vertex in (one, other))
    H = np.zeros((2, len(belief.x)))
    H[:, i : i + 2], H[:, j : j + 2] = np.eye(2), -np.eye(2)
    S = H @ belief.P @ H.T + R
    K = np.asarray(np.linalg.solve(S, H @ belief.P).T, np.float64)
    x = _wrapped(belief.x + K @ (belief.x[j : j + 2] - belief.x[i : i + 2]))
    P = belief.P - K @ S @ K.T
    return replace(belief, x=x, P=(P + P.T) / 2)


def part(belief: Belief, vertices: Sequence[int]) -> Belief:
    """The belief of the robot and of some of the vertices, all else left out."""
    at = [belief.row_of(vertex) for vertex in vertices]
    rows = np.concatenate([np.arange(3), *(np.arange(i, i + 3) for i in at)])
    return Belief(belief.x[rows], belief.P[np.ix_(rows, rows)], tuple(vertices))


def update_in_place(belief: Belief, vertex: int, base_vertex: Pose, R: Array) -> Belief:
    """The belief after seeing a vertex again; Joseph form, positive whatever the gain.

    It is in the covariance of the old belief, which is valid no more. Every element of P changes;
    what it costs is to read and to write them once.

    After a large innovation the Jacobian of where the robot thought to be is not that of where it
    is: it is taken again from there, as Gauss and Newton would (the iterated Kalman filter).
    """
    used = _used(belief, vertex)
    P_used = belief.P[used]  # HP = H P_used

    def corrected(x: Array) -> tuple[Array, Array, Array, Array]:
        """The mean, K, HP and the used part of H, with the Jacobian at x."""
        r, H = _residual(replace(belief, x=x), vertex, base_vertex, len(R))
        H = H[:, used]
        HP = H @ P_used
        K = np.asarray(np.linalg.solve(HP[:, used] @ H.T + R, HP).T, np.float64)
        back = _wrapped(belief.x - x)[used]
        return _wrapped(belief.x + K @ (r - H @ back)), K, HP, H

    x, K, HP, H = corrected(belief.x)
    if belief.map_base.to(belief.map_vertex(vertex)).distance(base_vertex) > _LARGE_M:
        for _ in range(_ITERATIONS):
            x, K, HP, H = corrected(x)
    # (I - K H) P (I - K H)' + K R K' = P - K L' - L K'
    L = HP.T - K @ (HP[:, used] @ H.T + R) / 2
    _subtract(belief.P, np.hstack([K, L]), np.hstack([L, K]).T)
    return replace(belief, x=x)


def update_vertex_in_place(belief: Belief, vertex: int, base_vertex: Pose, R: Array) -> Belief:
    """As `update_in_place`, but only the vertex is moved, whatever that would tell of all else.

    Joseph's form is valid for any gain. What it costs grows with the number of vertices.
    """
    used = _used(belief, vertex)
    own = slice(int(used[3]), int(used[5]) + 1)
    r, H = _residual(belief, vertex, base_vertex, len(R))
    H = H[:, used]
    HP = H @ belief.P[used]
    S = HP[:, used] @ H.T + R
    K = solved(S, HP[:, own]).T
    x, P = belief.x.copy(), belief.P
    x[own] += K @ r
    # (I - K H) P (I - K H)' + K R K' = P - K HP - P H' K' + K S K'
    less = K @ HP
    P[own] -= less
    P[:, own] -= less.T
    P[own, own] += K @ S @ K.T
    return replace(belief, x=_wrapped(x))


def _subtract(P: Array, left: Array, right: Array) -> None:
    """Take a symmetric product (N, K) (K, N) from P, which stays symmetric to the last bit."""
    right = np.ascontiguousarray(right)
    for i in range(0, len(P), _ROWS):
        j = i + _ROWS
        block = P[i:j, i:]
        block -= left[i:j] @ right[:, i:]
        block[:, :_ROWS] = (block[:, :_ROWS] + block[:, :_ROWS].T) / 2
        P[j:, i:j] = block[:, _ROWS:].T


def _wrapped(x: Array) -> Array:
    """A state, or a difference of two, with its headings wrapped."""
    x = x.copy()
    x[2::3] = wrap_angles(x[2::3])
    return x


def mahalanobis(r: Array, S: Array) -> float:
    """Squared Mahalanobis distance of an innovation."""
    return float(r @ solved(S, r))
