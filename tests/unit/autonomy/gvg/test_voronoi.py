"""The fine graph obeys the definition of the Voronoi diagram, whatever the walls are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import RADIUS, Rectangle, carved, fine, looked

seeds = st.integers(0, 2**32 - 1)


def cluttered(seed: int) -> World:
    """A room with up to eight boxes, none of which stands at the origin."""
    rng = np.random.default_rng(seed)
    boxes: list[Rectangle] = []
    for _ in range(int(rng.integers(0, 9))):
        x, y = rng.uniform(-4.5, 3.5, 2)
        w, h = rng.uniform(0.1, 1.5, 2)
        if not (x - 0.5 < 0.0 < x + w + 0.5 and y - 0.5 < 0.0 < y + h + 0.5):
            boxes.append((float(x), float(y), float(x + w), float(y + h)))
    return carved([(-4.0, -3.0, 4.0, 5.0)], boxes)


def glance(seed: int) -> LocalMap:
    """What one noisy scan with a blind rear shows of the cluttered room of the same seed."""
    rng = np.random.default_rng(seed)
    pose = Pose(0.0, 0.0, float(rng.uniform(-3, 3)))
    return looked(cluttered(seed), [pose], sigma=0.01, rng=rng, field_of_view=4.7)


@settings(max_examples=15)
@given(seeds)
def test_every_point_is_as_far_from_three_walls_as_its_clearance_and_from_none_nearer(
    seed: int,
) -> None:
    local_map = glance(seed)
    graph = fine(local_map, (0.0, 0.0))
    if not len(graph.points):
        return
    distances = np.asarray(cKDTree(local_map.points()).query(graph.points, k=3)[0])
    assert distances == pytest.approx(np.repeat(graph.clearance[:, None], 3, axis=1), abs=1e-6)
    assert graph.clearance.min() >= RADIUS


@settings(max_examples=15)
@given(seeds)
def test_the_middle_of_a_ridge_is_not_nearer_to_a_third_wall_than_to_its_two(seed: int) -> None:
    local_map = glance(seed)
    graph = fine(local_map, (0.0, 0.0))
    middles = graph.points[graph.ridges].mean(axis=1).reshape(-1, 2)
    if len(middles):
        distances = np.asarray(cKDTree(local_map.points()).query(middles, k=2)[0])
        assert distances[:, 0] == pytest.approx(distances[:, 1], abs=1e-6)


@settings(max_examples=15)
@given(seeds)
def test_the_graph_is_in_one_piece(seed: int) -> None:
    graph = fine(glance(seed), (0.0, 0.0))
    n = len(graph.points)
    if n:
        assert graph.ridges.max() < n
        i, j = graph.ridges.T
        links = coo_array((np.ones(len(i)), (i, j)), (n, n))
        assert connected_components(links, directed=False)[0] == 1


@settings(max_examples=30)
@given(seeds)
def test_no_wall_out_of_sight_is_much_nearer_than_the_clearance_says(seed: int) -> None:
    """Discs are only believed where they are seen, but for a rim of two cells of a decimetre."""
    local_map = glance(seed)
    world = cluttered(seed)
    graph = fine(local_map, (0.0, 0.0))
    for (x, y), clearance in zip(graph.points, graph.clearance, strict=True):
        truth = float(np.hypot(*world.wall_offsets(x, y, 9.0).T).min())
        assert -0.04 < clearance - truth < 0.3


def test_nothing_in_sight_is_no_graph() -> None:
    nothing = LocalMap(LocalMapConfig())
    nothing.insert(Scan(0.0, np.full(100, np.inf), -1.0, 0.02, 0.1, 10.0), Pose(), 0.0)
    assert not len(fine(nothing, (0.0, 0.0)).points)


def test_one_straight_wall_is_no_graph() -> None:
    world = carved([(-9.0, -9.0, 9.0, 9.0)])
    graph = fine(looked(world, [Pose(0.0, 7.0, 1.57)], field_of_view=1.0), (0.0, 7.0))
    assert not len(graph.ridges)
