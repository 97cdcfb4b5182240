"""Walls whose place is known, as a laser of some noise shows them."""

import numpy as np
import pytest

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.noisy_walls import NoisyWalls
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import LASER_270, Rectangle, carved, line, sweep

CONFIG = LocalMapConfig(half_width_m=10.0)
ROOM = 0.227  # m
LEG, GAP = 0.06, 0.5  # m, sides of two legs and what is between
HALL: Rectangle = (-4.0, -3.04, 4.0, 3.04)  # walls are not on the borders of cells
LEGS: list[Rectangle] = [(x, GAP / 2, x + LEG, GAP / 2 + LEG) for x in (0.0, 1.2)]
LEGS += [(x0, -y1, x1, -y0) for x0, y0, x1, y1 in LEGS]
PATH = line(-3.0, 0.0, -0.8, 0.0, 0.0, count=10)


def looked(sigma: float, seed: int = 1) -> tuple[NoisyWalls, LocalMap]:
    """What is known after a drive towards two pairs of legs in a hall."""
    world, rng = carved([HALL], LEGS), np.random.default_rng(seed)
    walls, local_map = NoisyWalls(ROOM, CONFIG), LocalMap(CONFIG)
    for pose in PATH:
        scan = sweep(world, pose, field_of_view=LASER_270, sigma=sigma, rng=rng)
        travelled = pose.x - PATH[0].x
        local_map.insert(scan, pose, travelled)
        walls.note(scan, pose.position, local_map, travelled)
    return walls, local_map


def half_gap(points: Array) -> float:
    """Half of the way, m, between the legs of the nearer pair: where the nearest points lie."""
    legs = points[np.abs(points[:, 0] - LEG / 2) < 0.2]
    return float(legs[legs[:, 1] > 0.0, 1].min() - legs[legs[:, 1] < 0.0, 1].max()) / 2


def off_the_wall(points: Array) -> float:
    """How far, m, the farthest point is from the long wall to the left, of those along it."""
    wall = points[(np.abs(points[:, 0]) < 3.0) & (points[:, 1] > 2.0)]
    assert len(wall) > 40
    return float(np.abs(wall[:, 1] - HALL[3]).max())


def test_a_laser_of_usual_noise_shows_walls_as_they_are() -> None:
    walls, local_map = looked(0.01)
    assert walls.drawn(local_map) is local_map


@pytest.mark.parametrize("seed", range(5))
def test_walls_are_thin_for_a_noisy_laser(seed: int) -> None:
    """With a sigma of 3 cm, single readings lie 9 cm off."""
    walls, local_map = looked(0.03, seed)
    assert off_the_wall(local_map.points()) > 0.06
    assert off_the_wall(walls.drawn(local_map).points()) < 0.02


def test_a_gap_between_legs_is_as_wide_for_a_noisy_laser_as_for_another() -> None:
    """A leg's mean hit lies in its middle, or on its face: the gap is GAP, and a leg at most."""
    noisy, raw = [], []
    for seed in range(10):
        walls, local_map = looked(0.03, seed)
        raw.append(half_gap(local_map.points()))
        noisy.append(half_gap(walls.drawn(local_map).points()))
    usual = [half_gap(looked(0.01, seed)[1].points()) for seed in range(10)]
    assert GAP / 2 - 0.01 < np.mean(noisy) < (GAP + LEG) / 2
    assert np.mean(usual) - np.mean(noisy) < 0.5 * (np.mean(usual) - np.mean(raw))


def test_nothing_is_left_out_that_stands_by_itself() -> None:
    """Fewer hits than elsewhere, and no wall beside: a leg far away."""
    walls, local_map = looked(0.03)
    drawn = walls.drawn(local_map).points()
    for x0, y0, x1, y1 in LEGS:
        away = np.hypot(*(drawn - [(x0 + x1) / 2, (y0 + y1) / 2]).T)
        assert away.min() < LEG


def test_one_noisy_scan_among_others_does_not_count() -> None:
    walls, local_map = looked(0.01)
    rng, here = np.random.default_rng(3), Pose(0.0, 0.0, 0.0)
    noisy = sweep(carved([HALL]), here, sigma=0.03, rng=rng)
    walls.note(noisy, here.position, local_map, 3.0)
    assert walls.drawn(local_map) is local_map


def test_a_laser_that_becomes_noisy_is_found_out() -> None:
    walls, local_map = looked(0.01)
    rng, here = np.random.default_rng(3), Pose(0.0, 0.0, 0.0)
    for _ in range(10):
        walls.note(sweep(carved([HALL]), here, sigma=0.03, rng=rng), here.position, local_map, 3.0)
    assert walls.drawn(local_map) is not local_map
