"""Which messages were held up on their way, whatever the clocks of their senders say."""

import pytest

from gvgbot.ros2.delays import Delays

ONE, OTHER = b"one", b"other"


def heard(delays: Delays, sent: list[float], came: list[float], ahead: float) -> list[bool]:
    return [
        not delays.held_up(ONE, sent=s + ahead, stamp=c) for s, c in zip(sent, came, strict=True)
    ]


@pytest.mark.parametrize("ahead", [-1.7e9, 0.0, 1.7e9])
def test_what_a_router_kept_is_passed_over_and_what_is_sent_then_is_not(ahead: float) -> None:
    sent = [0.1 * n for n in range(100)]
    came = [max(s, 8.0) if s > 3.05 else s for s in sent]  # nothing from 3.05 to 8 s
    expected = [c - s < 0.49 for s, c in zip(sent, came, strict=True)]
    unsure = [0.49 < c - s < 0.51 for s, c in zip(sent, came, strict=True)]
    driven = heard(Delays(), sent, came, ahead)
    assert [d for d, u in zip(driven, unsure, strict=True) if not u] == [
        e for e, u in zip(expected, unsure, strict=True) if not u
    ]


def test_a_clock_that_is_set_back_costs_two_seconds() -> None:
    delays, came = Delays(), [0.1 * n for n in range(100)]
    driven = heard(delays, [c if c < 4.95 else c - 3600.0 for c in came], came, 0.0)
    assert driven == [not 4.95 < c < 6.95 for c in came]


def test_what_is_held_up_for_a_moment_now_and_then_is_passed_over_each_time() -> None:
    """Not only the first time: two seconds of it must be on end to be a longer way."""
    sent = [0.1 * n for n in range(100)]
    late = {20, 21, 45, 70, 71, 72}
    came = [s + 0.8 if n in late else s for n, s in enumerate(sent)]
    assert heard(Delays(), sent, came, 0.0) == [n not in late for n in range(100)]


def test_clocks_that_go_apart_cost_nothing() -> None:
    came = [0.1 * n for n in range(40_000)]
    assert all(heard(Delays(), [0.9995 * c for c in came], came, 0.0))


def test_each_sender_has_a_clock_of_its_own() -> None:
    delays = Delays()
    for stamp in range(3):
        assert not delays.held_up(ONE, sent=stamp + 60.0, stamp=float(stamp))
        assert not delays.held_up(OTHER, sent=stamp - 60.0, stamp=float(stamp))
    for number in range(1000):
        assert not delays.held_up(b"%d" % number, sent=0.0, stamp=float(number))
    assert len(delays._least) <= 32
