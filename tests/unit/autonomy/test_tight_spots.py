"""Walls give way where the robot has been, and nowhere else."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.autonomy.tight_spots import TightSpots
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import LASER_270, carved, sweep

RADIUS, MARGIN, MEMORY = 0.17, 0.05, 10.0  # m
ROOM = RADIUS + MARGIN


class Walls:
    """A space that is known all over."""

    def __init__(self, points: Array) -> None:
        self._points = points

    def points(self) -> Array:
        return self._points

    def known(self, points: Array) -> NDArray[np.bool_]:
        return np.ones(points.shape[:-1], bool)


def two_rooms(gap: float) -> Walls:
    """Two rooms of 4 by 4 m beside each other, and a gap in the wall of 0.1 m between them."""
    along, across = np.arange(-4.0, 4.01, 0.1), np.arange(-2.0, 2.01, 0.1)
    beyond = np.arange(gap / 2, 2.0, 0.1)
    pieces = [np.column_stack([along, np.full_like(along, y)]) for y in (-2.0, 2.0)]
    pieces += [np.column_stack([np.full_like(across, x), across]) for x in (-4.0, 4.0)]
    pieces += [
        np.column_stack([np.full_like(beyond, x), side * beyond])
        for x in (-0.05, 0.05)
        for side in (-1.0, 1.0)
    ]
    return Walls(np.concatenate(pieces))


def driven(metres: float, walls: Walls) -> TightSpots:
    """After so many metres from 1 m before the gap on, 3 cm beside its middle."""
    spots = TightSpots(RADIUS, MARGIN, MEMORY)
    for x in np.arange(-1.0, metres - 1.0 + 1e-9, 0.25):
        spots.note(np.array([x, 0.03]), walls.points(), float(x))
    return spots


def reaches_beyond(spots: TightSpots, walls: Walls) -> bool:
    """Whether the graph of the first room goes on into the other one."""
    graph = fine_graph(
        spots.eased(walls), np.array([-1.0, 0.0]), min_clearance=ROOM, roughness=0.03
    )
    return bool((graph.points[:, 0] > 1.0).any())


@pytest.mark.parametrize("gap", [0.38, 0.40, 0.42])
def test_a_gap_that_the_robot_came_through_is_open_however_narrow_it_looks(gap: float) -> None:
    walls = two_rooms(gap)
    assert not reaches_beyond(TightSpots(RADIUS, MARGIN, MEMORY), walls)
    assert not reaches_beyond(driven(0.5, walls), walls)
    assert reaches_beyond(driven(2.0, walls), walls)


def test_what_has_come_to_where_the_robot_was_closes_the_gap() -> None:
    """A door that has been shut behind it."""
    before, door = two_rooms(0.42), np.arange(-0.2, 0.21, 0.05)
    spots = driven(2.0, before)
    shut = np.concatenate([before.points(), np.column_stack([np.zeros_like(door), door])])
    assert not reaches_beyond(spots, Walls(shut))


def test_no_wall_comes_nearer_and_none_gives_way_by_more_than_the_robot_needs() -> None:
    walls = two_rooms(0.40)
    eased = driven(2.0, walls).eased(walls).points()
    moved = np.hypot(*(eased - walls.points()).T)
    assert 0.0 < moved.max() < 0.06
    away = np.hypot(*(eased - [0.0, 0.03]).T)
    assert away.min() >= ROOM
    assert (away >= np.hypot(*(walls.points() - [0.0, 0.03]).T) - 1e-9).all()


def test_where_there_is_room_nothing_is_remembered() -> None:
    walls = two_rooms(0.8)
    assert driven(2.0, walls).eased(walls) is walls


def test_a_spot_is_forgotten_when_the_robot_has_driven_on() -> None:
    walls = two_rooms(0.40)
    spots = driven(2.0, walls)
    spots.note(np.array([2.0, 0.0]), walls.points(), 1.0 + MEMORY)
    assert not reaches_beyond(spots, walls)


@pytest.mark.parametrize("sigma", [0.01, 0.02, 0.03])
def test_a_noisy_laser_shows_a_gap_as_wide_as_it_needs_to_be(sigma: float) -> None:
    """Halfway past a door of 0.56 m; half its width, less the margin of 5 cm, has to be there."""
    world = carved([(-5.0, -0.8, 5.0, 0.8), (-0.28, 0.7, 0.28, 1.2), (-2.0, 0.9, 2.0, 3.5)])
    stations = [Pose(float(x), 0.0, 0.0) for x in np.arange(-3.0, -0.4, 0.25)]
    to_spare = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        local_map, local_world = LocalMap(LocalMapConfig()), Pose(*rng.uniform(-0.5, 0.5, 3))
        scans = [
            sweep(world, pose, field_of_view=LASER_270, sigma=sigma, rng=rng) for pose in stations
        ]
        for pose, scan in zip(stations, scans, strict=True):
            local_map.insert(scan, local_world.compose(pose), pose.x)
        walls = local_world.inverse().transform(local_map.points())
        jambs = walls[(np.abs(walls[:, 0]) < 0.6) & (np.abs(walls[:, 1] - 0.85) < 0.2)]
        left, right = jambs[jambs[:, 0] < 0], jambs[jambs[:, 0] > 0]
        least = TightSpots(RADIUS, MARGIN, MEMORY).least_clearance(scans[-1])
        to_spare.append(cdist(left, right).min() / 2 - least - (0.28 - ROOM))
    assert -0.02 < np.mean(to_spare) < 0.02
