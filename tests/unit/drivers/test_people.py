"""People in the simulated world: how they walk, and that they leave a robot alone."""

import math

import numpy as np
import pytest

from gvgbot.drivers.body import BodyConfig, RobotBody
from gvgbot.drivers.people import STANDING, STEP, People, Walkways
from gvgbot.drivers.world import World
from gvgbot.errors import WorldError
from gvgbot.geometry import Array, Pose
from gvgbot.worlds import builtin
from gvgbot.worlds.canvas import Canvas

RADIUS = BodyConfig().radius_m
FAR_AWAY = Pose(-100.0, -100.0, 0.0)


def corridor() -> World:
    """Twenty metres long and 1.2 m wide, from (1, 1) on."""
    canvas = Canvas(22.0, 3.2)
    canvas.carve(1.0, 1.0, 21.0, 2.2)
    return canvas.world("corridor")


def open_floor() -> World:
    canvas = Canvas(12.0, 12.0)
    canvas.carve(1.0, 1.0, 11.0, 11.0)
    return canvas.world("floor")


def still(world: World, centre: tuple[float, float]) -> People:
    """One person who never moves."""
    people = People(Walkways(world, Pose(2.0, 6.0, 0.0)), 1, seed=1)
    people.stand(0, *centre)
    return people


def walked(
    people: People, seconds: float, robot: Pose = FAR_AWAY, others: tuple[Pose, ...] = ()
) -> Array:
    """Where everybody is after each step: (steps, N, 2)."""
    places = []
    for _ in range(round(seconds / STEP)):
        people.step([*others, robot], RADIUS)
        places.append(people.centres.copy())
    return np.array(places)


def stands(place: Array) -> list[float]:
    """How long (s) a person stood each time, of whom (steps, 2) tells the places."""
    moves = np.flatnonzero(np.hypot(*np.diff(place, axis=0).T) > 0.0)
    gaps = np.diff(moves) * STEP
    return [float(gap) for gap in gaps if gap > 1.0]


@pytest.mark.parametrize("seed", [1, 2])
def test_people_walk_at_their_pace_and_never_into_a_wall(seed: int) -> None:
    world, start = builtin(f"crowd:{seed}")
    people = People(Walkways(world, start), 6, seed)
    places = walked(people, 200.0)
    speeds = np.hypot(*np.diff(places, axis=0).T).T / STEP
    assert ((people.radii >= 0.2) & (people.radii <= 0.3)).all()
    assert (speeds.max(axis=0) > 0.5 - 0.01).all()
    assert speeds.max() <= 1.2 + 1e-9
    for centres in places[::10]:
        for (x, y), radius in zip(centres, people.radii, strict=True):
            assert len(world.wall_offsets(x, y, radius)) == 0


def test_people_stand_for_five_to_sixty_seconds_and_leave() -> None:
    world, start = builtin("crowd:3")
    places = walked(People(Walkways(world, start), 6, seed=3), 400.0)
    times = [time for k in range(6) for time in stands(places[:, k])]
    assert len(times) > 6
    assert min(times) >= 5.0 - 2 * STEP
    assert max(times) <= 60.0 + 3 * STEP


@pytest.mark.parametrize("seed", range(5))
def test_nobody_walks_into_a_robot_that_stands_in_a_corridor(seed: int) -> None:
    robot = Pose(11.0, 1.6, 0.0)
    people = People(Walkways(corridor(), robot), 4, seed)
    places = walked(people, 200.0, robot)
    gaps = np.hypot(*(places - robot.position).T).T - people.radii - RADIUS
    assert gaps.min() >= 0.3
    assert gaps.min() < 0.4  # somebody did come up to it


@pytest.mark.parametrize("seed", range(3))
def test_people_keep_away_from_each_of_several_robots(seed: int) -> None:
    robots = Pose(11.0, 1.6, 0.0), Pose(4.0, 1.6, 0.0)
    walkways = Walkways(corridor(), robots[0], robots[1:])
    people = People(walkways, 4, seed)
    begins = people.centres.copy()
    places = walked(people, 200.0, robots[0], robots[1:])
    for robot in robots:
        assert np.hypot(*(begins - robot.position).T).min() >= 1.5
        assert (np.hypot(*(places - robot.position).T).T - people.radii - RADIUS).min() >= 0.3


def test_who_walks_with_one_robot_stops_for_the_others() -> None:
    world, robots = corridor(), (Pose(11.0, 1.6, 0.0), Pose(4.0, 1.6, 0.0))
    people = People(Walkways(world, robots[0], robots[1:]), 4, seed=1)
    one, two = (RobotBody(world, robot, people=people) for robot in robots)
    one.others, two.others = [two], [one]
    least = math.inf
    for now in np.arange(0.0, 200.0, STEP):
        one.advance(float(now))
        two.advance(float(now))
        gaps = np.hypot(*(people.centres - robots[1].position).T) - people.radii - RADIUS
        least = min(least, float(gaps.min()))
    assert 0.3 <= least < 0.4


def test_who_is_stopped_by_the_robot_turns_elsewhere() -> None:
    robot = Pose(11.0, 1.6, 0.0)
    people = People(Walkways(corridor(), robot), 4, seed=1)
    x = walked(people, 600.0, robot)[:, :, 0]
    assert (np.ptp(x[-6000:], axis=0) > 1.0).all()  # nobody stays for the last five minutes


def test_equal_seeds_walk_alike_however_time_is_cut() -> None:
    world, start = builtin("crowd:1")
    centres = []
    for seed, strides in ((1, 400), (1, 57), (2, 400)):
        people = People(Walkways(world, start), 5, seed, stamp=7.0)
        body = RobotBody(world, start, stamp=7.0, people=people)
        for now in np.linspace(7.0, 47.01, strides):
            body.advance(float(now))
        centres.append(people.centres)
    assert np.array_equal(centres[0], centres[1])
    assert not np.array_equal(centres[0], centres[2])


def test_a_robot_that_drives_into_a_person_is_stopped_and_counts_a_contact() -> None:
    people = still(open_floor(), (6.0, 6.0))
    body = RobotBody(open_floor(), Pose(4.0, 6.0, 0.0), people=people)
    body.command(0.3, 0.0)
    body.advance(20.0)
    assert body.pose.x == pytest.approx(6.0 - people.radii[0] - RADIUS, abs=1e-3)
    assert (body.contacts, body.bumper) == (1, (False, True, False))


def test_who_is_put_somewhere_stands_there_for_good() -> None:
    assert (walked(still(open_floor(), (6.0, 6.0)), 2 * STANDING[1]) == (6.0, 6.0)).all()


def test_a_robot_can_leave_a_person_it_touches() -> None:
    people = still(open_floor(), (6.0, 6.0))
    body = RobotBody(open_floor(), Pose(4.0, 6.0, 0.0), people=people)
    for now, speed in ((10.0, 0.3), (14.0, -0.3)):
        body.command(speed, 0.0)
        body.advance(now)
    assert body.bumper == (False, False, False)
    assert body.pose.x < 6.0 - people.radii[0] - RADIUS - 0.5


def test_offsets_lead_to_the_nearest_points_of_those_in_reach() -> None:
    people = still(open_floor(), (6.0, 6.0))
    radius = people.radii[0]
    assert people.offsets(3.0, 2.0, 5.0 - radius - 1e-9).shape == (0, 2)  # a 3-4-5 triangle
    offsets = people.offsets(3.0, 2.0, 5.0 - radius + 1e-9)
    np.testing.assert_allclose(offsets, [[3.0 - 0.6 * radius, 4.0 - 0.8 * radius]])
    np.testing.assert_allclose(people.offsets(6.1, 6.0, 1.0), [[0.0, 0.0]], atol=1e-12)


def test_people_are_seen_as_round() -> None:
    people = still(open_floor(), (6.0, 6.0))
    pose, bearings = Pose(3.0, 5.0, 0.3), np.linspace(-math.pi, math.pi, 4001)
    ranges = people.cast(pose, bearings)
    hit = np.isfinite(ranges)
    direction = pose.theta + bearings
    ends = pose.position + ranges[hit, None] * np.stack(
        (np.cos(direction[hit]), np.sin(direction[hit])), axis=1
    )
    np.testing.assert_allclose(np.hypot(*(ends - (6.0, 6.0)).T), people.radii[0])
    assert (ranges[hit] <= math.hypot(3.0, 1.0)).all()  # the near side
    seen_under = 2 * math.asin(people.radii[0] / math.hypot(3.0, 1.0))
    assert hit.sum() * (bearings[1] - bearings[0]) == pytest.approx(seen_under, abs=0.004)


def test_a_world_without_room_for_people_says_so_in_one_line() -> None:
    canvas = Canvas(3.0, 3.0)
    canvas.carve(1.0, 1.0, 1.4, 2.0)
    with pytest.raises(WorldError, match=r"world closet: no room for people; set twin\.people"):
        Walkways(canvas.world("closet"), Pose(1.2, 1.5, 0.0))


def test_people_stay_on_the_robot_s_side_of_a_wall() -> None:
    canvas = Canvas(20.0, 6.0)
    canvas.carve(1.0, 1.0, 8.0, 5.0)
    canvas.carve(9.0, 1.0, 19.0, 5.0)
    walkways = Walkways(canvas.world("halves"), Pose(2.0, 2.0, 0.0))
    assert walkways.points[:, 0].max() < 8.0
