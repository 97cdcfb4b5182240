"""The best estimate of the whole run: all keyframes and vertices, corrected by later closures."""

import copy
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.revisits import Traverse, revisits
from gvgbot.autonomy.slam.sampling import sampled
from gvgbot.autonomy.slam.smoothing import Constraint, PoseGraph
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Array, Pose, rows_of
from gvgbot.hal.packed_scan import PackedScan


class Estimate(NamedTuple):
    """Keyframes (map_base), and by id vertices (map_vertex) and their covariances (2, 2) in m^2."""

    keyframes: list[Pose]
    vertices: dict[int, Pose]
    covariances: dict[int, Array]


def smoothed(pipeline: Pipeline) -> Estimate:
    """The best estimate of all keyframes and vertices.

    Loops are closed by vertices, and by walls wherever they were passed twice. Where somebody else
    drove, nobody came close to vertices to know them again for certain: they stand where the first
    visit saw them.
    """
    keyframes, graph, x = _solved(pipeline)
    vertices = range(len(keyframes), len(x))
    P = graph.covariances(x, list(vertices))[:, :2, :2]
    ids = pipeline.mapper.belief.ids
    places = [Pose.from_array(row) for row in x[len(keyframes) :]]
    return Estimate(keyframes, dict(zip(ids, places, strict=True)), dict(zip(ids, P, strict=True)))


def smoothed_keyframes(pipeline: Pipeline) -> list[Pose]:
    """The keyframes (map_base) of the best estimate, in a fraction of the time that all takes."""
    return _solved(pipeline)[0]


def still_past(pipeline: Pipeline) -> Pipeline:
    """A copy, for these estimates, whose past does not grow as the pipeline goes on."""
    copied = copy.copy(pipeline)
    copied.past = pipeline.past.still()
    copied.mapper = copy.copy(pipeline.mapper)
    copied.mapper.observations = pipeline.mapper.observations.copy()
    return copied


def still(pipeline: Pipeline) -> Pipeline:
    """A copy, for reports, that does not change as the pipeline goes on.

    What is only ever appended to is copied as a list.
    """
    copied = still_past(pipeline)
    copied.mapper.graph = pipeline.mapper.graph.copied()
    return copied


def scans_at(keyframes: list[Pose], pipeline: Pipeline) -> list[tuple[Pose, PackedScan]]:
    """The scans that were kept, each with where its keyframe is estimated to be (map_base)."""
    return [
        (pose, keyframe.scan)
        for pose, keyframe in zip(keyframes, pipeline.past.keyframes, strict=True)
        if keyframe.scan is not None
    ]


def _solved(pipeline: Pipeline) -> tuple[list[Pose], PoseGraph, Array]:
    """The best keyframes; what they were found from, and all poses (N, 3), vertices last."""
    keyframes, belief = pipeline.past.keyframes, pipeline.mapper.belief
    start = [k.map_base for k in keyframes] + [belief.map_vertex(v) for v in belief.ids]
    graph = PoseGraph(_constraints(pipeline))
    x = graph.solve(rows_of(start))
    return [Pose.from_array(row) for row in x[: len(keyframes)]], graph, x


def _constraints(pipeline: Pipeline) -> list[Constraint]:
    """Between keyframes, by their number, and vertices, which follow in the belief's order."""
    keyframes, mapper = pipeline.past.keyframes, pipeline.mapper
    ids = {vertex: len(keyframes) + i for i, vertex in enumerate(mapper.belief.ids)}
    constraints = [
        Constraint(i, i + 1, step.motion, _inverse(step.covariance))
        for i, step in enumerate(pipeline.past.steps[: len(keyframes) - 1])
    ]
    if pipeline.matches_walls:
        constraints += revisits(_traverse(pipeline), pipeline.matching)
    met, recognised, headed = set[int](), set[int](), set[int]()
    for seen in mapper.observations:
        if seen.vertex not in ids or seen.keyframe >= len(keyframes):
            continue
        sight = _sight(seen, ids[seen.vertex], again=seen.vertex in met)
        met.add(seen.vertex)
        if len(seen.R) == 3:
            headed.add(seen.vertex)
        if sight.doubtful:
            recognised.add(seen.vertex)
        if not (pipeline.led and seen.vertex in recognised):
            constraints.append(sight)
    last = len(keyframes) - 1
    return constraints + [
        _believed(mapper.belief, vertex, last, number, is_met=vertex in met)
        for vertex, number in ids.items()
        if vertex not in headed
    ]


def _traverse(pipeline: Pipeline) -> Traverse:
    scans = {i: k.scan for i, k in enumerate(pipeline.past.keyframes) if k.scan is not None}
    walls = {i: sampled(scan.unpacked(), pipeline.matching.points) for i, scan in scans.items()}
    return Traverse([(step.motion, step.covariance) for step in pipeline.past.steps], walls)


def _believed(belief: Belief, vertex: int, last: int, number: int, *, is_met: bool) -> Constraint:
    """A vertex as it is believed to stand: nobody has kept how its heading was seen.

    Where it stands is told by its sights, if it is met; the belief has made use of these already.
    """
    _, S, _ = ekf.innovation(belief, vertex, Pose(), 1e-6 * np.eye(3))
    information = np.diag([0.0, 0.0, 1.0 / S[2, 2]]) if is_met else _inverse(S)
    return Constraint(last, number, ekf.expected(belief, vertex)[0], information)


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
