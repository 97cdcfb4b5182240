"""The map so far, as the network gets it: brought up to date from keyframe to keyframe."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.pipeline import Keyframe, Pipeline
from gvgbot.live_grid import LiveGrid
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.report import route_graph
from gvgbot.topics import (
    TRAJECTORY_POSES,
    Map,
    MapEdge,
    MapVertex,
    Payload,
    Trajectory,
    packed,
)

_STEP_M = 0.1  # between poses of the trajectory, as long as there are few


class News(NamedTuple):
    """What to send, and what to answer who asks for the newest, if that is not the same."""

    value: Payload
    latest: Payload | None = None


class LiveMap:
    """Grid and trajectory grow with each keyframe; the graph is told anew each time."""

    def __init__(self, began: float) -> None:
        """`began`: the robot's clock now."""
        self._grid, self._trail = LiveGrid(began), Trail()
        self._taken = 0  # keyframes

    def update(self, pipeline: Pipeline, stamp: float) -> Callable[[], list[News]] | None:
        """A function that draws all of this moment, in a thread or later; None: no news.

        Call each such function before asking for the next.
        """
        new = pipeline.keyframes[self._taken :]
        if not new and not self._grid.has_more:
            return None
        self._taken += len(new)
        vertices = pipeline.mapper.graph.vertices
        belief = pipeline.mapper.belief
        poses = {number: belief.map_vertex(number) for number in vertices}
        covariances = {number: belief.vertex_covariance(number) for number in vertices}
        return partial(self._drawn, new, route_graph(pipeline, poses, covariances), stamp)

    def _drawn(self, new: Sequence[Keyframe], graph: RouteGraph, stamp: float) -> list[News]:
        news = [News(Map(stamp=stamp, vertices=_vertices(graph), edges=_edges(graph)))]
        self._grid.add(new)
        changed = self._grid.changes(stamp)
        if changed is not None:
            news.append(News(changed, self._grid.whole(stamp)))
        if self._trail.add(new):
            news.append(News(self._trail.told(stamp)))
        return news


class Trail:
    """The way driven: poses at least a step apart, which doubles whenever there are too many."""

    def __init__(self) -> None:
        self._step = _STEP_M
        self._stamps: list[float] = []
        self._poses: list[tuple[float, float, float]] = []

    def add(self, keyframes: Iterable[Keyframe]) -> bool:
        """Go on along keyframes; whether there is more than before."""
        has_grown = False
        for keyframe in keyframes:
            here = keyframe.map_base
            has_grown |= self._go(keyframe.stamp, (here.x, here.y, here.theta))
            while len(self._poses) > TRAJECTORY_POSES:
                self._thin()
        return has_grown

    def _go(self, stamp: float, pose: tuple[float, float, float]) -> bool:
        """Keep a pose, if it is far enough from the one before; whether it is."""
        if self._poses and math.dist(self._poses[-1][:2], pose[:2]) < self._step:
            return False
        self._stamps.append(stamp)
        self._poses.append(pose)
        return True

    def _thin(self) -> None:
        self._step *= 2.0
        before = zip(self._stamps, self._poses, strict=True)
        self._stamps, self._poses = [], []
        for stamp, pose in before:
            self._go(stamp, pose)

    def told(self, stamp: float) -> Trajectory:
        """As it travels."""
        return Trajectory(
            stamp=stamp,
            stamps=np.array(self._stamps, "<f8").tobytes(),
            poses=np.array(self._poses, "<f4").tobytes(),
        )


def _vertices(graph: RouteGraph) -> tuple[MapVertex, ...]:
    return tuple(
        MapVertex(
            id=vertex.id,
            kind=vertex.kind,
            position=vertex.position,
            covariance=vertex.covariance,
            clearance=vertex.clearance,
            frontiers=vertex.frontiers,
        )
        for vertex in graph.vertices
    )


def _edges(graph: RouteGraph) -> tuple[MapEdge, ...]:
    return tuple(
        MapEdge(start=edge.start, end=edge.end, length=edge.length, points=packed(edge.polyline))
        for edge in graph.edges
    )
