"""When something in the way is a reason to turn."""

from gvgbot.autonomy.exploration.hindrance import Hindrance


def held(hindrance: Hindrance, stamp: float, *, has_come_on: bool = False) -> str:
    hindrance.hold()
    return hindrance.reason_to_turn(stamp, has_come_on=has_come_on, patience_s=10.0)


def test_what_stands_in_the_way_is_waited_for_and_then_told_once() -> None:
    hindrance = Hindrance()
    reasons = [held(hindrance, float(stamp)) for stamp in range(20)]
    assert [stamp for stamp, reason in enumerate(reasons) if reason] == [11]


def test_who_comes_on_meanwhile_waits_anew() -> None:
    hindrance = Hindrance()
    assert not any(held(hindrance, float(s), has_come_on=s == 8) for s in range(20))
    assert held(hindrance, 20.0)


def test_without_anything_in_the_way_there_is_no_reason() -> None:
    hindrance = Hindrance()
    assert not hindrance.reason_to_turn(0.0, has_come_on=False, patience_s=10.0)
    assert not hindrance.reason_to_turn(1e6, has_come_on=False, patience_s=10.0)


def test_what_was_in_the_way_once_and_is_no_longer_is_none() -> None:
    hindrance = Hindrance()
    held(hindrance, 0.0)
    assert not hindrance.reason_to_turn(1.0, has_come_on=True, patience_s=10.0)
    for stamp in (2.0, 100.0):
        assert not hindrance.reason_to_turn(stamp, has_come_on=False, patience_s=10.0)


def test_where_there_is_no_way_on_nobody_waits() -> None:
    hindrance = Hindrance()
    hindrance.obstruct("a wall")
    told = [hindrance.reason_to_turn(s, has_come_on=False, patience_s=10.0) for s in (0.0, 1.0)]
    assert told == ["a wall", ""]


def test_an_outage_is_no_waiting() -> None:
    hindrance = Hindrance()
    held(hindrance, 0.0)
    hindrance.skip(100.0)
    assert not held(hindrance, 110.0)
    assert held(hindrance, 111.0)


def test_who_turns_to_something_else_waits_anew() -> None:
    hindrance = Hindrance()
    held(hindrance, 0.0)
    hindrance.end()
    assert not held(hindrance, 100.0)
