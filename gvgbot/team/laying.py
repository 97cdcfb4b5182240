"""Laying one chart on another: by vertices that are the same, and by walls."""

import numpy as np

from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig, Sides, register_coarsely
from gvgbot.geometry import Array, Pose
from gvgbot.registration import rigid_fit
from gvgbot.team.chart import Chart
from gvgbot.team.side import Side

_LAYING = ScanMatchingConfig(pair_sigma_m=0.05)  # walls of one chart on those of another
_LAID_FROM_M = (0.6,)  # farther away, in the beginning
_LAID_BY_M = 1.5  # at most, where the other robot has been
_LOOSELY = np.diag([1.0, 1.0, 0.1**2])  # what is known before, where walls tell nothing


def fitted(ours: Chart, theirs: Chart, pairs: tuple[tuple[int, int], ...]) -> tuple[Pose, Array]:
    """The pose of the other's frame in ours that lays pairs on each other; its covariance."""
    a = np.array([ours.vertices[i].position for i, _ in pairs])
    b = np.array([theirs.vertices[j].position for _, j in pairs])
    return rigid_fit(a, b)


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
