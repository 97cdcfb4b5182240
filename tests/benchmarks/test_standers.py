"""Who stands about is judged by where he is, and by what the robot could see of where he was."""

import math

import numpy as np
import pytest

from benchmarks.standers import Standers
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import carved

# Two rooms side by side with a wall from x = 0.9 to 1.1 between them.
ROOMS = carved([(-3.0, -2.0, 0.9, 2.0), (1.1, -2.0, 4.0, 2.0)])
SPOT, GONE = np.array([[0.0, 0.0]]), np.array([[0.0, 1.5]])


def watched(robot: Pose, *, stays_s: float, looks_s: float) -> Standers:
    """Somebody stands for a while, then goes; the robot is where it is."""
    standers = Standers(ROOMS)
    for look in range(round((stays_s + looks_s) / 0.05)):
        now = 0.05 * look
        standers.look(SPOT if now < stays_s else GONE, robot, now)
    return standers


def test_who_has_stood_for_ten_seconds_stands() -> None:
    standers = watched(Pose(3.0, 0.0), stays_s=10.2, looks_s=0.0)
    assert np.allclose(standers.standing(10.2), SPOT)
    assert not watched(Pose(3.0, 0.0), stays_s=9.8, looks_s=0.0).standing(9.8)


@pytest.mark.parametrize(
    ("robot", "is_known"),
    [
        (Pose(-2.5, 0.0, 0.0), True),
        pytest.param(Pose(-2.5, 0.0, math.pi), False, id="looks away"),
        pytest.param(Pose(2.0, 0.0, math.pi), False, id="behind the wall"),
    ],
)
def test_where_somebody_stood_is_known_again_when_the_robot_has_looked(
    robot: Pose, *, is_known: bool
) -> None:
    assert len(watched(robot, stays_s=12.0, looks_s=2.0).unseen) == 1
    assert len(watched(robot, stays_s=12.0, looks_s=4.0).unseen) == (0 if is_known else 1)
    assert not watched(robot, stays_s=5.0, looks_s=1.0).unseen
