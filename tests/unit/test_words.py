"""One thing is not called several."""

import pytest

from gvgbot.words import counted


@pytest.mark.parametrize(("count", "says"), [(0, "0 vertices"), (1, "1 vertex"), (2, "2 vertices")])
def test_things_are_counted_as_people_do(count: int, says: str) -> None:
    assert counted(count, "vertex", "vertices") == says


def test_an_s_is_enough_for_most() -> None:
    assert (counted(1, "edge"), counted(3, "edge")) == ("1 edge", "3 edges")
