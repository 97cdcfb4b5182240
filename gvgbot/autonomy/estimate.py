"""The best estimate of the whole run: all keyframes and vertices, corrected by later closures."""

from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.smoothing import Constraint, PoseGraph
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Array, Pose


class Estimate(NamedTuple):
    """Keyframes (map_base), and by id vertices (map_vertex) and their covariances (2, 2) in m^2."""

    keyframes: list[Pose]
    vertices: dict[int, Pose]
    covariances: dict[int, Array]


def smoothed(pipeline: Pipeline) -> Estimate:
    """The best estimate of all keyframes and vertices."""
    keyframes, mapper = pipeline.keyframes, pipeline.mapper
    ids = {vertex: len(keyframes) + i for i, vertex in enumerate(mapper.belief.ids)}
    start = [k.map_base for k in keyframes] + [mapper.belief.map_vertex(v) for v in ids]
    constraints = [
        Constraint(i, i + 1, step.motion, _inverse(step.covariance))
        for i, step in enumerate(pipeline.steps[: len(keyframes) - 1])
    ]
    met = set[int]()
    for seen in mapper.observations:
        if seen.vertex in ids and seen.keyframe < len(keyframes):
            constraints.append(_sight(seen, ids[seen.vertex], again=seen.vertex in met))
            met.add(seen.vertex)
    graph = PoseGraph(constraints)
    x = graph.solve(np.array([(p.x, p.y, p.theta) for p in start]).reshape(-1, 3))
    poses = [Pose.from_array(row) for row in x]
    P = graph.covariances(x, list(ids.values()))[:, :2, :2]
    return Estimate(
        poses[: len(keyframes)],
        {vertex: poses[i] for vertex, i in ids.items()},
        dict(zip(ids, P, strict=True)),
    )


def _sight(seen: Observation, vertex: int, *, again: bool) -> Constraint:
    """A vertex as a keyframe saw it, without its heading where that was not measured.

    One that was recognised by its walls, heading and all, may have been laid onto the wrong ones.
    """
    information = np.zeros((3, 3))
    k = len(seen.R)
    information[:k, :k] = _inverse(seen.R)
    return Constraint(seen.keyframe, vertex, seen.base_vertex, information, again and k == 3)


def _inverse(covariance: Array) -> Array:
    return np.asarray(np.linalg.inv(covariance), np.float64)
