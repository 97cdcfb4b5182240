"""For how long a robot has not come on, by where it was seen when."""

import numpy as np
import pytest

from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.geometry import Array


def at(x: float) -> Array:
    return np.array([x, 0.0])


def noted(xs: list[float], start: float = 0.0) -> tuple[Headway, float]:
    """What it says when the robot has been seen at places, one a second."""
    headway = Headway()
    waited = [headway.note(at(x), start + i) for i, x in enumerate(xs)]
    return headway, waited[-1]


def test_who_drives_has_not_waited() -> None:
    assert noted([0.0, 0.5, 1.0, 1.5, 2.0])[1] == 0.0


def test_who_stands_has_waited_since_it_came_there() -> None:
    headway, waited = noted([0.0, 0.0, 2.0, 2.0, 2.0, 2.0], start=50.0)
    assert waited == 3.0
    assert headway.waited(60.0) == 8.0


def test_to_and_fro_on_the_spot_is_no_headway() -> None:
    headway, waited = noted([0.0, 0.2] * 10)
    assert waited == headway.waited(19.0) == 19.0


def test_to_and_fro_about_one_place_is_none_either() -> None:
    assert noted([0.0, 1.0] * 10)[1] == 19.0
    assert noted([0.0, 2.0] * 10)[1] == 0.0


def test_an_outage_does_not_count_but_for_the_longest_usual_gap() -> None:
    headway, _ = noted([0.0, 0.0])
    assert headway.note(at(0.0), 101.0) == pytest.approx(3.0)


def test_who_is_elsewhere_after_an_outage_waits_from_then_on() -> None:
    """Somebody may have sent it there meanwhile."""
    headway, _ = noted([0.0, 0.0])
    assert headway.note(at(5.0), 300.0) == 0.0
    assert headway.waited(304.0) == 4.0


def test_who_begins_to_wait_in_an_outage_does_not_wait_longer_for_what_was_before() -> None:
    headway, _ = noted([0.0, 0.0])
    headway.restart(200.0)
    headway.note(at(0.0), 202.0)
    assert 4.0 <= headway.waited(206.0) <= 6.0


def test_what_is_skipped_does_not_count() -> None:
    headway, _ = noted([0.0, 0.0])
    headway.skip(100.0)
    assert headway.note(at(0.0), 102.0) == 2.0


def test_who_has_a_reason_to_wait_counts_anew() -> None:
    headway, _ = noted([0.0] * 10)
    headway.restart(9.0)
    assert headway.waited(10.0) == 1.0
    assert headway.note(at(0.0), 10.0) == 10.0  # but it is still about the same place
    headway.restart_stay()
    assert headway.note(at(0.0), 11.0) == 2.0
