"""What scans hit in buildings of known walls: expected by geometry."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.maps.hits import Scans, barred, hits, stood_s
from gvgbot.maps.occupancy import occupancy_grid
from tests.unit.autonomy.sights import carved, sweep

WALLED = carved([(-4.0, -1.0, 4.0, 1.0), (-4.0, 1.2, 4.0, 3.0)])  # a corridor, and a room
OPEN = carved([(-4.0, -1.0, 4.0, 3.0)])  # as seen through the wall
POST = carved([(-4.0, -1.0, 4.0, 1.0)], [(1.9, 0.4, 2.1, 0.6)])
ACROSS, ALONG = np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([[-3.0, 0.0], [3.0, 0.0]])
NOWHERE = np.empty((0, 2))


def seen_from(*xs: float) -> Scans:
    """Scans from the middle of the corridor."""
    return [(pose, sweep(WALLED, pose)) for pose in (Pose(x) for x in xs)]


@pytest.mark.parametrize(
    ("xs", "driven", "later", "is_barred"),
    [
        ((-1.0, 0.0, 1.0), NOWHERE, OPEN, True),
        ((-1.0, 1.0), NOWHERE, OPEN, False),  # somebody may have stood there
        ((-1.0, 0.0, 1.0), np.array([[0.0, 0.9], [0.0, 1.1]]), OPEN, False),  # as the robot passed
        ((-1.0, 0.0, 1.0), NOWHERE, WALLED, False),  # the line is beside where the edge leads
    ],
)
def test_a_way_over_floor_that_was_a_wall_in_three_looks_is_barred(
    xs: tuple[float, ...], driven: Array, later: World, is_barred: bool
) -> None:
    grid = occupancy_grid([(pose, sweep(later, pose)) for pose in (Pose(-1.0), Pose(1.0))])
    assert barred(seen_from(*xs), [ALONG, ACROSS], grid, driven).tolist() == [False, is_barred]


def test_without_ways_none_is_barred() -> None:
    grid = occupancy_grid([])
    assert len(barred(seen_from(0.0), [], grid, NOWHERE)) == 0


def seen_at(*looks: tuple[World, float, float]) -> Scans:
    """Scans of worlds from points of the middle line, x, m, at their stamps, s."""
    return [(Pose(x), replace(sweep(world, Pose(x)), stamp=stamp)) for world, x, stamp in looks]


PLACES = np.array([[2.0, 0.5], [-2.0, 0.0]])  # of the post, and of nothing
CAME = (WALLED, 0.0, 1.0), (POST, 0.0, 2.0), (POST, 0.5, 5.0), (POST, 1.0, 9.0)


def test_it_is_told_how_many_scans_hit_a_post() -> None:
    assert hits(seen_at(*CAME), PLACES, 0.3).tolist() == [3, 0]


def test_who_is_found_where_he_stood_has_stood_there_all_the_time() -> None:
    assert stood_s(seen_at(*CAME), PLACES, 0.3).tolist() == [7.0, 0.0]
    again = (POST, 0.5, 130.0)
    assert stood_s(seen_at(*CAME, again), PLACES, 0.3).tolist() == [128.0, 0.0]


def test_who_stands_where_somebody_has_gone_has_not_stood_there_before() -> None:
    gone, other = (WALLED, 1.0, 60.0), ((POST, 0.5, 130.0), (POST, 0.0, 140.0))
    assert stood_s(seen_at(*CAME, gone, *other), PLACES, 0.3).tolist() == [10.0, 0.0]
    assert stood_s(seen_at(*CAME, gone), PLACES, 0.3).tolist() == [0.0, 0.0]


def test_where_the_clock_began_anew_the_time_does_as_well() -> None:
    again = (POST, 0.5, 1.0), (POST, 0.0, 4.0)
    assert stood_s(seen_at(*CAME, *again), PLACES, 0.3).tolist() == [3.0, 0.0]


def test_the_wall_behind_somebody_is_not_somebody() -> None:
    """He stands 0.4 m before it, beside which a scan sees that he is not there."""
    near = np.array([[2.0, 0.6]])
    came = *((WALLED, 0.0, t) for t in (0.0, 1.0)), *((POST, 0.0, t) for t in (130.0, 132.0))
    assert stood_s(seen_at(*came), near, 0.45).tolist() == [2.0]
    gone = *came, (WALLED, 0.5, 300.0), (POST, 0.0, 400.0), (POST, 0.0, 401.0)
    assert stood_s(seen_at(*gone), near, 0.45).tolist() == [1.0]


def test_a_laser_off_the_middle_of_the_base_sees_through_as_well() -> None:
    scans = [
        (
            pose.compose(Pose(-0.4, 0.3, 0.5).inverse()),
            replace(scan.unpacked(), base_laser=Pose(-0.4, 0.3, 0.5)),
        )
        for pose, scan in seen_at(*CAME, (WALLED, 1.0, 60.0), (POST, 0.5, 130.0))
    ]
    assert stood_s(scans, PLACES, 0.3).tolist() == [0.0, 0.0]
