"""A laser that is turned on its mount has the base drive aside."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.aim import Aim, how_to_aim
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose, wrap_angle
from tests.unit.autonomy.sights import LASER_270, carved, sweep

ROOMS = carved([(-4.0, -1.5, 8.0, 1.5), (1.0, 1.5, 3.0, 3.0)])
HALL = carved([(-12.0, -12.0, 4.0, 12.0)])  # of which the wall ahead is near
WORN = 0.04  # rad/m, by which wheels of unequal size turn the base


def driven(
    turned_deg: float,
    *,
    said_deg: float = 0.0,
    pieces: int = 8,
    step_m: float = 0.25,
    comes_on: float = 1.0,
    aim: Aim | None = None,
    world: World = ROOMS,
    seed: int = 4,
) -> Aim:
    """What a base learns that drives ahead, with its laser so far from where it is said to look.

    It comes on by this share of what its wheels tell.
    """
    rng, aim = np.random.default_rng(seed), aim or Aim(ScanMatchingConfig())
    world_base = Pose(-1.0, 0.1, -0.03)
    for k in range(pieces):
        seen_from = world_base.compose(Pose(theta=math.radians(said_deg - turned_deg)))
        scan = sweep(world, seen_from, field_of_view=LASER_270, sigma=0.01, rng=rng)
        scan = replace(scan, base_laser=Pose(theta=math.radians(said_deg)))
        aim.note(scan, Pose(step_m * k, 0.0, 0.0))
        metres, turn = comes_on * step_m, WORN * comes_on * step_m
        world_base = world_base.compose(Pose(metres, metres * turn / 2, turn))
    return aim


@pytest.mark.parametrize("said_deg", [0.0, 30.0])
@pytest.mark.parametrize("turned_deg", [-90.0, -40.0, -5.0, 5.0, 20.0, 90.0, 180.0])
def test_who_drives_aside_learns_by_how_much_its_laser_is_turned(
    turned_deg: float, said_deg: float
) -> None:
    aim = driven(turned_deg, said_deg=said_deg)
    assert aim.off is not None
    assert math.degrees(aim.off) == pytest.approx(turned_deg, abs=1.0)
    scan = replace(sweep(ROOMS, Pose()), base_laser=Pose(theta=math.radians(said_deg)))
    told = how_to_aim(scan, math.radians(turned_deg))
    to_set = math.degrees(wrap_angle(math.radians(said_deg - turned_deg)))
    assert f"set laser.yaw_deg: {to_set:.0f}, " in told


@pytest.mark.parametrize("turned_deg", [0.0, -1.0, 1.0])
def test_a_laser_that_looks_as_it_is_said_to_is_left_alone(turned_deg: float) -> None:
    aim = driven(turned_deg)
    assert aim.off is None
    assert driven(20.0, aim=aim).off is None


def test_sweeps_that_follow_each_other_closely_tell_no_less() -> None:
    aim = driven(5.0, pieces=80, step_m=0.02)
    assert aim.off is not None
    assert math.degrees(aim.off) == pytest.approx(5.0, abs=1.0)


def driven_round(turned_deg: float, *, side: float, beside: Pose | None = None) -> Aim:
    """What a base learns on a circle, with its laser turned, or beside its place, by so much."""
    rng, aim = np.random.default_rng(4), Aim(ScanMatchingConfig())
    mount = (beside or Pose()).compose(Pose(theta=-math.radians(turned_deg)))
    step = Pose(0.25, side * 0.25 * 0.15, side * 0.3)  # along a chord
    odom_base = Pose()
    for _ in range(4):
        seen_from = Pose(-1.0, 0.1, -0.03).compose(odom_base).compose(mount)
        aim.note(sweep(ROOMS, seen_from, field_of_view=LASER_270, sigma=0.01, rng=rng), odom_base)
        odom_base = odom_base.compose(step)
    return aim


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("turned_deg", [-90.0, -40.0, 60.0, 180.0])
def test_one_that_looks_quite_elsewhere_is_found_out_on_three_pieces_of_a_curve(
    turned_deg: float, side: float
) -> None:
    off = driven_round(turned_deg, side=side).off
    assert off is not None
    assert math.degrees(off) == pytest.approx(turned_deg, abs=3.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("beside", [Pose(), Pose(0.15), Pose(-0.15), Pose(0.0, 0.15)])
def test_one_that_is_a_little_beside_its_place_is_not_accused_on_a_curve(
    beside: Pose, side: float
) -> None:
    assert driven_round(0.0, side=side, beside=beside).off is None


def test_a_base_that_stands_while_its_wheels_spin_has_not_driven_aside() -> None:
    told = [driven(0.0, pieces=12, comes_on=0.0, seed=seed).off for seed in range(8)]
    assert told == 8 * [None]


@pytest.mark.parametrize("turned_deg", [0.0, 20.0])
def test_a_wall_ahead_does_not_tell_what_is_driven_aside(turned_deg: float) -> None:
    assert driven(turned_deg, world=HALL).off is None


def test_a_way_that_leaves_it_open_is_watched_no_longer_than_forty_pieces() -> None:
    aim = driven(2.25)
    for _ in range(8):
        aim = driven(2.25, aim=aim)
    assert driven(20.0, aim=aim).off is None


def test_four_pieces_of_a_way_are_too_few() -> None:
    assert driven(5.0, pieces=5).off is None
    assert driven(5.0, pieces=6).off is not None
