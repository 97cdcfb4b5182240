"""The map so far, as the network gets it: brought up to date from keyframe to keyframe."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.geometry import Array, Pose, rows_of, stations_of
from gvgbot.live.grid import LiveGrid
from gvgbot.live.past import LivePast, Portion
from gvgbot.topics import (
    TRAJECTORY_POSES,
    Map,
    MapEdge,
    MapVertex,
    Payload,
    Trajectory,
    packed,
)

_POINT = 8  # bytes, as it travels
_STEP_M = 0.1  # between poses of the trajectory, as long as there are few


class Update(NamedTuple):
    """What to send, and what to answer who asks for the newest, if that is not the same."""

    value: Payload
    latest: Payload | None = None


class Stretch(NamedTuple):
    """An edge; its points (N, 2), m, are in the frame of the vertex where it starts."""

    start: int
    end: int
    points: Array


class LiveMap:
    """Grid and trajectory grow with each keyframe, and follow when a loop closes.

    The graph is told anew each time.
    """

    def __init__(self, began: float) -> None:
        """`began`: the robot's clock now."""
        self._grid, self._trail, self._past = LiveGrid(began), Trail(), LivePast()

    def doubt(self) -> None:
        """Note that grid and trajectory may be known better by now."""
        self._past.doubt()

    def update(self, pipeline: Pipeline, stamp: float) -> Callable[[], list[Update]] | None:
        """A function that draws all of this moment, in a thread or later; None: no news.

        Call each such function before asking for the next.
        """
        portion = self._past.update(pipeline, stamp)
        if portion is None and not self._grid.has_more:
            return None
        graph, belief = pipeline.mapper.graph, pipeline.mapper.belief
        poses = {number: belief.map_vertex(number) for number in graph.vertices}
        vertices = tuple(
            _vertex(vertex, poses[vertex.id], belief.vertex_covariance(vertex.id))
            for vertex in graph.vertices.values()
        )
        edges = [Stretch(edge.a.vertex, edge.b.vertex, edge.shown) for edge in graph.edges.values()]

        def graph_of_now() -> Map:
            lines, walls = bent(edges, poses), packed(pipeline.sight.virtual_walls)
            return Map(stamp=stamp, vertices=vertices, edges=lines, virtual_walls=walls)

        return partial(self._drawn, portion or _nothing, graph_of_now, stamp)

    def _drawn(
        self, find: Callable[[], Portion], graph_of_now: Callable[[], Map], stamp: float
    ) -> list[Update]:
        updates = [Update(graph_of_now())]
        new, is_all, breaks, lent = find()
        if is_all:
            self._grid.redraw(new)
            self._trail = Trail()
        else:
            self._grid.add(new)
        changed = self._grid.changes(stamp)
        if changed is not None:
            updates.append(Update(changed, self._grid.whole(stamp)))
        if self._trail.add(new, breaks, lent):
            updates.append(Update(self._trail.told(stamp)))
        return updates


def _nothing() -> Portion:
    return Portion((), is_all=False)


class Trail:
    """The way driven: poses at least a step apart, which doubles whenever there are too many."""

    def __init__(self) -> None:
        self._step = _STEP_M
        self._stamps: list[float] = []
        self._poses: list[tuple[float, float, float]] = []
        self._breaks: list[int] = []  # poses before which no way is known

    def add(
        self, keyframes: Sequence[Keyframe], breaks: Container[int] = (), first: int = 0
    ) -> bool:
        """Go on along keyframes from a first one on, but not to `breaks`; whether it has grown."""
        has_grown = False
        for number, keyframe in enumerate(keyframes[first:], first):
            here = keyframe.map_base
            pose = here.x, here.y, here.theta
            has_grown |= self._go(keyframe.stamp, pose, is_break=number in breaks)
            while len(self._poses) > TRAJECTORY_POSES:
                self._thin()
        return has_grown

    def _go(self, stamp: float, pose: tuple[float, float, float], *, is_break: bool) -> bool:
        """Keep a pose, if it is far enough from the one before, or a break is; whether it is."""
        is_near = bool(self._poses) and math.dist(self._poses[-1][:2], pose[:2]) < self._step
        if is_near and not is_break:
            return False
        if is_break and self._poses:
            self._breaks.append(len(self._poses))
        self._stamps.append(stamp)
        self._poses.append(pose)
        return True

    def _thin(self) -> None:
        self._step *= 2.0
        before, breaks = zip(self._stamps, self._poses, strict=True), set(self._breaks)
        self._stamps, self._poses, self._breaks = [], [], []
        for number, (stamp, pose) in enumerate(before):
            self._go(stamp, pose, is_break=number in breaks)

    def told(self, stamp: float) -> Trajectory:
        """As it travels."""
        return Trajectory(
            stamp=stamp,
            stamps=np.array(self._stamps, "<f8").tobytes(),
            poses=np.array(self._poses, "<f4").tobytes(),
            breaks=tuple(self._breaks),
        )


def _vertex(vertex: Vertex, pose: Pose, covariance: Array) -> MapVertex:
    (xx, xy), (yx, yy) = covariance.tolist()
    return MapVertex(
        id=vertex.id,
        kind=vertex.kind,
        position=(pose.x, pose.y),
        covariance=(xx, xy, yx, yy),
        clearance=vertex.clearance,
        frontiers=vertex.bearings(pose.theta, open_only=True),
    )


def bent(edges: Sequence[Stretch], poses: Mapping[int, Pose]) -> tuple[MapEdge, ...]:
    """Edges as they travel, each bent so that it ends on its vertices; `poses` are map_vertex.

    All at once, since one by one takes ten times as long.
    """
    if not edges:
        return ()
    counts = np.array([len(edge.points) for edge in edges])
    last = np.cumsum(counts) - 1
    first, which = last + 1 - counts, np.repeat(np.arange(len(edges)), counts)
    starts = rows_of(poses[edge.start] for edge in edges)
    ends = rows_of(poses[edge.end] for edge in edges)
    turned = np.concatenate([edge.points for edge in edges])
    x, y, theta = starts[which].T
    c, s = np.cos(theta), np.sin(theta)
    line = np.column_stack(
        [x + c * turned[:, 0] - s * turned[:, 1], y + s * turned[:, 0] + c * turned[:, 1]]
    )
    along = stations_of(line)
    seen = np.maximum(along[last] - along[first], 1e-9)
    share = ((along - along[first][which]) / seen[which])[:, None]
    at_start, at_end = starts[:, :2] - line[first], ends[:, :2] - line[last]
    line += (1.0 - share) * at_start[which] + share * at_end[which]
    along = stations_of(line)
    lengths, data = along[last] - along[first], packed(line)
    return tuple(
        MapEdge(
            start=edge.start,
            end=edge.end,
            length=length,
            points=data[_POINT * begin : _POINT * (end + 1)],
        )
        for edge, length, begin, end in zip(
            edges, lengths.tolist(), first.tolist(), last.tolist(), strict=True
        )
    )
