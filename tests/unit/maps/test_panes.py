"""Spots of glass and legs of chairs in a room of known walls: expected by geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import AnyScan
from gvgbot.maps.hits import Scans
from gvgbot.maps.occupancy import occupancy_grid
from gvgbot.maps.panes import past_panes
from tests.unit.autonomy.sights import carved, sweep

ROOM = (-4.0, -2.0, 9.0, 2.0)
EMPTY, LEG = carved([ROOM]), carved([ROOM], [(-0.02, 0.48, 0.02, 0.52)])
WALL = carved([ROOM], [(-0.5, 0.48, 0.5, 0.52)])
ALONG = np.array([[-2.0, -0.1], [2.0, -0.1]])  # 0.6 m from the leg
ACROSS, OFF = (np.array([[x, -1.8], [x, 1.8]]) for x in (0.8, 1.6))
AROUND = np.array([[0.8, 0.5], [0.0, 1.3], [-0.8, 0.5], [0.0, -0.3], [0.8, 0.5]])


def looks(world: World, *xs: float) -> Scans:
    """Scans from where the robot drives past."""
    return [(pose, sweep(world, pose)) for pose in (Pose(x, -0.3, 1.2) for x in xs)]


def turned_over(scan: AnyScan) -> Scan:
    """The same beams, clockwise."""
    told = scan.unpacked()
    return replace(told, angle_min=-told.angle_min, angle_increment=-told.angle_increment)


HEAD_ON = (-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3)
ASLANT = (-2.0, -1.5, 1.5, 2.0)


@pytest.mark.parametrize(
    ("shown", "aslant", "is_glass"),
    [
        (LEG, EMPTY, True),
        (LEG, LEG, False),
        (WALL, EMPTY, False),  # as wide as a metre, it is all there
        (EMPTY, EMPTY, False),
    ],
)
def test_a_way_leads_past_glass_close_to_what_is_seen_of_it_head_on(
    shown: World, aslant: World, *, is_glass: bool
) -> None:
    scans = [*looks(aslant, *ASLANT), *looks(shown, *HEAD_ON)]
    grid = occupancy_grid(scans)
    assert past_panes(scans, [ALONG, ACROSS, OFF], grid).tolist() == [False, is_glass, False]
    assert len(past_panes(scans, [], grid)) == 0


@pytest.mark.parametrize(("missed", "is_glass"), [(3, False), (4, True)])
def test_one_look_that_a_leg_is_missed_by_makes_none_of_glass(
    missed: int, *, is_glass: bool
) -> None:
    """Nor do three; four of thirty are few, but four of eleven are not."""
    scans = [*looks(EMPTY, *ASLANT[:missed]), *looks(LEG, *HEAD_ON)]
    assert past_panes(scans, [AROUND], occupancy_grid(scans)).tolist() == [is_glass]
    scans = [*scans, *looks(LEG, *np.arange(-1.0, 1.0, 0.08).tolist())]
    assert not past_panes(scans, [AROUND], occupancy_grid(scans)).any()


@pytest.mark.parametrize("error_m", [0.03, 0.06])
def test_legs_are_none_of_glass_where_poses_err(error_m: float) -> None:
    """Looks from all round it, every third pose too far to the left."""
    scans = []
    for at, angle in enumerate(np.arange(0.0, 2 * math.pi, 0.3)):
        away, aside = np.array([math.cos(angle), math.sin(angle)]), error_m * (at % 3 == 0)
        eye = np.array([0.0, 0.5]) + 0.6 * away
        x, y = eye + aside * np.array([-away[1], away[0]])
        scans.append((Pose(x, y), sweep(LEG, Pose(*eye.tolist()))))
    assert not past_panes(scans, [AROUND], occupancy_grid(scans)).any()


def test_a_leg_that_is_out_of_range_is_none_of_glass() -> None:
    near = looks(LEG, *HEAD_ON)
    far = [(pose, sweep(LEG, pose, reach=3.0)) for pose in (Pose(x, 0.4) for x in (3.5, 4.0) * 5)]
    scans = [*far, *near]
    assert not past_panes(scans, [AROUND], occupancy_grid(scans)).any()


def test_a_leg_is_none_of_glass_to_a_laser_that_hangs_upside_down() -> None:
    """What is to its left is seen in the room that is turned over."""
    hanging = [
        (Pose(pose.x, -pose.y, -pose.theta), turned_over(scan))
        for pose, scan in looks(LEG, *ASLANT, *HEAD_ON)
    ]
    grid = occupancy_grid(hanging)
    assert grid.cells.max() > 90
    assert not past_panes(hanging, [AROUND * [1.0, -1.0]], grid).any()


def test_a_leg_that_lies_between_two_beams_is_none_of_glass() -> None:
    """Eight metres away beams are 4.7 cm from each other."""
    turned = [Pose(8.0, 0.5, math.pi + k * 0.0003) for k in range(60)]
    far = [(pose, sweep(LEG, pose)) for pose in turned]
    missed = [look for look in far if look[1].ranges[530:551].min() > 9.0]
    assert len(missed) > 6
    scans = [*missed, *looks(LEG, *HEAD_ON)]
    assert not past_panes(scans, [AROUND], occupancy_grid(scans)).any()
