"""Drives over a lattice: every crossing, by the ear rule, and honest about themselves."""

import numpy as np
import pytest

from benchmarks.figures.tours import NORTH, SIDE, SOUTH, Tour

PERIMETER = 4 * (SIDE - 1)  # crossings
BLOCK = 4


@pytest.mark.parametrize(("came_from", "new"), [(NORTH, BLOCK), (SOUTH, PERIMETER)])
def test_the_ear_rule_goes_round_what_is_on_its_left(came_from: int, new: int) -> None:
    tour = Tour(0.01, 1, came_from=came_from).drive()
    assert tour.before_closure == new
    assert len(tour.ids) == SIDE**2
    assert np.abs(tour.errors).max() < 0.3  # what is seen errs by 5 cm


def test_a_robot_that_turns_back_is_never_far_more_uncertain_than_it_may() -> None:
    free, bound = (Tour(1.0, 1, came_from=SOUTH, limit=limit).drive() for limit in (np.inf, 2.0))
    assert max(bound.sigmas) < 2.0 + 1.0 < max(free.sigmas)
    assert len(bound.arrivals) > len(free.arrivals)


def test_a_filter_that_forgets_what_errors_have_in_common_is_overconfident() -> None:
    whole, apart = (
        np.mean([Tour(0.5, seed, independent=independent).drive().nees for seed in range(5)])
        for independent in (False, True)
    )
    assert whole < 4.0 < apart  # twice what is right
