"""When there is no more hope of new ground: after all edges could have been driven twice."""

import numpy as np
import pytest

from gvgbot.autonomy.exploration.new_ground import NewGround


def driven(stamps: range, *, step_m: float, edges_m: float = 100.0) -> NewGround:
    """What there is to tell when the robot has driven so far from second to second, or stood."""
    ground = NewGround()
    for i, stamp in enumerate(stamps):
        ground.note(np.array([step_m * i, 0.0]), float(stamp), edges_m)
    return ground


def to_and_fro(ground: NewGround, stamps: range, y: float = 0.0) -> None:
    for stamp in stamps:
        ground.note(np.array([5.0 * np.sin(0.1 * stamp), y]), float(stamp), 100.0)


@pytest.mark.parametrize("speed", [0.05, 0.1, 0.6])
def test_whoever_comes_on_has_hope(speed: float) -> None:
    assert not driven(range(20_000), step_m=speed).is_over


@pytest.mark.parametrize("grows", [True, False])
def test_aisles_side_by_side_are_explored_to_the_last(*, grows: bool) -> None:
    """A hundred of them, 30 m long and a metre apart: cells touch, edges tell that they are new."""
    ground = NewGround()
    for aisle in range(100):
        for second in range(60):
            edges_m = 30.0 * aisle + 0.5 * second if grows else 30.0
            ground.note(np.array([aisle + 0.5, 0.5 * second]), 60.0 * aisle + second, edges_m)
    assert ground.is_over != grows


@pytest.mark.parametrize(
    ("edges_m", "stands_s", "is_over"),
    [(100.0, 2 * 100.0 / 0.25, False), (100.0, 1200.0, True), (400.0, 1200.0, False)],
)
def test_a_way_there_and_back_over_all_edges_at_half_the_speed_is_waited_for(
    edges_m: float, stands_s: float, *, is_over: bool
) -> None:
    """There is as much patience as that when so much was explored, and not much more."""
    ground = driven(range(1000), step_m=0.4, edges_m=edges_m)
    for stamp in range(1000, 1000 + round(stands_s)):
        ground.note(np.array([400.0, 0.0]), float(stamp), edges_m)
    assert ground.is_over == is_over


def test_ground_that_was_driven_before_is_not_new() -> None:
    ground = NewGround()
    to_and_fro(ground, range(1200))
    assert ground.is_over


def test_ground_beside_old_ground_is_none_where_the_map_sways() -> None:
    """To and fro for hours, at times 0.7 m farther to one side or to the other."""
    ground = NewGround()
    for begin, end, y in ((0, 4000, 0.5), (4000, 11_500, 1.2), (11_500, 12_000, -0.2)):
        to_and_fro(ground, range(begin, end), y)
    assert ground.is_over


def test_a_room_off_an_old_corridor_is_new_ground() -> None:
    ground = NewGround()
    to_and_fro(ground, range(2000))
    for stamp in range(2000, 2010):
        ground.note(np.array([0.0, 0.4 * (stamp - 2000)]), float(stamp), 100.0)
    assert not ground.is_over


def test_outages_and_other_tasks_do_not_count() -> None:
    ground = NewGround()
    ground.note(np.zeros(2), 0.0, 0.0)
    ground.skip(5000.0)
    ground.note(np.zeros(2), 5500.0, 0.0)
    ground.set_aside()
    ground.note(np.zeros(2), 9000.0, 0.0)
    ground.note(np.zeros(2), 9080.0, 0.0)
    assert not ground.is_over
    ground.note(np.zeros(2), 9150.0, 0.0)
    assert ground.is_over


@pytest.mark.parametrize("pause_s", [0.0, 400.0, 1000.0])
def test_it_ends_in_proportion_to_the_floor_wherever_new_ground_is_found(pause_s: float) -> None:
    """One new place after the other, long after the one before, with tasks of its own between."""
    ground, stamp = NewGround(), 0.0
    for place in range(30):
        ground.set_aside()
        for counted_s in np.linspace(0.0, pause_s, 20):
            ground.note(np.array([10.0 * place, 0.0]), stamp + counted_s, 500.0)
        stamp += pause_s + 50.0
    used_s = 30 * pause_s
    assert ground.is_past_its_end == (used_s > 30 * 60.0)


def test_who_finds_new_ground_without_hope_goes_on_there() -> None:
    ground = driven(range(1000), step_m=0.0, edges_m=0.0)
    assert ground.is_over
    assert not ground.is_past_its_end
    for i in range(10):
        ground.note(np.array([50.0 + i, 0.0]), 1000.0 + 10 * i, 0.0)
    assert not ground.is_over
