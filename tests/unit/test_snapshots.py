"""What people beside the robot are shown of its state."""

from types import SimpleNamespace
from typing import Any

import pytest

from gvgbot.hal.messages import Sign
from gvgbot.snapshots import sign


def state(phase: str, outcome: str | None = None, guard: str | None = None) -> Any:
    return SimpleNamespace(phase=phase, outcome=outcome, guard=guard)


@pytest.mark.parametrize(
    ("now", "is_lost", "shown"),
    [
        (state("starting"), False, "starting"),
        (state("starting", guard="no scan"), False, "starting"),
        (state("exploring"), False, "busy"),
        (state("exploring"), True, "searching"),
        (state("exploring", guard="obstacle"), False, "busy"),
        (state("exploring", guard="wheel drop"), False, "trouble"),
        (state("exploring", guard="laser sees nothing"), False, "trouble"),
        (state("errand", outcome="explored"), False, "busy"),
        (state("errand", outcome="explored"), True, "searching"),
        (state("halted"), False, "trouble"),
        (state("paused"), False, "standing"),
        (state("paused"), True, "standing"),
        (state("waiting"), False, "standing"),
        (state("finished", outcome="explored"), False, "finished"),
        (state("finished", outcome="explored_with_blocked"), False, "finished"),
        (state("finished", outcome="stopped"), False, "finished"),
        (state("finished", outcome="failed"), True, "trouble"),
    ],
)
def test_each_state_has_its_sign(now: Any, is_lost: bool, shown: Sign) -> None:
    assert sign(now, is_lost=is_lost) == shown


def test_what_is_felt_and_does_not_go_away_is_trouble() -> None:
    now = state("exploring", guard="bumper")
    assert sign(now, is_lost=False, needs_somebody=False) == "busy"
    assert sign(now, is_lost=False, needs_somebody=True) == "trouble"
