"""In a hall too wide to see its middle, the graph keeps a fixed distance from the nearest wall."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.reduction import ReductionConfig, reduce_graph
from gvgbot.autonomy.gvg.voronoi import FineGraph, fine_graph
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import RADIUS, Rectangle, carved, looked

R = 2.0  # m from the walls
HALL: Rectangle = (-7.0, -5.0, 7.0, 5.0)
DOOR: Rectangle = (7.0, -0.5, 9.5, 0.5)
PILLAR: Rectangle = (-0.5, -0.5, 0.5, 0.5)
STAND = Pose(3.0, 1.0, 0.0)


def seen(*free: Rectangle, walls: tuple[Rectangle, ...] = ()) -> LocalMap:
    """What a laser with a view all round shows from some places in a hall."""
    path = [Pose(x, y, 0.0) for x, y in ((3.0, 1.0), (-4.0, 2.0), (-3.0, -3.0), (4.0, -3.0))]
    config = LocalMapConfig(half_width_m=14.0, cell_m=0.1)
    rng = np.random.default_rng(1)
    return looked(carved(free, walls), path, config=config, sigma=0.01, rng=rng)


def graph(local_map: LocalMap) -> FineGraph:
    return fine_graph(
        local_map,
        STAND.position,
        min_clearance=RADIUS,
        roughness=0.03,
        open_clearance=R,
    )


def length(fine: FineGraph) -> float:
    return float(
        np.hypot(*(fine.points[fine.ridges[:, 0]] - fine.points[fine.ridges[:, 1]]).T).sum()
    )


def test_no_point_is_farther_from_the_walls_than_the_coast() -> None:
    local_map = seen(HALL, DOOR, walls=(PILLAR,))
    fine = graph(local_map)
    distance, _ = cKDTree(local_map.points()).query(fine.points)
    assert distance == pytest.approx(fine.clearance, abs=1e-6)
    assert fine.clearance.max() <= R + 1e-9


def test_the_coast_of_a_hall_is_the_hall_made_smaller_on_all_sides() -> None:
    fine = graph(seen(HALL))
    coast = fine.points[fine.clearance > R - 1e-6]
    off = np.abs(np.abs(coast) - np.array([7.0 - R, 5.0 - R]))
    assert off.min(axis=1).max() < 0.05
    local = reduce_graph(fine, ReductionConfig())
    assert [node.degree for node in local.nodes.values()] == [2]  # a ring
    (ring,) = local.edges.values()
    assert ring.length == pytest.approx(2 * (14.0 + 10.0 - 4 * R), rel=0.02)


def test_a_door_joins_the_coast_in_one_meetpoint() -> None:
    local = reduce_graph(graph(seen(HALL, DOOR)), ReductionConfig())
    meetpoints = [node for node in local.nodes.values() if node.is_meetpoint]
    assert len(meetpoints) == 1
    # As far as R from both posts of the door, on the middle line between them.
    expected = (7.0 - math.sqrt(R**2 - 0.5**2), 0.0)
    assert meetpoints[0].position == pytest.approx(expected, abs=0.1)


def test_an_island_has_a_coast_of_its_own() -> None:
    """Around a pillar of 1 m whose walls are at least 4.5 m off: 1 m sides and quarter circles."""
    local_map = seen(HALL, walls=(PILLAR,))
    fine = fine_graph(
        local_map, np.array([1.5, 0.0]), min_clearance=RADIUS, roughness=0.03, open_clearance=1.0
    )
    assert length(fine) == pytest.approx(4 * 1.0 + 2 * math.pi * 1.0, rel=0.03)


def test_corridors_are_as_they_were() -> None:
    local_map = looked(
        carved([(-8.0, -1.0, 8.0, 1.0), (-1.0, 1.0, 1.0, 6.0)]),
        [Pose(x, 0.0) for x in (-3.0, 0.0, 3.0)],
    )
    with_limit, without = (
        fine_graph(local_map, np.zeros(2), min_clearance=RADIUS, roughness=0.03, open_clearance=c)
        for c in (6.0, np.inf)
    )
    assert np.array_equal(with_limit.points, without.points)
    assert np.array_equal(with_limit.ridges, without.ridges)


def test_a_coast_around_all_that_is_in_sight_has_no_dead_end() -> None:
    """Two pillars 2.6 m apart, and nothing else within the map: their coasts meet between them."""
    pillars: tuple[Rectangle, ...] = ((-1.7, -0.2, -1.3, 0.2), (1.3, -0.2, 1.7, 0.2))
    round_them = [Pose(x, y, 0.0) for x, y in ((3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0), (3.0, -3.0))]
    config = LocalMapConfig(half_width_m=8.0, cell_m=0.1)
    free = carved([(-20.0, -20.0, 20.0, 20.0)], pillars)
    local_map = looked(free, round_them, config=config)
    assert np.abs(local_map.points()).max() < 2.0
    local = reduce_graph(graph(local_map), ReductionConfig())
    assert not any(node.is_endpoint for node in local.nodes.values())
    found = sorted((n.position.tolist() for n in local.nodes.values() if n.is_meetpoint), key=str)
    off = 0.2 + math.sqrt(R**2 - 1.3**2)  # as far as R from the corners of both
    assert np.array(found) == pytest.approx(np.array([[0.0, -off], [0.0, off]]), abs=0.1)


def test_a_hall_15_m_wide_has_its_middle_and_no_coast_unless_asked_for() -> None:
    walls = carved([(-12.0, -7.5, 12.0, 7.5)])
    local_map = looked(walls, [Pose(x, 0.0) for x in (-1.0, 0.0, 1.0)])
    limit = ReductionConfig().open_clearance_m
    fine = fine_graph(
        local_map, np.zeros(2), min_clearance=RADIUS, roughness=0.03, open_clearance=limit
    )
    near = fine.points[np.abs(fine.points[:, 0]) < 1.0]
    assert len(near)
    assert np.abs(near[:, 1]).max() < 0.1
