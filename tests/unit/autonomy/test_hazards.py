"""Where an obstacle lies that was only felt, and for how long it is remembered."""

import math

import numpy as np

from gvgbot.autonomy.hazards import HazardConfig, Hazards
from gvgbot.geometry import Pose

RADIUS = 0.177  # m
MEMORY = HazardConfig().memory_m


def felt(hazards: Hazards, x: float, travelled: float, *, lasting: bool = False) -> bool:
    return hazards.add(Pose(x, 0.0, 0.0), [0.0], RADIUS, travelled, lasting=lasting)


def test_it_lies_just_beyond_the_rim_on_the_side_that_felt_it() -> None:
    hazards = Hazards(HazardConfig())
    hazards.add(Pose(1.0, 2.0, math.pi / 2), [math.radians(55)], RADIUS, 0.0, lasting=False)
    away = np.hypot(*(hazards.points - [1.0, 2.0]).T)
    assert ((away > RADIUS) & (away < RADIUS + 0.05)).all()
    assert (hazards.points[:, 0] < 1.0).all()  # left of who looks north is west
    assert (hazards.points[:, 1] > 2.0).all()


def test_it_is_forgotten_some_metres_later() -> None:
    hazards = Hazards(HazardConfig())
    felt(hazards, 0.0, 10.0)
    hazards.forget(10.0 + MEMORY - 0.1)
    assert len(hazards.points)
    hazards.forget(10.0 + MEMORY + 0.1)
    assert len(hazards.points) == 0


def test_felt_twice_at_one_place_it_is_kept_and_no_longer_doubted() -> None:
    hazards = Hazards(HazardConfig())
    felt(hazards, 0.0, 0.0)
    assert len(hazards.doubtful)
    felt(hazards, 0.1, 5.0)
    assert len(hazards.doubtful) == 0
    hazards.forget(10 * MEMORY)
    assert len(hazards.points)


def test_felt_at_two_places_far_apart_both_are_forgotten() -> None:
    hazards = Hazards(HazardConfig())
    felt(hazards, 0.0, 0.0)
    felt(hazards, 2.0, 2.0)
    hazards.forget(10 * MEMORY)
    assert len(hazards.points) == 0


def test_a_cliff_is_never_forgotten() -> None:
    hazards = Hazards(HazardConfig())
    felt(hazards, 0.0, 0.0, lasting=True)
    hazards.forget(1e6)
    assert len(hazards.points)


def test_three_hits_within_a_metre_block_the_way() -> None:
    hazards = Hazards(HazardConfig())
    assert not felt(hazards, 0.0, 0.0)
    assert not felt(hazards, 0.5, 1.0)
    assert not felt(hazards, 5.0, 6.0)  # elsewhere
    assert felt(hazards, 0.9, 10.0)


def test_who_goes_on_in_another_frame_keeps_both_ones_hazards() -> None:
    """The other one began to count after 100 m, at (3, 0) in the own frame, turned to the left."""
    own, other = Hazards(HazardConfig()), Hazards(HazardConfig())
    felt(own, 0.0, 95.0)
    felt(other, 5.0, 2.0)
    (before,), (theirs,) = own.felt, other.felt
    there, here = before.points.copy(), theirs.points.copy()
    own.take_over(other, Pose(3.0, 0.0, math.pi / 2).inverse(), 100.0)
    x, y = there.T
    np.testing.assert_allclose(own.felt[0].points, np.stack([y, 3.0 - x], axis=1), atol=1e-12)
    np.testing.assert_allclose(own.felt[1].points, here)
    own.forget(101.0 + MEMORY)  # 95 is too long ago, 102 is not
    assert own.felt == [theirs]
