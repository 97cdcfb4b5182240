"""When there is no more hope of new ground: after all edges could have been driven twice."""

import numpy as np

from gvgbot.autonomy.exploration.new_ground import NewGround


def after(stamps: range, *, step_m: float, edges_m: float = 100.0) -> bool:
    """Whether it is over when the robot has driven so far from second to second, or stood."""
    ground = NewGround()
    for i, stamp in enumerate(stamps):
        ground.note(np.array([step_m * i, 0.0]), float(stamp))
    return ground.is_over(edges_m, float(stamps[-1]))


def test_whoever_comes_on_has_hope() -> None:
    assert not after(range(20_000), step_m=0.1)


def test_a_way_there_and_back_over_all_edges_at_half_the_speed_is_waited_for() -> None:
    assert not after(range(round(2 * 100.0 / 0.25)), step_m=0.0)
    assert after(range(1200), step_m=0.0)
    assert not after(range(1200), step_m=0.0, edges_m=400.0)


def test_ground_that_was_driven_before_is_not_new() -> None:
    ground = NewGround()
    for stamp in range(1200):
        ground.note(np.array([5.0 * np.sin(0.1 * stamp), 0.0]), float(stamp))
    assert ground.is_over(100.0, 1200.0)


def test_ground_beside_old_ground_is_none_where_the_map_sways() -> None:
    """To and fro for hours, at times 0.7 m farther to one side or to the other."""
    ground = NewGround()
    for stamp in range(12_000):
        y = 0.5 if stamp < 4000 else 1.2 if stamp < 11_500 else -0.2
        ground.note(np.array([5.0 * np.sin(0.1 * stamp), y]), float(stamp))
    assert ground.is_over(100.0, 12_000.0)


def test_a_room_off_an_old_corridor_is_new_ground() -> None:
    ground = NewGround()
    for stamp in range(2000):
        ground.note(np.array([5.0 * np.sin(0.1 * stamp), 0.0]), float(stamp))
    for stamp in range(2000, 2010):
        ground.note(np.array([0.0, 0.4 * (stamp - 2000)]), float(stamp))
    assert not ground.is_over(0.0, 2010.0)


def test_outages_and_other_tasks_do_not_count() -> None:
    ground = NewGround()
    ground.note(np.zeros(2), 0.0)
    ground.skip(5000.0)
    assert not ground.is_over(100.0, 5900.0)
    ground.restart()
    assert not ground.is_over(100.0, 9000.0)
    ground.note(np.zeros(2), 9000.0)
    assert not ground.is_over(100.0, 9900.0)
    assert ground.is_over(100.0, 10_200.0)


def test_patience_that_has_run_out_is_shorter_until_there_is_new_ground() -> None:
    """Without a bound of all waits together, whoever looks once more for what is missing might
    find frontiers that come and go for ever.
    """
    ground = NewGround()
    ground.note(np.zeros(2), 0.0)
    waits, begin = [], 0.0
    for _ in range(4):
        stamp = begin
        while not ground.is_over(100.0, stamp):
            stamp += 1.0
        waits.append(stamp - begin)
        ground.run_out()
        assert ground.is_over(100.0, stamp + 1.0)  # until it had something else to do
        ground.restart()
        begin = stamp + 100.0
        ground.note(np.zeros(2), begin)
    assert np.allclose(waits, waits[0] / np.array([1.0, 2.0, 4.0, 8.0]), atol=1.0)
    ground.note(np.array([50.0, 0.0]), begin)
    assert not ground.is_over(100.0, begin + waits[0] - 2.0)
