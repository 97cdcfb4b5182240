"""The map so far, as the network gets it: brought up to date from keyframe to keyframe."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from gvgbot.autonomy.pipeline import Keyframe, Pipeline
from gvgbot.maps.occupancy import GrowingGrid
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.report import route_graph
from gvgbot.topics import Map, MapEdge, MapVertex, packed

_RESOLUTION_M, _REACH_M = 0.15, 8.0  # coarser and shorter than the saved grid: cheap to send


class LiveMap:
    """The grid and the trail grow with each keyframe; the graph is told anew each time."""

    def __init__(self) -> None:
        self._grid = GrowingGrid(_RESOLUTION_M, _REACH_M)
        self._trail: list[tuple[float, float]] = []
        self._taken = 0  # keyframes

    def update(self, pipeline: Pipeline, stamp: float) -> Callable[[], Map] | None:
        """A function that draws the map of this moment, in a thread or later; None: no news.

        Call each such function before asking for the next.
        """
        new = pipeline.keyframes[self._taken :]
        if not new:
            return None
        self._taken += len(new)
        vertices = pipeline.mapper.graph.vertices
        belief = pipeline.mapper.belief
        poses = {number: belief.map_vertex(number) for number in vertices}
        covariances = {number: belief.vertex_covariance(number) for number in vertices}
        return partial(self._drawn, new, route_graph(pipeline, poses, covariances), stamp)

    def _drawn(self, new: Sequence[Keyframe], graph: RouteGraph, stamp: float) -> Map:
        for keyframe in new:
            if keyframe.scan is not None:
                self._grid.add(keyframe.map_base, keyframe.scan)
                self._trail.append((keyframe.map_base.x, keyframe.map_base.y))
        grid = self._grid.grid()
        rows, columns = grid.cells.shape
        return Map(
            stamp=stamp,
            resolution=grid.resolution_m,
            origin=grid.origin,
            columns=columns,
            rows=rows,
            cells=grid.cells.tobytes(),
            vertices=_vertices(graph),
            edges=_edges(graph),
            trail=packed(np.array(self._trail)),
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
