import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gvgbot.geometry import Pose, wrap_angle
from gvgbot.team.alignment import Alignment, _Evidence, align, refined
from gvgbot.team.likeness import likeness
from gvgbot.team.side import Side
from tests.unit.team.building import Building, irregular, lattice

STARTS = Pose(3.0, -2.0, 0.7), Pose(11.0, 6.0, -2.4)
SHIFTED = np.array([0.0, 0.5])
LEFT, RIGHT = {0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13}, {1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14}


@pytest.mark.parametrize("seed", [1, 2])
def test_two_charts_that_share_enough_of_a_building_are_laid_on_each_other(seed: int) -> None:
    building, rng = irregular(seed), np.random.default_rng(seed)
    ours, theirs = (
        building.chart(seen, start, rng) for seen, start in zip((LEFT, RIGHT), STARTS, strict=True)
    )
    found = align(ours, theirs)
    assert found is not None
    true = STARTS[0].to(STARTS[1])
    middle = np.array([6.0, 2.0])
    assert np.hypot(*(found.pose.transform(middle) - true.transform(middle))) < 0.1
    assert abs(wrap_angle(found.pose.theta - true.theta)) < 0.01
    assert found.pairs
    assert all(ours_id == theirs_id for ours_id, theirs_id in found.pairs)
    assert found.confidence >= 0.995


@pytest.mark.parametrize("seed", [1, 2])
def test_charts_of_different_buildings_are_not_joined(seed: int) -> None:
    everything = set(range(20))
    ours = irregular(seed).chart(everything, STARTS[0])
    theirs = irregular(seed + 10).chart(everything, STARTS[1])
    assert align(ours, theirs) is None


@pytest.mark.parametrize("shift", [0, 5])
def test_a_building_that_repeats_itself_is_never_joined(shift: int) -> None:
    """However much both have seen, each block of a grid may be any other."""
    grid = lattice(6.0 * np.arange(5), 6.0 * np.arange(4))
    seen = {0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13}
    theirs = {v + shift for v in seen}
    assert align(grid.chart(seen, STARTS[0]), grid.chart(theirs, STARTS[1])) is None


def test_charts_that_share_nothing_are_not_joined() -> None:
    building = irregular(4)
    ours = building.chart({0, 1, 5, 6, 10, 11, 15, 16}, STARTS[0])
    theirs = building.chart({3, 4, 8, 9, 13, 14, 18, 19}, STARTS[1])
    assert align(ours, theirs) is None


def test_an_alignment_that_the_charts_no_longer_bear_out_is_taken_back() -> None:
    building = irregular(1)
    ours, theirs = building.chart(LEFT, STARTS[0]), building.chart(RIGHT, STARTS[1])
    found = align(ours, theirs)
    assert found is not None
    assert refined(ours, theirs, found) is not None
    elsewhere = irregular(12).chart(RIGHT, STARTS[1])
    assert refined(ours, elsewhere, found) is None
    seen = replace(found, by_sight=True)
    assert refined(ours, elsewhere, seen) is not None


def test_a_vertex_that_one_robot_took_somebody_for_does_not_part_the_maps() -> None:
    building = irregular(1)
    ours, theirs = building.chart(LEFT, STARTS[0]), building.chart(RIGHT, STARTS[1])
    found = align(ours, theirs)
    assert found is not None
    shared = sorted(LEFT & RIGHT)[0]
    mistaken = replace(theirs.vertices[shared], walls=theirs.vertices[shared].walls + SHIFTED)
    theirs = replace(theirs, vertices=theirs.vertices | {shared: mistaken})
    kept = refined(ours, theirs, found)
    assert kept is not None
    assert kept.pose.distance(found.pose) < 0.1


@pytest.mark.parametrize(("apart", "alike"), [(0.25, True), (0.0, False)])
def test_a_vertex_placed_elsewhere_by_another_robot_may_have_as_much_other_clearance(
    apart: float, *, alike: bool
) -> None:
    """Nothing comes nearer to a wall by more than it is moved; their chart has it 0.25 m off."""
    chart = irregular(1).chart(LEFT, Pose())
    vertex = chart.vertices[1]
    position = vertex.position + np.array([0.0, apart])
    elsewhere = replace(vertex, position=position, clearance=vertex.clearance - 0.25)
    moved = replace(chart, vertices=chart.vertices | {1: elsewhere})
    a, b = Side(chart), Side(moved)
    at = a.ids.index(1)
    assert (likeness(a, b, at, at, Pose()) > 0.9) == alike


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("off", [Pose(0.2, -0.1, 0.03), Pose(-0.1, 0.2, -0.03)])
def test_what_was_known_about_is_known_well_by_the_walls_of_a_few_shared_places(
    off: Pose, seed: int
) -> None:
    building, rng = irregular(seed), np.random.default_rng(seed)
    ours = building.chart({0, 1, 2, 5, 6, 7}, STARTS[0], rng)
    theirs = building.chart({2, 3, 4, 7, 8, 9}, STARTS[1], rng)  # two of them
    true = STARTS[0].to(STARTS[1])
    shared = true.inverse().transform(ours.vertices[2].position)
    there = Pose(float(shared[0]), float(shared[1]), 0.0)
    about = true.compose(there).compose(off).compose(there.inverse())
    found = refined(ours, theirs, Alignment(about, np.eye(3), (), 0.999))
    assert found is not None
    places = np.array([vertex.position for vertex in theirs.vertices.values()])
    assert np.hypot(*(found.pose.transform(places) - true.transform(places)).T).max() < 0.05
    assert abs(wrap_angle(found.pose.theta - true.theta)) < 0.005


def test_a_frame_does_not_creep_along_walls_that_are_none_of_both_robots() -> None:
    """One has seen a pane of glass half a metre from a wall that the other one has seen."""
    places = np.array([(0.0, 0.0), (8.0, 0.0), (8.0, 6.0)])
    corridors = ((0, 1), (1, 2))
    ours = Building(places, corridors).chart({0, 1, 2}, Pose())
    theirs = Building(np.add(places, [0.45, 0.0]), corridors).chart({0, 1, 2}, Pose())
    known = Alignment(Pose(), np.diag([0.02**2, 0.02**2, 0.01**2]), (), 0.999, by_sight=True)
    for _ in range(10):
        found = refined(ours, theirs, known)
        assert found is not None
        known = found
    assert np.hypot(known.pose.x, known.pose.y) < 0.25


def test_the_covariance_of_a_frame_grows_with_how_far_apart_the_charts_stay() -> None:
    building = irregular(2)
    exact = align(building.chart(LEFT, Pose()), building.chart(RIGHT, Pose()))
    blurred = align(
        building.chart(LEFT, Pose(), np.random.default_rng(1)),
        building.chart(RIGHT, Pose(), np.random.default_rng(2)),
    )
    assert exact is not None
    assert blurred is not None
    assert math.sqrt(np.trace(blurred.covariance)) > math.sqrt(np.trace(exact.covariance))


def test_equal_corridors_without_number_do_not_fill_the_memory() -> None:
    middles = 6.0 * np.arange(5)
    whole = lattice(middles, middles).chart(set(range(len(middles) ** 2)), Pose())
    bare = {key: replace(vertex, walls=np.empty((0, 2))) for key, vertex in whole.vertices.items()}
    chart = replace(whole, vertices=bare)
    tracemalloc.start()
    try:
        assert align(chart, chart) is None
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 12e6


@pytest.mark.parametrize(
    "doubt",
    [
        {"pairs": ((0, 0), (1, 1), (2, 2))},
        {"connected": 2},  # the rest may lie so by chance
        {"meetpoints": 2},  # dead ends look alike
        {"against": 2},
        {"missed": 5},  # vertices where the other robot drove along and saw none
        {"crossed": 3.0},  # of the metres that robots drove, so many through walls
    ],
)
def test_however_much_speaks_for_a_transform_it_is_not_possible_if_something_is_wrong(
    doubt: dict[str, Any],
) -> None:
    good = _Evidence(
        pose=Pose(),
        pairs=tuple((i, i) for i in range(10)),
        partners=10,
        connected=10,
        against=0,
        missed=0,
        meetpoints=8,
        judged=100.0,
        crossed=0.0,
    )
    assert good.is_possible
    assert not replace(good, **doubt).is_possible
