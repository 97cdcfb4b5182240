import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.swing import Swing, how_to_place, how_to_turn
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import LASER_270, carved, sweep

ROOM = carved([(-3.0, -1.5, 2.0, 2.5)])
CORRIDOR = carved([(-20.0, -1.0, 20.0, 1.0)])


def turned(
    by: float = 1.0,
    *,
    world: World = ROOM,
    true: Pose | None = None,
    said: Pose | None = None,
    turns: int = 5,
    seed: int = 4,
) -> Swing:
    """What a base learns on the spot that turns so many times as far as it tells.

    Its laser is at a `true` pose, and `said` to be at another one.
    """
    rng, swing = np.random.default_rng(seed), Swing(ScanMatchingConfig())
    for k in range(turns + 1):
        world_base = Pose(-1.0, 0.1, by * 0.26 * k)
        seen_from = world_base.compose(true or Pose())
        scan = sweep(world, seen_from, field_of_view=LASER_270, sigma=0.01, rng=rng)
        swing.note(replace(scan, base_laser=said or Pose()), Pose(theta=0.26 * k))
        if swing.place is not None or swing.stretch is not None:
            break  # it stands then
    return swing


@pytest.mark.parametrize("world", [ROOM, CORRIDOR])
@pytest.mark.parametrize("by", [0.5, 0.8, 1.25, 1.6])
def test_who_turns_farther_than_its_gyro_tells_learns_how_much(by: float, world: World) -> None:
    stretch = turned(by, world=world).stretch
    assert stretch is not None
    assert stretch == pytest.approx(by, rel=0.02)
    assert f"turns {by:.2f} times" in how_to_turn(stretch)


@pytest.mark.parametrize(
    ("true", "said"),
    [
        (Pose(), Pose(0.3, 0.0)),
        (Pose(0.0, -0.2), Pose()),
        (Pose(-0.1, 0.1, 0.5), Pose(0.1, 0.3, 0.5)),
    ],
)
def test_a_laser_that_swings_round_another_point_is_not_where_it_is_said_to_be(
    true: Pose, said: Pose
) -> None:
    swing = turned(true=true, said=said)
    assert swing.stretch is None
    assert swing.place is not None
    x, y = np.round(said.position - np.array(swing.place), 2) + 0.0
    assert math.hypot(x - true.x, y - true.y) < 0.05
    scan = replace(sweep(ROOM, Pose()), base_laser=said)
    assert f"set laser.x_m: {x:.2f} and laser.y_m: {y:.2f}, " in how_to_place(scan, swing.place)


@pytest.mark.parametrize("world", [ROOM, CORRIDOR])
@pytest.mark.parametrize(("by", "off_m"), [(1.0, 0.0), (1.1, 0.08)])
def test_who_turns_as_it_should_or_nearly_so_is_left_alone(
    by: float, off_m: float, world: World
) -> None:
    swing = turned(by, world=world, said=Pose(off_m))
    assert swing.stretch is None
    assert swing.place is None


@pytest.mark.parametrize("seed", range(6))
def test_a_base_that_stands_while_its_wheels_spin_has_not_swung(seed: int) -> None:
    swing = turned(0.0, turns=12, seed=seed)
    assert swing.stretch is None
    assert swing.place is None
