"""Gaps in what a robot has seen of buildings of known walls."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from gvgbot.drivers.world import World
from gvgbot.geometry import STANDSTILL, Array, Pose
from gvgbot.hal.messages import Odometry
from gvgbot.survey import survey
from tests.unit.autonomy.sights import carved, sweep

START = Pose(-3.0, 0.0, 0.0)  # in the world; the map begins there
CORRIDOR, SIDE = (-4.0, -1.0, 4.0, 1.0), (2.0, -1.0, 4.0, 4.0)


def places_after(world: World, metres: float) -> Array:
    """What a survey finds (N, 2), world frame, after so long a drive straight on."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for step, x in enumerate(np.arange(0.0, metres + 0.01, 0.25)):
        odom_base = Pose(float(x), 0.0, 0.0)
        pipeline.control(Odometry(0.1 * step, odom_base, STANDSTILL))
        pipeline.perceive(replace(sweep(world, START.compose(odom_base)), stamp=0.1 * step))
    return START.transform(survey(pipeline))


def test_nothing_is_missing_of_what_can_be_seen_from_one_end() -> None:
    assert len(places_after(carved([CORRIDOR]), 1.0)) == 0


def test_what_lies_in_the_shadow_of_a_corner_is_a_gap_until_the_robot_looks_round_it() -> None:
    """Seen from the origin, the shadow begins between (2, 1) and (4, 2): halfway at (3, 1.5)."""
    building = carved([CORRIDOR, SIDE])
    (place,) = places_after(building, 3.0)
    assert place == pytest.approx([3.0, 1.5], abs=0.3)
    assert len(places_after(building, 6.0)) == 0
