"""Which gap comes next, and when there is nothing more to be gained."""

import numpy as np
import pytest

from gvgbot.autonomy.exploration.unseen import Unseen
from gvgbot.geometry import Array

NEAR, FAR, WALLED_OFF = [1.0, 0.0], [5.0, 0.0], [0.0, 9.0]


def metres_to(place: Array) -> float | None:
    """From the origin; no way leads north."""
    return None if place[1] > 5.0 else float(np.hypot(*place))


def places(*which: list[float]) -> Array:
    return np.array(which).reshape(-1, 2)


def test_the_nearest_comes_first_and_each_has_had_its_turn_before_one_is_tried_again() -> None:
    unseen = Unseen()
    all_of_them = places(FAR, NEAR, WALLED_OFF)
    visited = [unseen.next(all_of_them, metres_to, twice=True) for _ in range(5)]
    assert [None if one is None else one.tolist() for one in visited] == [
        NEAR,
        FAR,
        NEAR,
        FAR,
        None,
    ]
    assert unseen.is_done
    assert len(unseen.left) == 3


def test_where_nobody_was_met_one_look_is_enough() -> None:
    """What looked like a passage was a pane of glass, and still is."""
    unseen = Unseen()
    assert unseen.next(places(FAR), metres_to, twice=False) is not None
    assert unseen.next(places(FAR), metres_to, twice=False) is None
    assert unseen.is_done


def test_a_gap_that_has_moved_a_little_is_the_same() -> None:
    unseen = Unseen()
    for _ in range(2):
        assert unseen.next(places(FAR), metres_to, twice=True) is not None
    assert unseen.next(places([5.3, 0.4]), metres_to, twice=True) is None
    assert len(unseen.left) == 1


def test_without_walls_in_sight_it_ends_although_there_are_always_new_ones() -> None:
    unseen = Unseen()
    visits = 0
    while unseen.next(places([2.0 * visits, 0.0]), metres_to, twice=True) is not None:
        visits += 1
        assert visits < 100
    assert visits > 10


@pytest.mark.parametrize(
    ("count", "told"),
    [
        (0, ""),
        (1, "(0.0, -0.3)"),
        (3, "(0.0, -0.3), (-9.0, 0.0), (-18.0, 0.3)"),
        (4, "(0.0, -0.3), (-9.0, 0.0), (-18.0, 0.3) and 1 more place"),
        (9, "(0.0, -0.3), (-9.0, 0.0), (-18.0, 0.3) and 6 more places"),
    ],
)
def test_the_first_places_are_told_of_one_by_one(count: int, told: str) -> None:
    unseen = Unseen()
    out_of_reach = places(*([-9.0 * i, 0.31 * i - 0.31] for i in range(count)))
    assert unseen.next(out_of_reach, lambda _: None, twice=True) is None
    assert unseen.where == told


def test_what_has_been_seen_after_all_is_not_complained_about() -> None:
    unseen = Unseen()
    unseen.next(places(FAR), metres_to, twice=True)
    assert unseen.next(places(), metres_to, twice=True) is None
    assert unseen.is_done
    assert len(unseen.left) == 0
    unseen.begin_anew()
    assert not unseen.is_done


def test_a_robot_stands_when_two_looks_find_it_at_the_same_place() -> None:
    unseen = Unseen()
    assert not unseen.is_standing(10.0)
    assert not unseen.is_standing(10.3)
    assert unseen.is_standing(10.3)


@pytest.mark.parametrize("somebody", [True, False])
def test_a_visit_from_which_somebody_kept_it_does_not_count_but_so_often(*, somebody: bool) -> None:
    unseen, at_home = Unseen(), np.array([0.0, 0.0])
    visits = 0
    while unseen.next(places(FAR), metres_to, twice=False) is not None:
        visits += 1
        unseen.judge(at_home, is_somebody_there=somebody)
        assert unseen.judge(at_home, is_somebody_there=somebody)  # it was not sent anywhere since
        assert visits < 100
    assert (visits > 2) == somebody


def test_a_visit_counts_whoever_is_there() -> None:
    unseen = Unseen()
    assert unseen.next(places(FAR), metres_to, twice=False) is not None
    assert unseen.judge(np.array(FAR), is_somebody_there=True)
    assert unseen.next(places(FAR), metres_to, twice=False) is None
