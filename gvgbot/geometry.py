"""Planar geometry: angles, poses and twists, in metres, radians and seconds."""

import math
from array import array
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_BACK = math.cos(math.radians(100.0))  # of a turn in a line that is none of an edge
_SAME_M = 1e-6  # no farther apart, two points are one


def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_angles(angles: Array) -> Array:
    """The same directions in (-pi, pi], of any shape; what is in there already stays as it is."""
    wrapped = angles - math.tau * np.rint(angles / math.tau)
    return np.where(np.abs(wrapped) >= math.pi, math.pi, wrapped)


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame seen from another, named parent_child: `map_base` is the base in the map.

    x, y in metres, theta in radians, anticlockwise; theta is not wrapped by construction.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def compose(self, other: "Pose") -> "Pose":
        """a_b.compose(b_c) = a_c."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            wrap_angle(self.theta + other.theta),
        )

    def inverse(self) -> "Pose":
        """a_b.inverse() = b_a."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, wrap_angle(-self.theta))

    def to(self, other: "Pose") -> "Pose":
        """The motion from this pose to the other: a_b.to(a_c) = b_c."""
        return self.inverse().compose(other)

    def part(self, share: float) -> "Pose":
        """A share of a motion that is small, or goes on as it began."""
        return Pose(share * self.x, share * self.y, share * self.theta)

    def towards(self, other: "Pose", share: float) -> "Pose":
        """The pose at a share of the straight way to another, turning evenly and the short way."""
        return self.compose(self.to(other).part(share))

    def distance(self, other: "Pose") -> float:
        """Metres between the two origins."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def is_near(self, other: "Pose", metres: float, radians: float) -> bool:
        """Whether another pose is nearer than so much, and turned by less."""
        return self.distance(other) < metres and abs(wrap_angle(self.theta - other.theta)) < radians

    def transform(self, points: Array) -> Array:
        """Points (N, 2) or (2,) of the child frame, in the parent frame."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        x, y = points[..., 0], points[..., 1]
        out = np.empty_like(points)
        out[..., 0] = self.x + c * x - s * y
        out[..., 1] = self.y + s * x + c * y
        return out

    @property
    def position(self) -> Array:
        """The origin as an array (2,)."""
        return np.array([self.x, self.y])

    @classmethod
    def from_array(cls, values: Array) -> Self:
        """Pose from (x, y, theta)."""
        return cls(float(values[0]), float(values[1]), float(values[2]))


def rows_of(poses: Iterable[Pose]) -> Array:
    """Poses as rows (N, 3) of x, y, theta."""
    rows = [(pose.x, pose.y, pose.theta) for pose in poses]
    return np.array(rows, np.float64).reshape(-1, 3)


class Poses:
    """A growing list of poses that takes 24 bytes for each, a fifth of what objects take."""

    def __init__(self, poses: Iterable[Pose] = ()) -> None:
        self._values = array("d")
        for pose in poses:
            self.append(pose)

    def __len__(self) -> int:
        return len(self._values) // 3

    def __getitem__(self, i: int) -> Pose:
        at = 3 * range(len(self))[i]
        return Pose(*self._values[at : at + 3])

    def append(self, pose: Pose) -> None:
        """Add a pose."""
        self._values.extend((pose.x, pose.y, pose.theta))

    def extend(self, rows: Array) -> None:
        """Add rows (N, 3) of x, y, theta."""
        self._values.frombytes(np.ascontiguousarray(rows, np.float64).tobytes())

    def cut(self, first: int) -> None:
        """Take out all from a first one on."""
        del self._values[3 * first :]

    def rows(self, start: int = 0, end: int | None = None) -> Array:
        """A copy of poses from one on, up to the one before `end`, as rows of x, y, theta."""
        values = self._values[3 * start : None if end is None else 3 * end]
        return np.array(values, np.float64).reshape(-1, 3)


def composed(a_b: Array, b_c: Array) -> Array:
    """Poses a_c as rows (N, 3) of x, y, theta, from a_b and b_c: `Pose.compose` for many."""
    cos, sin = np.cos(a_b[:, 2]), np.sin(a_b[:, 2])
    x, y, turn = b_c.T
    theta = wrap_angles(a_b[:, 2] + turn)
    return np.column_stack([a_b[:, 0] + cos * x - sin * y, a_b[:, 1] + sin * x + cos * y, theta])


def seen_from(a_b: Array, a_c: Array) -> Array:
    """Poses b_c as rows (N, 3) of x, y, theta, from a_b and a_c: `Pose.to` for many."""
    cos, sin = np.cos(a_b[:, 2]), np.sin(a_b[:, 2])
    x, y, turn = (a_c - a_b).T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x, wrap_angles(turn)])


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity of the base in its own frame: m/s ahead, rad/s anticlockwise."""

    linear: float = 0.0
    angular: float = 0.0


STANDSTILL = Twist()


def turn_matrix(angle: float) -> Array:
    """What turns x, y and a heading (3, 3) anticlockwise by an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotated_covariance(covariance: Array, angle: float) -> Array:
    """Pose covariances (..., 3, 3) of a frame, from one against which that frame is turned."""
    turn = turn_matrix(angle)
    rotated: Array = turn @ covariance @ turn.T
    return rotated


def length_of(line: Array) -> float:
    """The length of a line (N, 2), in its unit; 0 for less than two points."""
    return float(np.hypot(*(line[1:] - line[:-1]).T).sum())


def stations_of(line: Array) -> Array:
    """How far it is along a line (N, 2) to each of its points (N,), in its unit."""
    return np.concatenate([[0.0], np.hypot(*(line[1:] - line[:-1]).T).cumsum()])


def anchored(line: Array, start: Array, end: Array) -> Array:
    """A line (N, 2), bent so that it begins and ends at two points (2,), in its unit.

    What its ends are off by is spread over its length.
    """
    along = stations_of(line)
    share = (along / max(along[-1], 1e-9))[:, None]
    bent: Array = line + (1 - share) * (start - line[0]) + share * (end - line[-1])
    return bent


def without_spikes(line: Array) -> Array:
    """A line (N, 2) along an edge of the GVG without the points where it turns back: (M, 2).

    Where the way into a corner is left out, an edge turns by a right angle at most. Where a line
    turns by more, pieces were put together that do not fit, or its end was moved.
    """
    while len(line) > 2:
        steps = np.diff(line, axis=0)
        lengths = np.hypot(*steps.T)
        ahead = (steps[1:] * steps[:-1]).sum(axis=1) / np.maximum(lengths[1:] * lengths[:-1], 1e-9)
        ahead[np.minimum(lengths[1:], lengths[:-1]) < _SAME_M] = -1.0
        sharpest = int(ahead.argmin())
        if ahead[sharpest] > _BACK:
            break
        line = np.delete(line, sharpest + 1, axis=0)
    return line


def direction_of(line: Array, over: float) -> float:
    """In which a line (N, 2) of two points or more sets out, rad.

    Taken to where it is first so far from its start, in its unit, or else to its end.
    """
    reached = np.flatnonzero(np.hypot(*(line - line[0]).T) >= over)
    dx, dy = line[reached[0] if len(reached) else -1] - line[0]
    return math.atan2(dy, dx)


def resampled(line: Array, spacing: float) -> Array:
    """Points (M, 2) along a line (N, 2), its ends among them, not farther apart than `spacing`."""
    along = stations_of(line)
    at = np.linspace(0.0, along[-1], 2 + int(along[-1] / spacing))
    return np.column_stack([np.interp(at, along, values) for values in line.T])


def sampled(lines: Iterable[ArrayLike], spacing: float) -> Array:
    """Points (M, 2) along all lines, each (N, 2), as `resampled` has them."""
    parts = (resampled(np.asarray(line, np.float64), spacing) for line in lines)
    return np.concatenate([np.empty((0, 2)), *parts])


def thinned(points: Array, cell: float) -> Array:
    """One point (M, 2) for each cell of a grid that points (N, 2) are in: the mean of these."""
    if not len(points):
        return points
    cells = np.floor(points / cell).astype(np.int64)
    i, j = (cells - cells.min(axis=0)).T
    _, index, count = np.unique(i * (j.max() + 1) + j, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index, points[:, k]) / count for k in (0, 1)], axis=1)
