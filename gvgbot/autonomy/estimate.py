"""The best estimate of the whole run: all keyframes and vertices, corrected by later closures."""

import numpy as np

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.smoothing import Constraint, smooth
from gvgbot.geometry import Array, Pose


def smoothed(pipeline: Pipeline) -> tuple[list[Pose], dict[int, Pose]]:
    """The best estimate of all keyframes (map_base) and vertices (map_vertex)."""
    keyframes, mapper = pipeline.keyframes, pipeline.mapper
    ids = {vertex: len(keyframes) + i for i, vertex in enumerate(mapper.belief.ids)}
    start = [k.map_base for k in keyframes] + [mapper.belief.map_vertex(v) for v in ids]
    constraints = [
        Constraint(i, i + 1, step.motion, _inverse(step.covariance))
        for i, step in enumerate(pipeline.steps[: len(keyframes) - 1])
    ]
    for seen in mapper.observations:
        if seen.vertex in ids and seen.keyframe < len(keyframes):
            information = np.zeros((3, 3))
            k = len(seen.R)
            information[:k, :k] = _inverse(seen.R)
            constraints.append(
                Constraint(seen.keyframe, ids[seen.vertex], seen.base_vertex, information)
            )
    x = smooth(np.array([(p.x, p.y, p.theta) for p in start]).reshape(-1, 3), constraints)
    poses = [Pose.from_array(row) for row in x]
    return poses[: len(keyframes)], {vertex: poses[i] for vertex, i in ids.items()}


def _inverse(covariance: Array) -> Array:
    return np.asarray(np.linalg.inv(covariance), np.float64)
