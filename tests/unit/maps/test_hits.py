"""What scans hit in buildings of known walls: expected by geometry."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.maps.hits import Scans, barred, hits
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


def test_it_is_told_how_often_and_how_long_a_post_was_in_sight() -> None:
    """When nobody has looked for more than five seconds, it may be another one."""
    scans = [
        (pose, replace(sweep(world, pose), stamp=stamp))
        for world, pose, stamp in (
            (WALLED, Pose(0.0), 1.0),
            (POST, Pose(0.0), 2.0),
            (POST, Pose(0.5), 5.0),
            (POST, Pose(1.0), 9.0),
            (WALLED, Pose(1.0), 10.0),
            (POST, Pose(1.0), 30.0),
        )
    ]
    seen = hits(scans, np.array([[2.0, 0.5], [-2.0, 0.0]]), 0.3)
    assert seen.looks.tolist() == [4, 0]
    assert seen.seconds.tolist() == [7.0, 0.0]
