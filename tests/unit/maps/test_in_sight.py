"""From how near a place is in sight of ways, by hand-drawn maps: walls are in between, or not."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Array
from gvgbot.maps.in_sight import are_nearer_to, metres_in_sight
from tests.unit.maps.test_gaps import drawn

# A metre for each letter; the corner of the map is at (-1, -2). A room along y = 1.5, a corridor
# along y = -0.5 and between them a door at x from 3 to 4; east of x = 5 nothing was seen.
HOUSE = ("#######", "#....##", "####.##", "#..... ", "#######")
IN_ROOM, BEYOND_DOOR = (0.5, 1.5), (3.5, 1.5)


def away(
    *ways: tuple[float, float], place: tuple[float, float] = IN_ROOM, within_m: float
) -> float:
    points = np.array(ways).reshape(-1, 2)
    (metres,) = metres_in_sight(drawn(*HOUSE), points, np.array([place]), within_m)
    return float(metres)


def test_a_wall_in_between_hides_what_is_nearest() -> None:
    behind = (0.5, -0.5)
    assert away(behind, within_m=6.0) == math.inf
    assert away(behind, BEYOND_DOOR, within_m=6.0) == pytest.approx(3.0)


def test_what_is_too_far_off_is_not_seen() -> None:
    assert away(BEYOND_DOOR, within_m=3.1) == pytest.approx(3.0)
    assert away(BEYOND_DOOR, within_m=2.9) == math.inf


def test_from_a_door_a_room_is_seen_on_a_slant() -> None:
    """To (0.5, 1.5) from (3.9, 0.9) the line is at y = 1.06 beside the jamb at (3, 1)."""
    assert away((3.9, 0.9), within_m=6.0) == pytest.approx(math.hypot(3.4, 0.6))
    assert away((3.9, 0.6), within_m=6.0) == math.inf


def test_what_nobody_has_seen_hides_nothing() -> None:
    """Nor what is beyond the map."""
    assert away((7.5, -0.5), place=(2.5, -0.5), within_m=6.0) == pytest.approx(5.0)


def test_without_places_or_ways_there_is_nothing_to_tell() -> None:
    none: Array = np.empty((0, 2))
    assert len(metres_in_sight(drawn(*HOUSE), np.array([IN_ROOM]), none, 6.0)) == 0
    assert away(within_m=6.0) == math.inf


@pytest.mark.parametrize(
    ("others", "ways", "looks", "is_nearer"),
    [
        (2.5, 1.5, 1.5, False),  # it is where one has looked from, and where one drives
        (2.5, 2.6, 2.7, False),  # both are as near
        (1.5, 2.5, 1.0, True),  # one has looked from near by, which has not sufficed
        (1.5, 1.0, 2.5, True),  # one's ways lead there; one has not been there
        (1.5, 2.5, 2.5, True),
        (9.0, 2.5, 2.5, False),  # nobody else is near
        (9.0, 9.0, 9.0, False),  # nor oneself
    ],
)
def test_what_others_see_from_nearer_by_is_theirs(
    others: float, ways: float, looks: float, *, is_nearer: bool
) -> None:
    """All are so far east of the place in the room."""
    theirs, *own = (np.array([np.add(IN_ROOM, (east, 0.0))]) for east in (others, ways, looks))
    found = are_nearer_to(theirs, own, np.array([IN_ROOM]), drawn(*HOUSE), 3.0)
    assert found.tolist() == [is_nearer]
