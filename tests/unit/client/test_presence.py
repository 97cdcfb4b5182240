"""What is made of the signs of a robot, case by case."""

import pytest

from gvgbot.client.presence import Presence, Signs, Word

NOW = 100.0


@pytest.mark.parametrize(
    ("signs", "linked", "word", "for_s"),
    [
        pytest.param(Signs(90.0), True, "absent", 10.0, id="never seen"),
        pytest.param(Signs(90.0), False, "cut off", 10.0, id="never seen, and the link is lost"),
        pytest.param(Signs(10.0, 97.0, True), True, "quiet", 3.0, id="joined, never heard"),
        pytest.param(Signs(10.0, 99.0, True), True, "alive", 1.0, id="joined a moment ago"),
        pytest.param(Signs(10.0, 50.0, True, 99.5), True, "alive", 50.0, id="heard a moment ago"),
        pytest.param(Signs(10.0, 50.0, True, 80.0), True, "quiet", 20.0, id="silent"),
        pytest.param(Signs(10.0, 99.0, True, 60.0), True, "alive", 1.0, id="back a moment ago"),
        pytest.param(
            Signs(10.0, 50.0, True, 99.9, doubled_at=99.5),
            True,
            "doubled",
            50.0,
            id="two by a name",
        ),
        pytest.param(
            Signs(10.0, 50.0, True, 99.9, doubled_at=90.0), True, "alive", 50.0, id="one has left"
        ),
        pytest.param(
            Signs(10.0, 88.0, False, 87.0, doubled_at=86.9), True, "gone", 12.0, id="both left"
        ),
        pytest.param(
            Signs(10.0, 88.0, False, 87.0, via_router=True), True, "gone", 12.0, id="left a router"
        ),
        pytest.param(Signs(10.0, 88.0, False, 87.0), False, "gone", 12.0, id="left, was direct"),
        pytest.param(
            Signs(10.0, 88.0, False, 87.0, via_router=True), False, "cut off", 12.0, id="no router"
        ),
    ],
)
def test_a_robot_that_hangs_has_left_or_cannot_be_reached_is_told_apart(
    signs: Signs, linked: bool, word: Word, for_s: float
) -> None:
    assert signs.presence(NOW, linked=linked) == Presence(word, for_s)
