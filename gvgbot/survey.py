"""What a robot that has explored all may have missed, by the grid of all its scans."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gvgbot.autonomy.ending import Surveyed
from gvgbot.autonomy.estimate import scans_at, smoothed_keyframes
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.geometry import Array, Pose, anchored, sampled
from gvgbot.maps.blanks import blanks
from gvgbot.maps.gaps import gaps, is_wall
from gvgbot.maps.hits import Scans, barred, stood_s
from gvgbot.maps.hollows import bodies, hollows
from gvgbot.maps.in_sight import are_nearer_to
from gvgbot.maps.narrows import narrows
from gvgbot.maps.occupancy import OccupancyGrid, occupancy_grid
from gvgbot.maps.panes import past_panes
from gvgbot.maps.passages import Way, passages
from gvgbot.maps.spots import spots
from gvgbot.maps.viewpoints import floor_beside, viewpoints

_INTO_M = 2.0  # off its ways: through a door, and the robot faces what it looks at
_NEARER = 0.75  # of the clearance in the open: a coast is seen from so near
_TOWARDS_M = 1.0  # what seems to be a passage may be a pane of glass
_BODY_M = 0.45  # from the middle of somebody to where beams end on him
_HALF_M = 0.35  # of the widest body, all round
_STEP_M = 0.05  # between points of a way: a cell of the grid
_EVERY = 4  # of them, from which a robot looks
_WALL = 100  # percent
_NONE = np.empty((0, 2))


def survey(pipeline: Pipeline) -> Surveyed:
    """What is worth another look, and what is too narrow for the robot.

    From a place that is worth it the robot could drive onto floor that nobody has seen, or sees
    some that was seen but that no edge leads to, or where no edge leads through; or something stood
    there that may be a part of the building. Who drives by odometry alone blurs the grid too much.
    In a team, what others have seen is left to them.
    """
    ways = _ways(pipeline)
    if ways and not pipeline.matches_walls:
        return Surveyed(_NONE, _NONE)
    keyframes = smoothed_keyframes(pipeline)
    scans = scans_at(keyframes, pipeline)
    grid = _walled(occupancy_grid(scans), pipeline.sight.virtual_walls)
    here, room = pipeline.map_base.position, pipeline.errands.room_m
    open_m = pipeline.sight.open_clearance
    stood = spots(grid, *_passed(pipeline, keyframes), here, room)
    beside = sampled((way.polyline for way in ways), _STEP_M)
    others = sampled(_known_to_others(pipeline), _STEP_M)
    known = np.concatenate([beside, others])
    found = np.concatenate([gaps(grid, here, room), stood])
    narrow = narrows(grid, known, here, pipeline.radius, room)
    hollow = stood_at = awaited = _NONE
    if ways:
        joined = sampled((way.polyline for way in ways), _STEP_M / 2)
        felt_too = _walled(grid, _felt(pipeline))
        hollow = hollows(felt_too, joined, open_m)
        found = np.concatenate([found, blanks(grid, known, here, room)])
        stood_at = _may_go(bodies(grid, joined), scans, pipeline)
        awaited = np.concatenate([narrow, _may_go(_at_ends(pipeline), scans, pipeline)])
    through = passages(grid, ways, here, room, open_m)
    own = beside[::_EVERY], np.array([base.position for base in keyframes])
    found, through = (
        some[~are_nearer_to(others[::_EVERY], own, some, grid, open_m)] for some in (found, through)
    )
    found = np.concatenate([found, hollow])
    off = np.repeat([_INTO_M, _TOWARDS_M], [len(found), len(through)])
    places = np.concatenate([found, through])
    views = viewpoints(grid, beside, places, here, room, off, _NEARER * open_m)
    if views is None:
        is_walled = bool(is_wall(grid.cells).any())
        return Surveyed(found, narrow, is_beside_floor=len(found) > 0, is_walled=is_walled)
    return Surveyed(
        views,
        narrow,
        doorsteps=_doorsteps(grid, awaited, stood_at, beside, here, room),
        awaited=awaited,
        barred=_barred(pipeline, ways, scans, keyframes, grid),
        is_whole=not (len(places) or len(narrow) or len(pipeline.sight.virtual_walls)),
    )


def _doorsteps(
    grid: OccupancyGrid, awaited: Array, stood_at: Array, ways: Array, here: Array, room: float
) -> Array:
    """From where to look (M, 2) whether somebody has gone who stood in a way or in a ring.

    A ring goes round him: from there all is to be seen, and a column is better not driven up to.
    """
    by_somebody = np.concatenate([awaited, stood_at])
    if not len(by_somebody):
        return _NONE
    before = floor_beside(grid, by_somebody, here, room)
    off = np.repeat([_INTO_M, 0.0], [len(awaited), len(stood_at)])[: len(before)]
    views = viewpoints(grid, ways, before, here, room, off)
    return _NONE if views is None else views


def _known_to_others(pipeline: Pipeline) -> Sequence[Array]:
    """The lines (N, 2) that other robots of a team know as edges."""
    sharing = pipeline.mission.choice.sharing
    return () if sharing is None else sharing.known_to_others


def _walled(grid: OccupancyGrid, points: Array) -> OccupancyGrid:
    """The grid, not told when it was seen, with walls where points (N, 2), map frame, are."""
    cells = grid.cells.copy()
    column, row = np.floor((points - grid.origin) / grid.resolution_m).astype(np.int64).T
    inside = (row >= 0) & (row < cells.shape[0]) & (column >= 0) & (column < cells.shape[1])
    cells[row[inside], column[inside]] = _WALL
    return replace(grid, cells=cells, seen_s=None)


def _felt(pipeline: Pipeline) -> Array:
    """Where something was felt (N, 2), map frame, and virtual walls: the laser may not see it."""
    last = pipeline.past.last
    if last is None:
        return _NONE
    map_local = pipeline.mapper.map_in_local(last.local_base).inverse()
    return map_local.transform(pipeline.sight.hazards.points)


def _passed(pipeline: Pipeline, keyframes: list[Pose]) -> tuple[Array, Array]:
    """Where something stood that the robot has passed (N, 2), map frame, and the radii (N,), m."""
    places = [one.place(pipeline.past.keyframes, keyframes) for one in pipeline.traffic.passed]
    radii = [one.radius for one in pipeline.traffic.passed]
    return np.array(places).reshape(-1, 2), np.array(radii)


def _ways(pipeline: Pipeline) -> list[Way]:
    """All edges, map frame, from vertex to vertex: odometry has bent the lines of long ones."""
    place, ways = pipeline.mapper.belief.map_vertex, []
    for edge in pipeline.mapper.graph.edges.values():
        start, end = place(edge.a.vertex), place(edge.b.vertex)
        line = anchored(start.transform(edge.shown), start.position, end.position)
        ways.append(Way(edge.a.vertex, edge.b.vertex, line))
    return ways


def _at_ends(pipeline: Pipeline) -> Array:
    """Bodies (N, 2), map frame, that were let into the map and make the ends of edges."""
    graph, place = pipeline.mapper.graph, pipeline.mapper.belief.map_vertex
    ends = [
        (place(vertex.id).position, vertex.clearance + _BODY_M)
        for vertex in graph.vertices.values()
        if vertex.kind == "endpoint"
    ]
    found = [
        body
        for body in pipeline.traffic.lasting
        if any(math.dist(body, end) < reach for end, reach in ends)
    ]
    return np.array(found).reshape(-1, 2)


def _may_go(places: Array, scans: Scans, pipeline: Pipeline) -> Array:
    """Those bodies (M, 2) of some (N, 2) that have not stood for so long that they stay."""
    lasting_s = pipeline.traffic.newcomers.longest_patience
    return np.asarray(places[stood_s(scans, places, _HALF_M) < lasting_s])


def _barred(
    pipeline: Pipeline, ways: list[Way], scans: Scans, keyframes: list[Pose], grid: OccupancyGrid
) -> tuple[int, ...]:
    """The edges, by their ids, that nobody has driven, over floor that was a wall or past glass.

    `ways` are all edges.
    """
    lines = {
        edge.id: way.polyline
        for edge, way in zip(pipeline.mapper.graph.edges.values(), ways, strict=True)
        if not (edge.driven or edge.traversals or edge.established)
    }
    driven = np.array([base.position for base in keyframes])
    found = barred(scans, list(lines.values()), grid, driven)
    found |= past_panes(scans, list(lines.values()), grid)
    return tuple(key for key, is_barred in zip(lines, found, strict=True) if is_barred)
