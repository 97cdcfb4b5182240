"""What a run leaves: the map, its picture, the trajectories and the summary, as files by name."""

import copy
import math
import tempfile
from array import array
from bisect import bisect_left
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.estimate import scans_at, smoothed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.graph import Edge, Vertex
from gvgbot.drivers.world import World, save_world
from gvgbot.geometry import (
    Array,
    Pose,
    Poses,
    anchored,
    composed,
    resampled,
    rows_of,
    seen_from,
    without_spikes,
)
from gvgbot.hal.messages import Odometry
from gvgbot.maps import geojson
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import is_floor, is_wall
from gvgbot.maps.map_server import encode_map_server
from gvgbot.maps.occupancy import OccupancyGrid, occupancy_grid
from gvgbot.maps.picture import draw_map
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.maps.run_directory import ESTIMATE, MAP, ODOMETRY, ONLINE, PICTURE, TRUTH
from gvgbot.maps.trajectory import Trajectory, encode_tum

_TICK_S = 1e-6  # from one row to the next; files tell no less
_SAME_ROOM_M = 0.1  # a grid does not tell a clearance better


@dataclass(slots=True)
class Journey:
    """The way of the robot, a row each `period` s, or for each stamp of odometry if that is 0."""

    period: float = 0.1
    stamps: "array[float]" = field(default_factory=lambda: array("d"))
    keyframes: "array[int]" = field(default_factory=lambda: array("q"))  # the last before each row
    odom_base: Poses = field(default_factory=Poses)
    map_base: Poses = field(default_factory=Poses)
    world_base: Poses = field(default_factory=Poses)  # simulation only; none unless of each row

    @property
    def began(self) -> float | None:
        """The stamp of the first row, if there is one."""
        return self.stamps[0] if self.stamps else None

    def record(self, odometry: Odometry, pipeline: Pipeline, world_base: Pose | None) -> None:
        """Take down a control cycle, if a row is due."""
        if not pipeline.past.keyframes or (
            self.stamps and odometry.stamp < self.stamps[-1] + max(self.period - 1e-3, _TICK_S)
        ):
            return
        self.stamps.append(odometry.stamp)
        self.keyframes.append(len(pipeline.past.keyframes) - 1)
        self.odom_base.append(odometry.odom_base)
        self.map_base.append(pipeline.map_base)
        if world_base is not None and len(self.world_base) == len(self.stamps) - 1:
            self.world_base.append(world_base)
        else:  # the robot was simulated in another life, or is now
            self.world_base.cut(0)

    def forget(self, keyframe: int) -> None:
        """Leave out the rows from a keyframe on."""
        first = bisect_left(self.keyframes, keyframe)
        del self.stamps[first:], self.keyframes[first:]
        for poses in (self.odom_base, self.map_base, self.world_base):
            poses.cut(first)

    def still(self) -> Self:
        """A copy that does not grow."""
        return copy.deepcopy(self)


def map_files(pipeline: Pipeline, journey: Journey, title: str) -> dict[str, bytes | str]:
    """All files of a run but summary and events, by name."""
    keyframes, vertices, covariances = smoothed(pipeline)
    grid = occupancy_grid(scans_at(keyframes, pipeline), began=journey.began)
    edges = enumerate(pipeline.mapper.graph.edges.values())
    parts = {i for i, edge in edges if edge.is_part}
    graph = with_room_of(route_graph(pipeline, vertices, covariances), grid, parts)
    estimate = _trajectory(journey, _corrected(journey, pipeline, keyframes))
    odometry = _trajectory(journey, _by_odometry(journey, pipeline))
    files: dict[str, bytes | str] = {
        MAP: geojson.encode(graph),
        PICTURE: draw_map(
            graph,
            grid=grid,
            estimate=estimate,
            odometry=odometry,
            virtual_walls=pipeline.sight.virtual_walls,
            title=title,
        ),
        ESTIMATE: encode_tum(estimate),
        ONLINE: encode_tum(_trajectory(journey, journey.map_base.rows())),
        ODOMETRY: encode_tum(odometry),
    }
    if journey.world_base:
        files[TRUTH] = encode_tum(_trajectory(journey, journey.world_base.rows()))
    return files | encode_map_server(grid)


def _trajectory(journey: Journey, poses: Array) -> Trajectory:
    return Trajectory(np.array(journey.stamps, np.float64), poses)


def _by_odometry(journey: Journey, pipeline: Pipeline) -> Array:
    """The journey by odometry alone (N, 3), from where its own first keyframe was taken on."""
    own = pipeline.past.keyframes[pipeline.past.lent :]
    start, map_start = (own[0].odom_base, own[0].map_base) if own else (Pose(), Pose())
    return composed(rows_of([map_start]), seen_from(rows_of([start]), journey.odom_base.rows()))


def _corrected(journey: Journey, pipeline: Pipeline, keyframes: list[Pose]) -> Array:
    """The journey hung on the smoothed keyframes: map_base of each row (N, 3).

    What odometry is wrong by from one keyframe to the next is spread over the time between.
    """
    taken, last = pipeline.past.keyframes, len(pipeline.past.keyframes) - 1
    stamps, odom_base = np.array(journey.stamps), journey.odom_base.rows()
    taken_at, felt = np.array([k.stamp for k in taken]), rows_of([k.odom_base for k in taken])
    before = np.array(journey.keyframes, np.intp)
    later = np.minimum(before + 1, last)
    before = np.where(taken_at[later] <= stamps, later, before)  # it was learnt from too late
    after, smoothed_base = np.minimum(before + 1, last), rows_of(keyframes)
    by_last, by_next = (
        composed(smoothed_base[k], seen_from(felt[k], odom_base)) for k in (before, after)
    )
    time_between = np.maximum(taken_at[after] - taken_at[before], 1e-9)
    share = np.clip((stamps - taken_at[before]) / time_between, 0.0, 1.0)
    return composed(by_last, share[:, None] * seen_from(by_last, by_next))


def route_graph(
    pipeline: Pipeline, vertices: dict[int, Pose], covariances: dict[int, Array]
) -> RouteGraph:
    """The GVG graph with vertices at the given poses (map_vertex), covariances (2, 2) in m^2."""
    mapper = pipeline.mapper
    return RouteGraph(
        tuple(
            _route_node(vertex, vertices[vertex.id], covariances[vertex.id])
            for vertex in mapper.graph.vertices.values()
        ),
        tuple(_route_edge(edge, vertices) for edge in mapper.graph.edges.values()),
    )


def _route_node(vertex: Vertex, pose: Pose, covariance: Array) -> RouteNode:
    (xx, xy), (yx, yy) = covariance.tolist()
    return RouteNode(
        id=vertex.id,
        kind=vertex.kind,
        position=(pose.x, pose.y),
        degree=vertex.degree,
        bearings=vertex.bearings(pose.theta),
        clearance=vertex.clearance,
        covariance=(xx, xy, yx, yy),
        frontiers=vertex.bearings(pose.theta, open_only=True),
        visits=vertex.visits,
    )


def _route_edge(edge: Edge, vertices: dict[int, Pose]) -> RouteEdge:
    """An edge whose polyline is bent so that it ends on its vertices."""
    line = vertices[edge.a.vertex].transform(edge.shown)
    start, end = (vertices[half.vertex].position for half in (edge.a, edge.b))
    return RouteEdge(
        start=edge.a.vertex,
        end=edge.b.vertex,
        polyline=without_spikes(anchored(line, start, end)),
        min_clearance=edge.min_clearance,
        traversals=edge.traversals,
    )


def with_room_of(graph: RouteGraph, grid: OccupancyGrid, parts: Collection[int] = ()) -> RouteGraph:
    """The same graph, of which nothing claims more room than there is in the grid.

    An edge that was in sight from end to end may have been seen before all that stands beside it,
    and a vertex while columns were left out for what may be people; its own clearance, which is
    the mean of many looks, counts if the grid tells about the same.
    `parts` are the places, among the edges, of those whose narrowest place may be in another part
    of an edge that was parted: they claim the room in which the grid knows the floor to be free.
    """
    tree = cKDTree(grid.middles(is_wall(grid.cells)))

    def measured(number: int, edge: RouteEdge) -> RouteEdge:
        line, claimed = resampled(edge.polyline, grid.resolution_m), edge.min_clearance
        room = float(np.asarray(tree.query(line)[0]).min())
        if number in parts and tree.n:
            claimed = max(claimed, _known_room(grid, line, room))
        return replace(edge, min_clearance=min(claimed, room))

    def seen(node: RouteNode) -> RouteNode:
        room = float(np.asarray(tree.query(node.position)[0]))
        return node if node.clearance < room + _SAME_ROOM_M else replace(node, clearance=room)

    edges = tuple(measured(i, edge) for i, edge in enumerate(graph.edges))
    return replace(graph, vertices=tuple(map(seen, graph.vertices)), edges=edges)


def _known_room(grid: OccupancyGrid, line: Array, most: float) -> float:
    """How far all along a line (N, 2), m, map frame, the floor is known to be free, to `most` m."""
    margin = math.ceil(most / grid.resolution_m) + 1
    cells = ((line - grid.origin) // grid.resolution_m).astype(np.intp)[:, ::-1]
    first = np.maximum(cells.min(axis=0) - margin, 0)
    (top, left), (bottom, right) = first, np.maximum(cells.max(axis=0) + margin + 1, 0)
    floor = np.pad(is_floor(grid.cells[top:bottom, left:right]), 1)  # beyond, nothing is known
    free = metres_to(~floor, grid.resolution_m)
    row, column = np.clip(cells - first + 1, 0, np.array(floor.shape) - 1).T
    return float(free[row, column].min())


def world_files(world: World) -> dict[str, bytes | str]:
    """The simulated world itself in map_server form, to score a run against."""
    with tempfile.TemporaryDirectory() as directory:
        save_world(replace(world, name="world"), Path(directory))
        return {f"{path.name}": path.read_bytes() for path in sorted(Path(directory).iterdir())}
