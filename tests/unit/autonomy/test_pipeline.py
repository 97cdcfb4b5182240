"""Localisation as published, beside the full one."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.localisation import Localisation
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.hal.messages import Odometry
from tests.unit.autonomy.sights import LASER_270, carved, sweep

ROOMS = carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)])


def driven(localisation: Localisation) -> Pipeline:
    """Two metres straight on, of which odometry feels three per cent less."""
    config = load_config()
    pipeline = Pipeline(
        config.autonomy, config.exploration, config.robot.radius_m, localisation=localisation
    )
    for step, x in enumerate(np.arange(0.0, 2.01, 0.25)):
        stamp = 0.1 * step  # no gap in odometry
        pipeline.control(Odometry(stamp, Pose(0.97 * float(x), 0.0, 0.0), STANDSTILL))
        scan = sweep(ROOMS, Pose(float(x) - 1.5, 0.0, 0.0), field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    return pipeline


def test_as_published_odometry_alone_tells_the_way_between_vertices() -> None:
    pipeline = driven("paper")
    assert pipeline.keyframes[-1].local_base.x == pytest.approx(0.97 * 2.0)
    assert pipeline.keyframes[-1].local_base.y == 0.0


def test_walls_tell_it_better() -> None:
    assert driven("full").keyframes[-1].local_base.x == pytest.approx(2.0, abs=0.03)
