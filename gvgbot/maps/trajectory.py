"""Trajectories and their TUM form: a line `t x y z qx qy qz qw` per pose."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gvgbot.errors import UsageError
from gvgbot.geometry import Array, wrap_angles

_HOLE_S = 1.0  # from one row to the next: what was driven in a longer one is not told
_TUM_LINE = "%.6f %.6f %.6f 0 0 0 %.9f %.9f\n"


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time: `stamps` (N,) in s, `poses` (N, 3) as x, y (m), theta (rad); read-only."""

    stamps: Array
    poses: Array

    def __post_init__(self) -> None:
        if self.poses.shape != (len(self.stamps), 3):
            raise ValueError(f"{len(self.stamps)} stamps but poses of shape {self.poses.shape}")
        self.stamps.setflags(write=False)
        self.poses.setflags(write=False)

    @property
    def positions(self) -> Array:
        """x, y (N, 2) in m."""
        return self.poses[:, :2]

    @property
    def holes(self) -> NDArray[np.bool_]:
        """After which rows but the last nothing is told for a while (N - 1,), as in a lost robot's.

        It may have been carried meanwhile, or what it drove was forgotten.
        """
        holes: NDArray[np.bool_] = np.diff(self.stamps) > _HOLE_S
        return holes

    @property
    def stretches(self) -> list[Array]:
        """x, y (N, 2) in m, from hole to hole: lines that were driven."""
        return np.split(self.positions, np.flatnonzero(self.holes) + 1)


def encode_tum(trajectory: Trajectory) -> str:
    """The trajectory in TUM form: planar, so z, qx and qy are 0; qw is never negative."""
    half = wrap_angles(trajectory.poses[:, 2]) / 2.0
    rows = np.column_stack([trajectory.stamps, trajectory.positions, np.sin(half), np.cos(half)])
    return "".join(_TUM_LINE % tuple(row) for row in rows.tolist())


def decode_tum(text: str) -> Trajectory:
    """The planar part of a TUM trajectory, theta in (-pi, pi]; lines that begin with # are skipped.

    Raises UsageError, with the line's number, if a line is not eight finite numbers.
    """
    lines = enumerate(text.splitlines(), start=1)
    rows = [_row(line, number) for number, line in lines if line.strip() and line[0] != "#"]
    table = np.array(rows, np.float64).reshape(-1, 8)
    qx, qy, qz, qw = table[:, 4:].T
    theta = np.arctan2(2.0 * (qw * qz + qx * qy), qw**2 + qx**2 - qy**2 - qz**2)
    return Trajectory(table[:, 0], np.column_stack([table[:, 1:3], theta]))


def _row(line: str, number: int) -> list[float]:
    try:
        row = [float(word) for word in line.split()]
    except ValueError:
        row = []
    if len(row) != 8 or not all(map(math.isfinite, row)) or not any(row[4:]):
        raise UsageError(
            f"line {number} of the trajectory is not t x y z qx qy qz qw: {line[:60]!r}"
        )
    return row
