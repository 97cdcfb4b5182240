"""Laying one chart on another: by vertices that are the same, and by walls."""

import numpy as np

from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, Sides, register_coarsely
from gvgbot.geometry import Array, Pose
from gvgbot.team.chart import Chart
from gvgbot.team.side import Side

_LAYING = ScanMatchingConfig(pair_sigma_m=0.05)  # walls of one chart on those of another
_LAID_FROM_M = (0.6,)  # farther away, in the beginning
_LAID_BY_M = 1.5  # at most, where the other robot has been
_LOOSELY = np.diag([1.0, 1.0, 0.1**2])  # what is known before, where walls tell nothing


def fitted(ours: Chart, theirs: Chart, pairs: tuple[tuple[int, int], ...]) -> tuple[Pose, Array]:
    """The pose of the other's frame in ours that lays pairs on each other, and its covariance.

    The covariance (3, 3) is by how far apart they stay, with none of the belief that all of them
    err independently: vertices of one chart err together.
    """
    a = np.array([ours.vertices[i].position for i, _ in pairs])
    b = np.array([theirs.vertices[j].position for _, j in pairs])
    return least_squares(a, b)


def least_squares(a: Array, b: Array) -> tuple[Pose, Array]:
    """The pose for which b's points (N, 2), laid by it, are nearest to a's; its covariance."""
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.vdot(v - v.mean(), u - u.mean())
    turn = turn / abs(turn) if turn else 1.0  # one point says nothing of it
    shift = u.mean() - v.mean() * turn
    pose = Pose(float(shift.real), float(shift.imag), float(np.angle(turn)))
    off = a - pose.transform(b)
    variance = max(float((off**2).sum() / max(1, 2 * len(a) - 3)), 1e-4)
    spread = max(float((np.abs(v - v.mean()) ** 2).mean()), 1e-6)
    middle = pose.transform(b).mean(axis=0)
    lever = np.array([middle[1] - pose.y, -(middle[0] - pose.x)])  # of the origin by the turn
    of_turn = variance / spread
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = variance * np.eye(2) + of_turn * np.outer(lever, lever)
    covariance[:2, 2] = covariance[2, :2] = of_turn * lever
    covariance[2, 2] = of_turn
    return pose, covariance


def laid_on_walls(a: Side, b: Side, pose: Pose) -> Pose:
    """The pose of b's frame in a's, known about, by all walls that both tell of.

    They say more of the turn than vertices. It stays as it was if too few are shared, or if they
    would move it far.
    """
    if min(len(a.walls.data), len(b.walls.data)) < _LAYING.min_pairs:
        return pose
    found = register_coarsely(
        b.walls.data,
        a.walls,
        a.walls.data,
        pose,
        _LOOSELY,
        _LAYING,
        _LAID_FROM_M,
        sides=Sides(a.sights, b.sights),
    )
    if found is None:
        return pose
    moved_by = found.pose.transform(b.points) - pose.transform(b.points)
    return found.pose if np.hypot(*moved_by.T).max() < _LAID_BY_M else pose
