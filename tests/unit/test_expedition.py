"""What several robots leave together: the map, the grid of all, and how long it took."""

import numpy as np
import pytest

from gvgbot.expedition import joined_map, lasted
from gvgbot.geometry import Pose
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.session import Tally

CELL = 0.05  # m


def corridor(half_width: float) -> OccupancyGrid:
    """The walls along x, so far from y = 0, that one robot has seen."""
    cells = np.full((80, 120), UNKNOWN, np.int8)
    rows = round((2.0 + half_width) / CELL), round((2.0 - half_width) / CELL)
    cells[min(rows) : max(rows)] = 0
    cells[list(rows)] = 100
    return OccupancyGrid(cells, CELL, (-1.0, -2.0))


def street(claimed: float) -> RouteGraph:
    """An edge along the middle of it."""
    vertices = tuple(
        RouteNode(
            id=number,
            kind="endpoint",
            position=(x, 0.0),
            degree=1,
            bearings=(bearing,),
            clearance=claimed,
            covariance=(1e-4, 0.0, 0.0, 1e-4),
        )
        for number, x, bearing in ((1, 0.0, 0.0), (2, 4.0, np.pi))
    )
    line = np.array([(0.0, 0.0), (4.0, 0.0)])
    edge = RouteEdge(start=1, end=2, polyline=line, min_clearance=claimed)
    return RouteGraph(vertices, (edge,))


@pytest.mark.parametrize("first", [0, 1])
def test_no_edge_claims_more_room_than_the_grid_of_all_has_along_it(first: int) -> None:
    """The maps are bent against each other, so that a wall stands a little nearer in one."""
    maps = [(street(room), corridor(room), Pose()) for room in (0.8, 0.6)]
    graph, grid = joined_map([maps[first], maps[1 - first]], [])
    (edge,) = graph.edges
    walls = np.argwhere(grid.cells == 100) + 0.5
    nearest = float(np.abs(grid.origin[1] + CELL * walls[:, 0]).min())
    assert nearest == pytest.approx(0.6, abs=CELL)
    assert edge.min_clearance <= nearest + 1e-3


def counted(first_stamp: float | None, last_stamp: float) -> Tally:
    return Tally(
        first_stamp=first_stamp, last_stamp=last_stamp, contacts=0, closures=0, recoveries=0
    )


def test_a_robot_that_never_set_out_makes_no_expedition_longer() -> None:
    """In real time, stamps count from the start of the computer."""
    begun, late, never = (
        counted(85_000.0, 85_060.0),
        counted(85_010.0, 85_090.0),
        counted(None, 0.0),
    )
    assert lasted([begun, late]) == 90.0
    assert lasted([begun, late, never]) == 90.0
    assert lasted([never]) == 0.0
