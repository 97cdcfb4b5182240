"""Maps seen from another frame."""

import math
from dataclasses import replace

import numpy as np

from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.maps.occupancy import UNKNOWN, Cells, OccupancyGrid
from gvgbot.maps.route_graph import RouteGraph, RouteNode
from gvgbot.maps.view import pair


def moved_graph(graph: RouteGraph, pose: Pose) -> RouteGraph:
    """The graph in the frame in which its own frame has this pose."""
    return RouteGraph(
        tuple(_moved_vertex(vertex, pose) for vertex in graph.vertices),
        tuple(replace(edge, polyline=pose.transform(edge.polyline)) for edge in graph.edges),
    )


def _moved_vertex(vertex: RouteNode, pose: Pose) -> RouteNode:
    (position,) = pose.transform(np.array([vertex.position]))
    covariance = np.array(vertex.covariance).reshape(2, 2)
    turn = pose.transform(np.eye(2)) - pose.position  # its transpose: rows are turned axes
    xx, xy, yx, yy = (turn.T @ covariance @ turn).ravel().tolist()
    return replace(
        vertex,
        position=pair(position),
        bearings=tuple(wrap_angle(bearing + pose.theta) for bearing in vertex.bearings),
        frontiers=tuple(wrap_angle(bearing + pose.theta) for bearing in vertex.frontiers),
        covariance=(xx, xy, yx, yy),
    )


def moved_grid(grid: OccupancyGrid, pose: Pose) -> OccupancyGrid:
    """The grid in the frame in which its own has this pose, in cells as large: the nearest ones."""
    if pose == Pose():
        return grid
    resolution, size = grid.resolution_m, np.array(grid.cells.shape[::-1])
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size * resolution + grid.origin
    moved = pose.transform(corners)
    origin = moved.min(axis=0)
    columns, rows = (math.ceil(side / resolution) for side in moved.max(axis=0) - origin)
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    centres = origin + resolution * np.column_stack([x.ravel(), y.ravel()])
    cells = _looked_up(grid, pose.inverse().transform(centres)).reshape(rows, columns)
    return OccupancyGrid(cells, resolution, pair(origin))


def _looked_up(grid: OccupancyGrid, points: Array) -> Cells:
    """What the grid says of points (N, 2) in its frame; outside of it nothing is known."""
    indices = np.floor((points - grid.origin) / grid.resolution_m).astype(np.int64)
    is_inside = ((indices >= 0) & (indices < grid.cells.shape[::-1])).all(axis=1)
    columns, rows = indices[is_inside].T
    found = np.full(len(points), UNKNOWN, np.int8)
    found[is_inside] = grid.cells[rows, columns]
    return found
