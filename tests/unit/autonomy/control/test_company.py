"""Robots that meet: two discs with brakes on a plane, and junctions drawn by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.control.company import (
    Companion,
    careful,
    free_metres,
    in_front,
    patience,
    refuge,
    way_off,
    wide_place,
)
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.geometry import Array, Pose, Twist
from tests.unit.autonomy.local_graphs import drawn

RADIUS = 0.177  # m
FULL, SLOW = 0.6, 0.15  # m/s
BRAKE, CYCLE = 1.0, 0.02  # m/s^2, s
LEAST_GAP = 0.1  # m between two bodies

# A corridor from west to east with a side branch to the south at x = 3.
TEE = drawn(
    {1: (-3.0, 0.0), 2: (3.0, 0.0), 3: (8.0, 0.0), 4: (3.0, -4.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
)


class Disc:
    """A robot that drives straight on at full speed, as far as care lets it."""

    def __init__(self, pose: Pose) -> None:
        self.pose, self.speed = pose, FULL

    def drive(self, other: Array) -> None:
        """One cycle by what it knows of where the other one is."""
        seen = self.pose.inverse().transform(other)
        wish = careful(Twist(FULL, 0.0), [(seen, RADIUS)], RADIUS, SLOW).linear
        self.speed = max(wish, self.speed - BRAKE * CYCLE)
        self.pose = self.pose.compose(Pose(self.speed * CYCLE, 0.0, 0.0))


def least_gap(one: Disc, two: Disc, *, told_every: int) -> float:
    """Between both in half a minute, told only now and then where the other is."""
    gaps, told = [], (one.pose.position, two.pose.position)
    for cycle in range(round(30.0 / CYCLE)):
        if cycle % told_every == 0:
            told = one.pose.position, two.pose.position
        one.drive(told[1])
        two.drive(told[0])
        gaps.append(one.pose.distance(two.pose) - 2 * RADIUS)
    return min(gaps)


@pytest.mark.parametrize("aside", [0.0, 0.1, 0.2, 0.3, 0.4])
@pytest.mark.parametrize("told_every", [1, 10])
def test_two_that_drive_at_each_other_keep_apart(aside: float, told_every: int) -> None:
    one, two = Disc(Pose(0.0, 0.0, 0.0)), Disc(Pose(6.0, aside, math.pi))
    assert least_gap(one, two, told_every=told_every) >= LEAST_GAP


@pytest.mark.parametrize("bearing", [0.5, 1.0, 1.57, 2.2])
def test_two_whose_ways_cross_keep_apart(bearing: float) -> None:
    two = Disc(Pose(4.0, 0.0, bearing).compose(Pose(-4.0, 0.0, 0.0)))
    assert least_gap(Disc(Pose()), two, told_every=10) >= LEAST_GAP


@pytest.mark.parametrize(("gap", "drives"), [(0.14, True), (0.12, False)])
def test_who_stands_beside_another_one_drives_on_unless_it_is_too_near(
    gap: float, drives: bool
) -> None:
    beside = np.array([0.05, 2 * RADIUS + gap])
    twist = careful(Twist(FULL, 0.0), [(beside, RADIUS)], RADIUS, SLOW)
    assert (twist.linear > 0.0) == drives


def test_two_with_room_between_them_pass_each_other_slowly() -> None:
    one, two = Disc(Pose(0.0, 0.0, 0.0)), Disc(Pose(6.0, 2 * RADIUS + 0.25, math.pi))
    speeds = []
    for _ in range(round(30.0 / CYCLE)):
        here, there = one.pose.position, two.pose.position
        one.drive(there)
        two.drive(here)
        speeds.append(one.speed)
    assert one.pose.x > 6.0
    assert two.pose.x < 0.0
    assert SLOW <= min(speeds) < 0.3


def test_who_is_behind_or_far_away_holds_nobody_up() -> None:
    twist = Twist(FULL, 0.3)
    for place in ((-0.6, 0.0), (-0.5, 0.3), (5.0, 0.0)):
        assert careful(twist, [(np.array(place), RADIUS)], RADIUS, SLOW) == twist


def test_a_slower_robot_stays_on_its_arc_and_may_turn_where_it_stands() -> None:
    wish = Twist(FULL, 0.4)
    slower = careful(wish, [(np.array([1.2, 0.1]), RADIUS)], RADIUS, SLOW)
    assert 0.0 < slower.linear < FULL
    assert slower.angular / slower.linear == pytest.approx(0.4 / FULL)
    stopped = careful(wish, [(np.array([0.4, 0.0]), RADIUS)], RADIUS, SLOW)
    assert stopped == Twist(0.0, 0.4)


@pytest.mark.parametrize(
    ("others", "impatient"),
    [
        ([(1.0, True)], True),
        ([(1.0, False)], False),
        ([(1.0, False), (1.2, True)], True),
        ([(3.0, True)], None),
        ([], None),
    ],
)
def test_of_two_that_hold_each_other_up_the_later_one_tries_another_way_first(
    others: list[tuple[float, bool]], impatient: bool | None
) -> None:
    company = [Companion("other", Pose(x, 0.0, 0.0), first, radius=0.2) for x, first in others]
    share = patience(Pose(), company)
    assert (share < 1.0, share > 1.0) == (impatient is True, impatient is False)


def test_the_nearest_one_is_the_one_to_make_way_for_unless_it_is_far() -> None:
    far, near, later = (
        Companion("other", Pose(x, 0.0, 0.0), first, radius=0.2)
        for x, first in ((1.7, True), (1.1, True), (0.8, False))
    )
    assert in_front(Pose(), [far, later, near]) is later
    assert in_front(Pose(), [far, near]) is near
    assert in_front(Pose(), [far]) is None


def way_out(x: float, other: float) -> tuple[Branch, ...] | None:
    place = TEE.place(np.array([x, 0.0]))
    assert place is not None
    return refuge(TEE, place, np.array([other, 0.0]))


def test_the_refuge_is_the_side_branch_of_the_next_junction_away_from_the_other() -> None:
    assert way_out(1.0, -0.3) == (Branch(10, forward=True), Branch(12, forward=True))
    assert way_out(5.0, 6.3) == (Branch(11, forward=False), Branch(12, forward=True))


def test_there_is_no_refuge_beyond_the_other() -> None:
    assert way_out(1.0, 1.9) is None


def test_the_way_off_is_the_longest_one_that_leads_away() -> None:
    street = drawn({1: (-6.0, 0.0), 2: (3.0, 0.0), 3: (7.0, 0.0)}, {10: (1, 2, []), 11: (2, 3, [])})
    place = street.place(np.array([1.0, 0.0]))
    assert place is not None
    east, west = Branch(10, forward=True), Branch(10, forward=False)
    assert way_off(street, place, np.array([0.4, 0.0])) == (east, Branch(11, forward=True))
    assert way_off(street, place, np.array([1.6, 0.0])) == (west,)
    bend = drawn({1: (1.0, 0.0), 2: (0.0, 0.0), 3: (0.0, 0.5)}, {10: (1, 2, []), 11: (2, 3, [])})
    place = bend.place(np.array([0.9, 0.0]))
    assert place is not None
    assert way_off(bend, place, np.array([0.0, 0.7])) == (Branch(10, forward=False),)


def out_of_the_door(x: float, *others: float) -> tuple[Branch, ...] | None:
    """From a place in a door, or at a door's side, of a corridor along x with a door at x = 0."""
    door = drawn({1: (-6.0, 0.0), 2: (6.0, 0.0)}, {10: (1, 2, [])})
    edge = door.edges[10]
    room = np.minimum(0.45 + np.abs(edge.polyline[:, 0]), 2.0)
    gvg = replace(door, edges={10: replace(edge, clearance=room)})
    place = gvg.place(np.array([x, 0.0]))
    assert place is not None
    company = [Companion("other", Pose(y, 0.0, 0.0), True, radius=RADIUS) for y in others]
    return wide_place(gvg, place, company)


def test_who_waits_in_a_door_goes_out_of_it_to_the_nearer_side_where_nobody_stands() -> None:
    east, west = (Branch(10, forward=True),), (Branch(10, forward=False),)
    assert out_of_the_door(0.1) == east
    assert out_of_the_door(-0.1) == west
    assert out_of_the_door(0.1, 0.7) == west
    assert out_of_the_door(0.1, 0.7, -0.7) is None
    assert out_of_the_door(0.1, -0.35) == east  # from who stands in the door with it
    assert out_of_the_door(0.1, 0.55) == west
    assert out_of_the_door(0.5) is None  # two can pass each other there


def straight(x0: float, x1: float, y: float = 0.0) -> Array:
    """A way along x, a decimetre from point to point."""
    x = np.linspace(x0, x1, 1 + round(abs(x1 - x0) / 0.1))
    return np.stack([x, np.full_like(x, y)], axis=1)


def beside_door(line: Array) -> Array:
    """Distance to the walls of a hall with a wall at x = 0 that has a door one metre wide."""
    posts = np.array([[0.0, 0.5], [0.0, -0.5]])
    through = np.hypot(*(line[:, None] - posts).transpose(2, 0, 1)).min(axis=1)
    past = np.where(np.abs(line[:, 1]) > 0.5, np.abs(line[:, 0]), np.inf)
    walls: Array = np.minimum(np.minimum(through, past), 2.0)
    return walls


def free(line: Array, course: Array, *, goes_first: bool) -> float:
    pose = Pose(float(course[0, 0]), float(course[0, 1]), 0.0)
    return free_metres(
        line, beside_door(line), [Companion("other", pose, goes_first, course, radius=0.2)]
    )


@pytest.mark.parametrize("mine", [0.7, 2.0, 2.8, 3.0, 3.2, 5.0])
@pytest.mark.parametrize("theirs", [0.7, 2.0, 3.0, 5.0])
def test_of_two_that_come_to_a_door_exactly_one_waits(mine: float, theirs: float) -> None:
    west, east = straight(-mine, 3.0), straight(theirs, -3.0)
    ways = free(west, east, goes_first=False), free(east, west, goes_first=True)
    assert sum(math.isinf(way) for way in ways) == 1
    if abs(mine - theirs) > 1.1:
        assert math.isinf(ways[0]) == (mine < theirs)
    stops = min(way - (mine, theirs)[k] for k, way in enumerate(ways))
    if max(mine, theirs) > 1.5:
        assert stops < -0.8  # so far before the door, there is room to come out of it


def test_a_step_back_where_one_sets_out_does_not_make_a_way_one_that_is_opposed() -> None:
    mine = np.concatenate([[[-0.29, 0.0], [-0.295, 0.001]], straight(-0.3, 3.0)])
    behind = straight(-0.8, 3.0)
    assert math.isinf(free(mine, behind, goes_first=True))


def test_nobody_waits_for_who_goes_the_same_way_or_passes_elsewhere() -> None:
    mine = straight(-4.0, 3.0)
    ahead, aside = straight(-0.5, 3.0), straight(-2.0, -2.0 - 1.0, y=1.5)
    for course in (ahead, aside, straight(-1.2, -3.0), np.zeros((0, 2))):
        one = Companion("other", Pose(), goes_first=True, course=course, radius=0.2)
        assert math.isinf(free_metres(mine, beside_door(mine), [one]))


def test_in_a_wide_corridor_nobody_waits() -> None:
    mine, wide = straight(-4.0, 3.0), np.full(71, 1.0)
    one = Companion("other", Pose(), goes_first=True, course=straight(3.0, -4.0), radius=0.2)
    assert math.isinf(free_metres(mine, wide, [one]))
