"""A robot that was pushed: found where the walls tell it from all around, and nowhere else."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.near_by import Fit, misplaced, walls_known, walls_seen
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose, wrap_angle
from gvgbot.hal.packed_scan import PackedScan
from tests.unit.autonomy.sights import LASER_270, carved, sweep

BEND = carved([(-6.0, -1.0, 6.0, 1.0), (2.0, 1.0, 3.5, 6.0)])
CORRIDOR = carved([(-30.0, -1.0, 30.0, 1.0)])
# the same every metre
NICHES = carved([(-20.0, -1.0, 20.0, 1.0), *((i, 1.0, i + 0.5, 1.4) for i in range(-20, 20))])
HERE = Pose(0.5, 0.1, 0.4)


def keyframe(world: World, pose: Pose, field_of_view: float = LASER_270) -> Keyframe:
    """A look from a pose of the world, where its frame is that of the map and the local one."""
    scan = sweep(world, pose, field_of_view=field_of_view, reach=10.0)
    return Keyframe(0.0, pose, pose, pose, PackedScan(scan))


def found(world: World, believed: Pose) -> Fit | None:
    """Where a robot that stands here is, after scans of the map from beside."""
    config = AutonomyConfig()
    mapper = Mapper(config.mapping, config.recognition, config.scan_matching)
    mapper.move(believed, 0.01 * np.eye(3))
    old = [
        keyframe(world, Pose(x, -0.2, turn))
        for x in (-4.0, -1.0, 2.0, 5.0)
        for turn in (0.0, math.pi)
    ]
    seen = [keyframe(world, HERE.compose(Pose(theta=turn))) for turn in (0.0, 2.0, 4.0)]
    walls = walls_known(mapper, old)
    return misplaced(walls_seen(seen, HERE), walls, believed, ScanMatchingConfig())


@pytest.mark.parametrize(
    "off", [(0.3, 0.0, 0.0), (-0.7, 0.0, 0.2), (0.1, -0.7, 0.0), (0.9, 0.4, -0.3)]
)
def test_who_was_pushed_is_found_by_the_walls_of_the_map(off: tuple[float, float, float]) -> None:
    fit = found(BEND, HERE.compose(Pose(*off)))
    assert fit is not None
    assert fit.is_clear
    assert fit.map_base.distance(HERE) < 0.03
    assert abs(wrap_angle(fit.map_base.theta - HERE.theta)) < 0.01


def test_who_is_about_where_it_believes_to_be_is_left_there() -> None:
    assert found(BEND, HERE.compose(Pose(0.03, -0.03, 0.01))) is None


@pytest.mark.parametrize("world", [CORRIDOR, NICHES])
def test_where_walls_look_the_same_in_other_places_nothing_is_clear(world: World) -> None:
    fit = found(world, HERE.compose(Pose(0.6, 0.3, 0.0)))
    assert fit is not None
    assert not fit.is_clear


def test_walls_that_the_map_does_not_know_place_nobody() -> None:
    config = ScanMatchingConfig()
    seen = walls_seen([keyframe(CORRIDOR, HERE)], HERE)
    elsewhere = walls_seen([keyframe(BEND, Pose(2.7, 5.0))], Pose(2.7, 5.0))
    assert misplaced(seen, elsewhere, HERE, config) is None
    assert misplaced(seen[:0], elsewhere, HERE, config) is None
