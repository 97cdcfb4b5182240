"""What a laser sees where there is glass, against the geometry of one pane before a wall."""

import math

import numpy as np
import pytest

from gvgbot.drivers.people import People, Walkways
from gvgbot.drivers.sight import Sight
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from gvgbot.worlds.canvas import Canvas

PANE, WALL = 4.0, 8.0  # m along x
EYE = Pose(2.0, 10.0, 0.0)
LOOKS = 400


def glazed(turned: bool = False) -> World:
    """A pane at x = 4 m, a wall at x = 8 m, both across; turned, at such y instead."""
    canvas = Canvas(9.0, 20.0)
    canvas.carve(0.5, 0.5, PANE, 19.5)
    canvas.carve(PANE + 0.1, 0.5, WALL, 19.5)
    canvas.glaze(PANE, 0.5, PANE + 0.1, 19.5)
    world = canvas.world("glazed")
    assert world.glass is not None
    if not turned:
        return world
    return World(world.occupied.T.copy(), world.resolution_m, glass=world.glass.T.copy())


def echo_shares(world: World, pose: Pose, bearings: Array) -> Array:
    """How often each beam (N,) comes back from the pane; all others come from the wall."""
    sight, normal = Sight(world, None, seed=5), np.cos(bearings)
    at_pane, at_wall = (PANE - 2.0) / normal, (WALL - 2.0) / normal
    echoes = np.zeros(len(bearings))
    for _ in range(LOOKS):
        ranges = sight.look(pose, bearings, 100.0)
        is_echo = np.isclose(ranges, at_pane, rtol=1e-9)
        assert (is_echo | np.isclose(ranges, at_wall, rtol=1e-9)).all()
        echoes += is_echo
    return echoes / LOOKS


@pytest.mark.parametrize("turned", [False, True])
def test_glass_is_seen_head_on_and_seen_through_from_the_side(turned: bool) -> None:
    bearings = np.deg2rad([-50.0, -30.0, 0.0, 5.0, 30.0, 50.0])
    pose = Pose(EYE.y, EYE.x, math.pi / 2) if turned else EYE
    left, left_too, ahead, nearly, right, right_too = echo_shares(glazed(turned), pose, bearings)
    assert min(ahead, nearly) > 0.8
    assert max(left, left_too, right, right_too) < 0.2
    assert max(left, right_too) > 0.0  # dust


def test_glass_is_seen_the_less_the_more_it_is_turned_away() -> None:
    bearings = np.deg2rad([0.0, 9.0, 14.0, 22.0])
    shares = echo_shares(glazed(), EYE, bearings)
    assert (np.diff(shares) < 0.0).all()


def test_without_glass_all_is_as_the_walls_are() -> None:
    canvas = Canvas(9.0, 9.0)
    canvas.carve(0.5, 0.5, 8.5, 8.5)
    world, bearings = canvas.world("room"), np.linspace(-2.0, 2.0, 400)
    pose = Pose(3.0, 4.0, 1.0)
    seen = Sight(world, None, seed=1).look(pose, bearings, 5.0)
    assert np.array_equal(seen, world.cast(pose, bearings, 5.0))


def test_equal_seeds_see_alike() -> None:
    bearings = np.linspace(-1.0, 1.0, 200)
    first, second, other = (
        Sight(glazed(), None, seed).look(EYE, bearings, 100.0) for seed in (1, 1, 2)
    )
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


def test_a_wall_behind_glass_is_seen_no_farther_than_the_laser_reaches() -> None:
    ranges = Sight(glazed(), None, seed=1).look(EYE, np.deg2rad(np.linspace(40, 50, 50)), 6.0)
    assert np.isinf(ranges).sum() > 40  # behind the pane all is more than 7.8 m away


def test_a_person_is_seen_behind_glass_or_hidden_by_it_and_not_beyond_the_reach() -> None:
    world = glazed()
    people = People(Walkways(world, Pose(6.0, 10.0, 0.0)), 1, seed=1)
    oblique = math.radians(45.0)
    people.centres[0] = (2.0 + 4.0, 10.0 + 4.0)
    distance = 4.0 * math.sqrt(2) - people.radii[0]
    sight = Sight(world, people, seed=1)
    beams = np.full(1000, oblique)
    seen = sight.look(EYE, beams, 100.0)
    is_person, is_pane = np.isclose(seen, distance), np.isclose(seen, 2.0 * math.sqrt(2))
    assert (is_person | is_pane).all()
    assert is_person.mean() > 0.9
    too_far = sight.look(EYE, beams, distance - 0.1)
    assert (np.isinf(too_far) | (too_far < distance - 0.2)).all()
