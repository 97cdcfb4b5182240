"""The fine graph obeys the definition of the Voronoi diagram, whatever the walls are."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.voronoi import _pieces, fine_graph
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.local_graphs import Point, resampled
from tests.unit.autonomy.sights import RADIUS, Rectangle, carved, fine, looked, sweep

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
def test_points_are_as_far_from_two_walls_as_their_clearance_forks_from_three_and_none_nearer(
    seed: int,
) -> None:
    local_map = glance(seed)
    graph = fine(local_map, (0.0, 0.0))
    assume(len(graph.points))
    distances = np.asarray(cKDTree(local_map.points()).query(graph.points, k=3)[0])
    clearance = np.repeat(graph.clearance[:, None], 3, axis=1)
    assert distances[:, :2] == pytest.approx(clearance[:, :2], abs=1e-6)
    forks = np.bincount(graph.ridges.ravel(), minlength=len(graph.points)) > 2
    assert distances[forks] == pytest.approx(clearance[forks], abs=1e-6)
    assert graph.clearance.min() >= RADIUS


@settings(max_examples=15)
@given(seeds)
def test_the_middle_of_a_ridge_is_not_nearer_to_a_third_wall_than_to_its_two(seed: int) -> None:
    local_map = glance(seed)
    graph = fine(local_map, (0.0, 0.0))
    middles = graph.points[graph.ridges].mean(axis=1).reshape(-1, 2)
    assume(len(middles))
    distances = np.asarray(cKDTree(local_map.points()).query(middles, k=2)[0])
    assert distances[:, 0] == pytest.approx(distances[:, 1], abs=1e-6)


@settings(max_examples=15)
@given(seeds)
def test_the_graph_is_in_one_piece(seed: int) -> None:
    graph = fine(glance(seed), (0.0, 0.0))
    n = len(graph.points)
    assume(n)
    assert graph.ridges.max() < n
    i, j = graph.ridges.T
    links = coo_array((np.ones(len(i)), (i, j)), (n, n))
    assert connected_components(links, directed=False)[0] == 1


@given(seeds)
def test_points_are_of_one_piece_where_links_lead_from_one_to_the_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 60))
    i, j = rng.integers(count, size=(2, int(rng.integers(0, 80))))
    piece = _pieces(i, j, count)
    links = coo_array((np.ones(len(i)), (i, j)), (count, count))
    expected = connected_components(links, directed=False)[1]
    assert ((piece[:, None] == piece) == (expected[:, None] == expected)).all()


@settings(max_examples=30)
@given(seeds)
def test_no_wall_out_of_sight_is_much_nearer_than_the_clearance_says(seed: int) -> None:
    """Discs are only believed where they are seen, but for a rim of two cells of a decimetre."""
    local_map = glance(seed)
    world = cluttered(seed)
    graph = fine(local_map, (0.0, 0.0))
    assume(len(graph.points))
    for (x, y), clearance in zip(graph.points, graph.clearance, strict=True):
        truth = float(np.hypot(*world.wall_offsets(x, y, clearance + 1.0).T).min())
        assert -0.04 < clearance - truth < 0.3


def test_between_two_corners_with_nothing_behind_the_graph_goes_as_far_as_discs_are_seen() -> None:
    """Two pillars and a laser between them that sees 5.6 m: there is no third wall to meet."""
    pillars: list[Rectangle] = [(-0.6, 1.2, 0.6, 2.4), (-0.6, -2.4, 0.6, -1.2)]
    world, laser = carved([(-20.0, -20.0, 20.0, 20.0)], pillars), Pose(1.0, 0.0, 0.0)
    local_map = LocalMap(LocalMapConfig())
    local_map.insert(sweep(world, laser, reach=5.6), laser, 0.0)
    graph = fine(local_map, (1.0, 0.0))
    on_axis = graph.points[np.abs(graph.points[:, 1]) < 0.05, 0]
    # (x - 1) + |(x, 0) - (0.6, 1.2)| = 5.6 at x = 3.48; the rim may be unseen, and steps are 0.2
    assert 3.2 < on_axis.max() < 3.7
    assert np.diff(np.sort(on_axis[on_axis > 1.0])).max() < 0.3
    last = np.argmax(graph.points[:, 0])
    assert graph.lead[last] == pytest.approx(0.0, abs=0.05)


def test_nothing_in_sight_is_no_graph() -> None:
    nothing = LocalMap(LocalMapConfig())
    nothing.insert(Scan(0.0, np.full(100, np.inf), -1.0, 0.02, 0.1, 10.0), Pose(), 0.0)
    assert not len(fine(nothing, (0.0, 0.0)).points)


def test_one_straight_wall_is_no_graph() -> None:
    world = carved([(-9.0, -9.0, 9.0, 9.0)])
    graph = fine(looked(world, [Pose(0.0, 7.0, 1.57)], field_of_view=1.0), (0.0, 7.0))
    assert not len(graph.ridges)


class Drawn:
    """Walls as points (N, 2); all between them is seen."""

    def __init__(self, *walls: tuple[Point, Point]) -> None:
        self._points = np.concatenate([resampled(list(wall)) for wall in walls])

    def points(self) -> Array:
        return self._points

    def known(self, points: Array) -> NDArray[np.bool_]:
        return np.ones(points.shape[:-1], bool)


def test_behind_what_is_unknown_the_graph_does_not_go_on() -> None:
    """A corridor ends in the open; discs that are wide enough to lie round a strip are known."""

    class Stripped(Drawn):
        def known(self, points: Array) -> NDArray[np.bool_]:
            x, y = points[..., 0], points[..., 1]
            is_in_strip = (x > 1.6) & (x < 2.0) & (np.abs(y) < 2.0)
            return np.asarray(~is_in_strip)

    space = Stripped(((-4.0, 1.0), (0.0, 1.0)), ((-4.0, -1.0), (0.0, -1.0)))
    graph = fine_graph(space, np.array([-2.0, 0.0]), min_clearance=RADIUS, roughness=0.03)
    steps = graph.points[graph.ridges[:, 0]] - graph.points[graph.ridges[:, 1]]
    assert np.hypot(*steps.T).max() < 0.3
    assert 0.2 < graph.points[:, 0].max() < 1.6
    (lead,) = np.flatnonzero(graph.points[:, 0] == graph.points[:, 0].max())
    assert graph.lead[lead] == pytest.approx(0.0, abs=0.05)


def test_no_place_is_asked_for_twice_to_draw_one_graph() -> None:
    """The ridges of a door's rough posts are asked for first, and then all that lead on."""

    class Asked(Drawn):
        places: Array = np.empty((0, 2))

        def points(self) -> Array:
            walls = super().points()  # scattered, so that no two discs of the diagram are the same
            return walls + np.random.default_rng(1).normal(0.0, 1e-4, walls.shape)

        def known(self, points: Array) -> NDArray[np.bool_]:
            self.places = np.concatenate([self.places, points.reshape(-1, 2)])
            return super().known(points)

    space = Asked(*_uneven_room(0.6))
    assert len(
        fine_graph(space, np.array([0.0, -0.9]), min_clearance=RADIUS, roughness=0.03).points
    )
    assert len(np.unique(space.places, axis=0)) == len(space.places)


def _uneven_room(door: float) -> list[tuple[Point, Point]]:
    """A room whose wall stands out by millimetres beside its door, and a corridor."""
    post, beside, out = door / 2, door / 2 + 0.02, 0.002
    walls: list[tuple[Point, Point]] = [((-4.0, 7.0), (4.0, 7.0)), ((-4.0, -1.8), (4.0, -1.8))]
    for side in (-1.0, 1.0):
        corner = (4.0 * side, 0.0)
        walls += [
            ((post * side, 0.0), (post * side, -0.1)),
            ((post * side, -0.1), (4.0 * side, -0.1)),
            ((beside * side, out), corner),
            (corner, (4.0 * side, 7.0)),
        ]
    return walls


@pytest.mark.parametrize("door", [0.45, 0.6, 0.8])
def test_a_door_leads_into_a_room_whose_wall_is_uneven_by_millimetres(door: float) -> None:
    """Far from the door its edges are no longer the nearest: what stands out beside them is."""
    walls = _uneven_room(door)
    graph = fine_graph(Drawn(*walls), np.array([0.0, -0.9]), min_clearance=RADIUS, roughness=0.03)
    assert np.hypot(*(graph.points - [0.0, 3.5]).T).min() < 0.1  # the middle of the room
    assert np.hypot(*(graph.points - [0.0, -0.95]).T).min() < 0.1  # and of the corridor


@pytest.mark.parametrize("seed", [15, 25, 26])
def test_noise_of_a_wall_between_two_doors_is_no_way_into_a_hall(seed: int) -> None:
    """The ridges of bumps meet far off, where nothing is seen; from there they are no ways back."""
    rng = np.random.default_rng(seed)
    hall, corridor = (0.0, -9.0, 20.0, 9.0), (-2.3, -9.0, -0.3, 9.0)
    doors = [(-0.4, 2.0, 0.1, 3.2), (-0.4, -2.9, 0.1, -1.4)]
    world, local_map = carved([hall, corridor, *doors]), LocalMap(LocalMapConfig())
    for heading in np.linspace(-3.0, 3.0, 6):
        laser = Pose(1.8, 0.2, float(heading))
        scan = sweep(world, laser, reach=5.6, field_of_view=4.19, sigma=0.03, rng=rng)
        local_map.insert(scan, laser, 0.0)
    robot = np.array([1.8, 0.2])
    x, y = fine_graph(
        local_map, robot, min_clearance=0.227, roughness=0.03, open_clearance=4.48
    ).points.T
    assert not ((np.abs(y) < 1.0) & (x > 0.5) & (x < 4.2)).any()
