"""Passages of a grid: ways over the floor that spare a long way round on the edges of the graph."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from gvgbot.geometry import Array, resampled
from gvgbot.maps.distances import metres_to
from gvgbot.maps.gaps import Mask, is_floor, is_wall, reachable
from gvgbot.maps.occupancy import OccupancyGrid

_CELL_M = 0.1  # a wall, with the room that the robot keeps from it, is wider
_STEP_M = 0.25  # between points of an edge
_ASIDE_M = 4.0  # a passage is looked for so far from the edges
_SPARED_M, _SPARED = 6.0, 3.0  # more, and that many times its length, is a long way round
_NOT_OPEN = 0.9  # of the clearance in the open: halls that are a little wider are left out
_APART_M = 1.0  # nearer to each other they are one
_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))

Indices = NDArray[np.intp]
Numbers = NDArray[np.int32]


class Way(NamedTuple):
    """An edge of the graph: the vertices at its ends, and its polyline (N, 2), m, map frame."""

    start: int
    end: int
    polyline: Array


def passages(
    grid: OccupancyGrid, ways: list[Way], around: Array, passage_m: float, open_m: float
) -> Array:
    """Places (N, 2), m, map frame, halfway between edges that the floor joins, but no edge.

    The GVG is a retract of the floor: what is near over the floor is near along its edges. The
    robot is at `around` (2,) and keeps `passage_m` from walls; farther than `open_m` from them
    there are no edges.
    """
    if not ways:
        return np.empty((0, 2))
    cell, corner = grid.resolution_m, np.array(grid.origin)
    clearance = metres_to(is_wall(grid.cells), cell)
    has_room = (clearance > passage_m) & (clearance < _NOT_OPEN * open_m)
    floor = reachable(is_floor(grid.cells) & has_room, (around - corner)[::-1] / cell)
    coarse = max(1, round(_CELL_M / cell))
    floor, cell = floor[::coarse, ::coarse].copy(), cell * coarse
    del clearance, has_room  # a large grid's take much memory
    points, along = _network(ways)
    meeting = _meeting(floor, (points - corner) / cell, _ASIDE_M / cell)
    meeting = meeting._replace(length=meeting.length * cell)
    is_long = _is_long_way_round(along, meeting)
    shortest = np.flatnonzero(is_long)[np.argsort(meeting.length[is_long], kind="stable")]
    found: list[Array] = []
    for row, column in meeting.places[shortest]:
        place = corner + (coarse * np.array([column, row]) + 0.5) * grid.resolution_m
        if all(math.dist(place, one) > _APART_M for one in found):
            found.append(place)
    return np.array(found).reshape(-1, 2)


class _Meeting(NamedTuple):
    """Where the floor nearest to one point of the edges borders on that nearest to another one.

    The points by their numbers, how far they are from each other over the floor, and the places
    (N, 2) by row and column.
    """

    here: Indices
    there: Indices
    length: Array
    places: Indices


def _network(ways: list[Way]) -> tuple[Array, csr_array]:
    """Points (N, 2) along all edges, which meet in their vertices, and what joins them, m."""
    number = {vertex: n for n, vertex in enumerate({v for way in ways for v in way[:2]})}
    points, links, count = [np.zeros((len(number), 2))], [], len(number)
    for start, end, polyline in ways:
        line = resampled(polyline, _STEP_M)
        points[0][number[start]], points[0][number[end]] = line[0], line[-1]
        inner = count + np.arange(len(line) - 2)
        chain = np.concatenate([[number[start]], inner, [number[end]]])
        step = np.hypot(*np.diff(line, axis=0).T)
        links.append(np.stack([chain[:-1], chain[1:], step]))
        points.append(line[1:-1])
        count += len(inner)
    a, b, step = np.concatenate(links, axis=1)
    joined = coo_array((step, (a.astype(np.intp), b.astype(np.intp))), (count, count))
    return np.concatenate(points), csr_array(joined)


def _meeting(floor: Mask, points: Array, farthest: float) -> _Meeting:
    """Where ways over the floor from points (N, 2), by column and row, meet; all in cells."""
    places = np.argwhere(floor)
    number = np.full(floor.shape, -1, np.int32)
    number[floor] = np.arange(len(places))
    rows, columns = np.floor(points).astype(np.intp).T[::-1]
    inside = (rows >= 0) & (columns >= 0) & (rows < floor.shape[0]) & (columns < floor.shape[1])
    at = np.full(len(points), -1)
    at[inside] = number[rows[inside], columns[inside]]
    sources, first = np.unique(at, return_index=True)
    sources, first = sources[sources >= 0], first[sources >= 0]
    a, b, step = _neighbours(number)
    links = coo_array((step, (a, b)), (len(places), len(places))).tocsr()
    away, _, source = dijkstra(
        links,
        directed=False,
        indices=sources,
        min_only=True,
        return_predecessors=True,
        limit=farthest,
    )
    nearest = np.full(len(places) + 1, -1)  # the last one for what no source reaches
    nearest[sources] = first
    nearest = nearest[np.where(source >= 0, source, -1)]
    meets = (nearest[a] >= 0) & (nearest[b] >= 0) & (nearest[a] != nearest[b])
    a, b, step = a[meets], b[meets], step[meets]
    return _Meeting(nearest[a], nearest[b], away[a] + step + away[b], places[a])


def _neighbours(number: Numbers) -> tuple[Numbers, Numbers, Array]:
    """Pairs of cells of the floor that touch, by their numbers (-1 is no floor); how far apart."""
    height, width = number.shape
    pairs = []
    for down, right in _NEIGHBOURS:
        a = number[: height - down, max(0, -right) : width - max(0, right)]
        b = number[down:, max(0, right) : width + min(0, right)]
        both = (a >= 0) & (b >= 0)
        pairs.append((a[both], b[both], np.full(np.count_nonzero(both), math.hypot(down, right))))
    a, b, step = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return a, b, step


def _is_long_way_round(along: csr_array, meeting: _Meeting) -> Mask:
    """Whether the way along the edges is far longer than that over the floor, for each place."""
    enough = np.maximum(meeting.length + _SPARED_M, meeting.length * _SPARED)
    is_long = np.zeros(len(enough), np.bool_)
    for start in np.unique(meeting.here):
        own = meeting.here == start
        metres = dijkstra(along, directed=False, indices=start, limit=enough[own].max())
        is_long[own] = metres[meeting.there[own]] > enough[own]
    return is_long
