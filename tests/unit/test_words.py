"""One thing is not called several."""

import pytest

from gvgbot.words import counted, shortened


@pytest.mark.parametrize(("count", "says"), [(0, "0 vertices"), (1, "1 vertex"), (2, "2 vertices")])
def test_things_are_counted_as_people_do(count: int, says: str) -> None:
    assert counted(count, "vertex", "vertices") == says


def test_an_s_is_enough_for_most() -> None:
    assert (counted(1, "edge"), counted(3, "edge")) == ("1 edge", "3 edges")


@pytest.mark.parametrize(
    ("longest", "says"), [(9, "kitchen-2"), (8, "kitc…n-2"), (5, "ki…-2"), (3, "k…2")]
)
def test_of_a_long_name_both_ends_stay(longest: int, says: str) -> None:
    assert shortened("kitchen-2", longest) == says
