"""What is remembered of gaps that the robot was in, for one of 0.18 m that plans with 5 cm more."""

import numpy as np
import pytest

from gvgbot.autonomy.tight_places import TightPlaces
from gvgbot.geometry import Array


def posts(gap: float) -> Array:
    """Two posts on the x axis, so far from each other, m."""
    return np.array([(-gap / 2, 0.0), (gap / 2, 0.0)])


def driven_through(gap: float) -> TightPlaces:
    """Along the y axis from -0.5 to 0.5."""
    tight = TightPlaces(0.18, 0.05)
    for y in np.linspace(-0.5, 0.5, 11):
        tight.fit(np.array([0.0, y]), posts(gap), y + 0.5)
    return tight


def test_a_gap_that_is_wide_enough_for_sure_is_not_remembered() -> None:
    assert len(driven_through(0.6).known.places) == 0


@pytest.mark.parametrize("gap", [0.4, 0.5])
def test_a_gap_that_is_hardly_wide_enough_is_remembered_where_it_is_narrow(gap: float) -> None:
    places, clearance = driven_through(gap).known
    assert 0.18 < clearance < 0.18 + 0.05
    assert np.all(np.abs(places[:, 1]) < 0.2)
    assert np.hypot(*places.T).min() < 0.06


def test_who_waits_in_a_gap_remembers_it_once() -> None:
    tight = TightPlaces(0.18, 0.05)
    for _ in range(100):
        tight.fit(np.zeros(2), posts(0.44), 3.0)
    assert len(tight.known.places) == 1


def test_where_the_guard_held_it_up_it_does_not_fit_whatever_it_did_before() -> None:
    tight = driven_through(0.44)
    tight.get_stuck(np.array([0.0, -0.1]), 1.0)
    tight.fit(np.array([0.0, 0.05]), posts(0.44), 1.2)
    assert len(tight.known.places) == 0
    tight.fit(np.array([3.0, 0.0]), posts(0.44) + np.array([3.0, 0.0]), 4.2)
    assert tight.known.places == pytest.approx(np.array([[3.0, 0.0]]))


def test_twenty_metres_later_both_are_forgotten() -> None:
    tight = driven_through(0.44)
    tight.fit(np.array([9.0, 0.0]), posts(0.44), 20.9)
    assert len(tight.known.places) == 0
    tight.get_stuck(np.zeros(2), 30.0)
    tight.fit(np.zeros(2), posts(0.44), 50.1)
    assert len(tight.known.places) == 1
