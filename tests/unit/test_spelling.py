"""Names that are mistyped by a letter or two."""

import pytest

from gvgbot.spelling import nearest


@pytest.mark.parametrize(("typed", "meant"), [("ofice", "office"), ("gird", "grid"), ("x", None)])
def test_a_mistyped_name_is_taken_for_the_nearest(typed: str, meant: str | None) -> None:
    assert nearest(typed, ("grid", "office")) == meant
