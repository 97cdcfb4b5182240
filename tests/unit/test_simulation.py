"""What the laser of a simulated robot sees while it stands and while it drives."""

import numpy as np
import pytest

from gvgbot.drivers.body import RobotBody
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.sight import Sight
from gvgbot.geometry import Array, Pose
from gvgbot.simulation import _Eye
from tests.unit.autonomy.sights import carved

MODEL = MODELS["UTM-30LX"]
BASE_LASER = Pose(0.1, 0.0, 0.0)
ROOM = carved([(-3.0, -2.0, 3.0, 2.0)], [(1.0, -1.0, 1.5, 0.0)])


class Watched(Sight):
    """Remembers from where it was looked."""

    def __init__(self) -> None:
        super().__init__(ROOM, None, 0)
        self.poses: list[Pose] = []

    def look(self, pose: Pose, bearings: Array, max_range: float) -> Array:
        self.poses.append(pose)
        return super().look(pose, bearings, max_range)


@pytest.mark.parametrize("is_flipped", [False, True])
def test_who_stands_looks_once_and_sees_the_world_all_around(*, is_flipped: bool) -> None:
    """A laser that hangs upside down begins on the other side; it sees as far to either side."""
    body, sight = RobotBody(ROOM, Pose(-1.0, 0.5, 0.3)), Watched()
    ranges = _Eye(body, sight, MODEL, BASE_LASER, is_flipped=is_flipped).sweep(1.0)
    world_laser = body.pose.compose(BASE_LASER)
    assert sight.poses == [world_laser]
    wanted = ROOM.cast(world_laser, MODEL.parameters.bearings, MODEL.usable_mm / 1000)
    np.testing.assert_array_equal(ranges[::-1] if is_flipped else ranges, wanted)


@pytest.mark.parametrize(("linear", "angular"), [(0.3, 0.0), (0.0, 1.0)], ids=["drives", "turns"])
def test_who_moves_looks_from_where_it_has_come_to_during_the_sweep(
    linear: float, angular: float
) -> None:
    """From the middle of its first sector to that of the last one: 5 of 6 of the beams' time.

    A sweep begins at step 0, where this laser does not measure yet.
    """
    model = MODELS["URG-04LX"]
    body, sight = RobotBody(ROOM, Pose(-1.0, 0.5, 0.0)), Watched()
    body.command(linear, angular)
    body.advance(1.0)
    _Eye(body, sight, model, Pose(), is_flipped=False).sweep(1.0)
    steps = 725 - 44  # of a turn of 1024, in 0.1 s
    for seen, step in ((0, 44 + steps / 12), (-1, 725 - steps / 12)):
        moved, late = body.pose.to(sight.poses[seen]), 0.1 * step / 1024
        assert moved.x == pytest.approx(linear * late, abs=1e-4)
        assert moved.theta == pytest.approx(angular * late, abs=1e-3)
