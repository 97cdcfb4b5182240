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
STEPS = len(MODEL.parameters.bearings)
BASE_LASER = Pose(0.1, 0.0, 0.0)
ROOM = carved([(-3.0, -2.0, 3.0, 2.0)], [(1.0, -1.0, 1.5, 0.0)])


class Watched(Sight):
    """Remembers from where it was looked."""

    def __init__(self) -> None:
        super().__init__(ROOM, None, 0)
        self.poses: list[Pose] = []

    def look(
        self, pose: Pose, bearings: Array, max_range: float, moved: Array | None = None
    ) -> Array:
        self.poses.append(pose)
        return super().look(pose, bearings, max_range, moved)


@pytest.mark.parametrize("is_flipped", [False, True])
def test_who_stands_looks_once_and_sees_the_world_all_around(*, is_flipped: bool) -> None:
    """A laser that hangs upside down begins on the other side; it sees as far to either side."""
    body, sight = RobotBody(ROOM, Pose(-1.0, 0.5, 0.3)), Watched()
    ranges = _Eye(body, sight, MODEL, BASE_LASER, is_flipped=is_flipped).sweep(1.0, STEPS)
    world_laser = body.pose.compose(BASE_LASER)
    assert sight.poses == [world_laser]
    wanted = ROOM.cast(world_laser, MODEL.parameters.bearings, MODEL.usable_mm / 1000)
    np.testing.assert_array_equal(ranges[::-1] if is_flipped else ranges, wanted)


@pytest.mark.parametrize(
    ("model", "is_flipped"), [("URG-04LX", False), ("UTM-30LX", False), ("URG-04LX", True)]
)
@pytest.mark.parametrize(
    ("linear", "angular"), [(0.7, 0.0), (0.0, 1.2), (0.5, -1.0)], ids=["drives", "turns", "bends"]
)
def test_each_beam_of_who_moves_is_seen_from_where_it_has_come_to(
    model: str, linear: float, angular: float, *, is_flipped: bool
) -> None:
    """The way is an arc, on which the laser looks first along one side of an edge, then another."""
    laser = MODELS[model]
    body = RobotBody(ROOM, Pose(-1.0, 0.5, 0.0))
    body.command(linear, angular)
    body.advance(1.0)
    start, at_1_s = body.pose, 1.0
    eye = _Eye(body, Sight(ROOM, None, 0), laser, BASE_LASER, is_flipped=is_flipped)
    body.advance(1.2)  # others have looked at it since
    bearings, wanted = laser.parameters.bearings, []
    seen = eye.sweep(at_1_s, len(bearings))
    for i, bearing in enumerate(-bearings if is_flipped else bearings):
        late = (laser.parameters.first_step + i) * laser.parameters.step_time
        turn, way = angular * late, linear * late
        chord = way * np.sinc(turn / (2.0 * np.pi))
        moved = Pose(chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn)
        world_laser = start.compose(moved).compose(BASE_LASER)
        wanted += ROOM.cast(world_laser, np.array([bearing]), laser.usable_mm / 1000).tolist()
    off = np.abs(seen - wanted)
    beside_edges = off > 0.05
    assert np.count_nonzero(beside_edges) <= 2
    assert off[~beside_edges].max() < 0.002
    assert off[~beside_edges].mean() < 1e-4


def test_who_is_put_elsewhere_during_a_sweep_is_there_for_the_whole_of_it() -> None:
    body = RobotBody(ROOM, Pose(-1.0, 0.5, 0.0))
    body.advance(1.0)
    body.pose = elsewhere = Pose(2.0, -1.0, 3.0)
    eye = _Eye(body, Sight(ROOM, None, 0), MODEL, Pose(), is_flipped=False)
    wanted = ROOM.cast(elsewhere, MODEL.parameters.bearings, MODEL.usable_mm / 1000)
    np.testing.assert_array_equal(eye.sweep(1.0, STEPS), wanted)


def test_beams_that_nobody_asked_for_move_no_body_on() -> None:
    """Else the base, which is asked before they were due, would feel what is to come."""
    part, whole = (RobotBody(ROOM, Pose(-1.0, 0.5, 0.0)) for _ in range(2))
    seen = []
    for body, steps in ((part, STEPS // 2), (whole, STEPS)):
        body.command(0.0, 1.2)
        body.advance(1.0)
        eye = _Eye(body, Sight(ROOM, None, 0), MODEL, BASE_LASER, is_flipped=False)
        seen.append(eye.sweep(1.0, steps))
    parameters = MODEL.parameters
    last = parameters.first_step + STEPS // 2 - 1
    assert part.now == pytest.approx(1.0 + last * parameters.step_time)
    np.testing.assert_allclose(seen[0], seen[1][: STEPS // 2], atol=0.002)


def test_the_body_tells_where_it_was_while_it_began_to_turn() -> None:
    """It speeds up evenly: by the half of 6 rad/s^2 times the square of the time."""
    body = RobotBody(ROOM, Pose(-1.0, 0.5, 0.3))
    body.advance(1.0)
    body.command(0.0, 1.2)
    body.advance(1.15)
    for late in (-0.5, 0.0, 0.05, 0.1, 0.15):
        turned = 0.5 * 6.0 * max(0.0, late) ** 2
        assert body.pose_at(1.0 + late).theta == pytest.approx(0.3 + turned, abs=4e-4)
