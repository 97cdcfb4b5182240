"""What a laser hardly sees, panes of glass and legs of chairs, neither misleads nor is touched."""

import math

import pytest

from gvgbot.config import TwinConfig
from gvgbot.drivers.hokuyo.models import ModelName
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.geometry import Pose
from gvgbot.worlds.canvas import Canvas
from tests.scenarios.rig import assert_explored, assert_found, play
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]


def test_a_room_behind_glass_is_entered_by_its_door() -> None:
    """A corridor of 1.5 m, and beside it a room of 3.5 m that is seen through a pane of 2.4 m."""
    canvas = Canvas(9.0, 7.0)
    canvas.carve(0.5, 0.5, 8.5, 2.0)
    canvas.carve(3.0, 2.2, 8.0, 5.7)
    canvas.carve(3.2, 2.0, 4.2, 2.2)
    canvas.glaze(5.0, 2.0, 7.4, 2.2)
    run = play(canvas.world("glass"), Pose(1.5, 1.25, 0.0))
    assert_explored(run)
    meetpoints = [run.world(vertex) for vertex in run.vertices("meetpoint")]
    assert min(math.dist(point, (3.7, 1.3)) for point in meetpoints) < 0.4
    assert len(meetpoints) <= 2  # a corner of the pane may not have been seen well enough


@pytest.mark.parametrize("model", ["UTM-30LX", "URG-04LX"])
def test_mixed_pixels_are_no_posts(model: ModelName) -> None:
    """Half of the beams at an edge end in mid-air; a corridor, and two rooms beside it."""
    rooms = [(-3.0, 1.0, 1.0, 5.0), (3.0, 1.2, 7.5, 5.0)]
    doors = [(-1.5, 0.7, -0.5, 1.0), (5.0, 0.7, 6.0, 1.2)]
    world = carved([(-5.0, -0.7, 9.0, 0.7), *rooms, *doors])
    laser = HokuyoTwinConfig(model=model, mixed_pixel_fraction=0.5)
    run = play(world, Pose(-4.0, 0.0, 0.0), twin=TwinConfig(seed=3, laser=laser))
    assert_explored(run)
    assert_found(run, "meetpoint", [(-1.0, 0.0), (5.5, 0.0)])
    assert len(run.vertices("endpoint")) == 4


def test_the_legs_of_a_chair_are_led_round_without_hesitation() -> None:
    """Four legs of 4 cm: between them the robot would just fit, but for the room it needs."""
    canvas = Canvas(9.0, 8.0, resolution=0.02)
    canvas.carve(1.0, 1.0, 8.0, 3.4)
    canvas.carve(6.0, 1.0, 8.0, 7.0)
    for x in (3.5, 3.94):
        for y in (1.98, 2.42):
            canvas.build(x - 0.02, y - 0.02, x + 0.02, y + 0.02)
    run = play(canvas.world("chair"), Pose(2.0, 2.2, 0.0))
    assert_explored(run)
    assert "back off" not in run.recoveries()
    assert max(pose.x for pose in run.truth) > 4.2  # beyond the chair


def legs(*places: tuple[float, float]) -> list[tuple[float, float, float, float]]:
    """Legs of 6 cm."""
    return [(x - 0.03, y - 0.03, x + 0.03, y + 0.03) for x, y in places]


@pytest.mark.parametrize("heading", [0.0, 0.4, -0.4])
def test_a_robot_among_legs_drives_away_from_them_and_does_not_scrape_along(heading: float) -> None:
    """Two centimetres beside a leg; the nearest edge is ahead of it."""
    among = legs((0.05, -0.21), (-0.24, 0.16), (-0.34, 0.06), (-0.07, 0.32))
    world = carved([(-3.0, -2.0, 3.0, 2.0), (3.0, -0.6, 6.0, 0.6)], among)
    run = play(world, Pose(0.0, 0.0, heading), limit=200.0)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert "back off" not in run.recoveries()


@pytest.mark.parametrize("heading", [0.0, 1.5 * math.pi])
def test_a_robot_gets_away_only_over_what_it_knows_to_be_free(heading: float) -> None:
    """Between three legs that it hardly fits through, one of which is always behind it."""
    between = legs((0.12, -0.2), (0.12, 0.25), (-0.25, 0.0))
    world = carved([(-3.0, -2.0, 3.0, 2.0), (3.0, -0.6, 6.0, 0.6)], between)
    run = play(world, Pose(0.0, 0.0, heading), limit=14.0)
    assert {"back off", "turn away"} & set(run.recoveries())
    assert run.contacts == 0


@pytest.mark.parametrize(("gap", "heading"), [(0.39, math.pi / 2), (0.42, 0.0)])
def test_a_robot_between_two_legs_leaves_without_hesitation(gap: float, heading: float) -> None:
    """Nearer to either than it would come by itself, with 18 or 33 mm on each side."""
    between = legs((0.0, gap / 2 + 0.03), (0.0, -gap / 2 - 0.03))
    world = carved([(-3.0, -2.0, 3.0, 2.0), (3.0, -0.6, 6.0, 0.6)], between)
    run = play(world, Pose(0.0, 0.0, heading), limit=120.0)
    assert run.outcome == "explored", run.pipeline.mission.reason
    assert run.contacts == 0
    assert not {"back off", "turn away", "give up a frontier"} & set(run.recoveries())
