"""A whole mind, to which scans and odometry are given by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.ending import Outcome
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.events import Decision, Event, Finished, Recovery, WayForgotten
from gvgbot.autonomy.localisation import Localisation
from gvgbot.autonomy.memory import remember
from gvgbot.autonomy.passed import Passed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.views import Observation
from gvgbot.config import load_config
from gvgbot.geometry import STANDSTILL, Pose, Twist, wrap_angle
from gvgbot.hal.guard import Reason
from gvgbot.hal.messages import Contact, Odometry
from tests.unit.autonomy.sights import LASER_270, carved, sweep

NOTHING = Felt()
CLOSET = carved([(-0.6, -0.6, 0.6, 0.5)])
ROOMS = carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)])


def driven(localisation: Localisation) -> Pipeline:
    """Two metres straight on, of which odometry feels three per cent less."""
    config = load_config()
    pipeline = Pipeline(
        config.autonomy, config.exploration, config.robot.radius_m, localisation=localisation
    )
    for step, x in enumerate(np.arange(0.0, 2.01, 0.25)):
        stamp = 0.1 * step  # no gap in odometry
        pipeline.control(Odometry(stamp, Pose(0.97 * float(x), 0.0, 0.0), STANDSTILL))
        scan = sweep(ROOMS, Pose(float(x) - 1.5, 0.0, 0.0), field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    return pipeline


def test_as_published_odometry_alone_tells_the_way_between_vertices() -> None:
    pipeline = driven("paper")
    assert pipeline.past.keyframes[-1].local_base.x == pytest.approx(0.97 * 2.0)
    assert pipeline.past.keyframes[-1].local_base.y == 0.0


def test_where_walls_are_matched_they_make_odometry_good() -> None:
    assert driven("full").past.keyframes[-1].local_base.x == pytest.approx(2.0, abs=0.03)


def looks(*, led: bool) -> int:
    """How many GVGs somebody looks for who turns on the spot by 0.3 rad, then goes on by 0.3 m."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m, led=led)
    turned = [Pose(0.0, 0.0, 0.3 * k) for k in range(8)]
    way = turned + [turned[-1].compose(Pose(0.3 * k, 0.0, 0.0)) for k in range(1, 4)]
    gvgs = []
    for step, pose in enumerate(way):
        pipeline.control(Odometry(0.1 * step, pose, STANDSTILL))
        scan = sweep(ROOMS, Pose(1.0, 0.0, 0.0).compose(pose), field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=0.1 * step, time_increment=0.0))
        gvgs.append(pipeline.gvg)
    return len({id(gvg) for gvg in gvgs if gvg.edges})


def test_who_is_led_looks_for_the_gvg_only_after_some_way() -> None:
    assert looks(led=True) == 3  # at 0 and 2.1 rad, and 0.6 m on
    assert looks(led=False) >= 10


def looked(
    pipeline: Pipeline, stamp: float, theta: float = 0.0, *, x: float = 0.0, felt: Felt = NOTHING
) -> tuple[Twist, list[Event]]:
    """Stand between the walls, turned by an angle, and look: how it drives, and what it learns."""
    twist = pipeline.control(Odometry(stamp, Pose(x, 0.0, theta), STANDSTILL), felt)
    scan = sweep(ROOMS, Pose(x - 1.5, 0.0, theta), field_of_view=LASER_270)
    return twist, pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))


def about_to_drive() -> tuple[Pipeline, float, float]:
    """A robot that has looked round between the walls, its heading, rad, and the time, s."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    theta, stamp, twist = 0.0, 0.0, STANDSTILL
    while twist.linear == 0.0:
        twist, _ = looked(pipeline, stamp, theta)
        theta, stamp = theta + 0.1 * twist.angular, stamp + 0.1
    return pipeline, theta, stamp


def test_it_decides_by_nothing_that_was_seen_before_it_had_turned_round() -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    twists, decided, theta, stamp = dict[float, Twist](), list[float](), 0.0, 0.0
    while not decided:
        twists[stamp], happened = looked(pipeline, stamp, theta)
        decided += [event.stamp for event in happened if isinstance(event, Decision)]
        theta, stamp = theta + 0.125 * (twists[stamp].angular > 0.0), stamp + 0.1
    assert any(twist.angular > 0.0 for twist in twists.values())
    assert twists[decided[0]] == STANDSTILL


def test_a_base_that_does_not_move_is_told_of_and_keeps_the_robot_busy_for_no_longer() -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    happened, second = list[Event](), 0.0
    while pipeline.mission.outcome is None:
        happened += looked(pipeline, second)[1]
        second += 1.0
    told = [event.reason for event in happened if isinstance(event, Recovery)]
    assert told[0] == "the base does not turn"
    assert 20.0 < second < 40.0
    assert pipeline.mission.reason.startswith("the base does not move when it is told to: ")


@pytest.mark.parametrize(
    ("seen", "felt", "verdict"),
    [
        ("nothing", "bumper", "failed"),
        ("nothing", "cliff", None),
        ("nothing", None, None),
        ("walls", "bumper", None),
    ],
)
def test_who_runs_into_something_and_has_never_seen_anything_stands(
    seen: str, felt: str | None, verdict: str | None
) -> None:
    """Who has seen walls may be in a hall by now, with a pane of glass in it."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(3):
        scan = sweep(ROOMS, Pose(-1.5, 0.0, 0.0), field_of_view=LASER_270)
        is_seen = seen == "walls" and k == 0
        ranges = scan.ranges if is_seen else np.full(len(scan.ranges), np.inf)
        contact = Contact(
            float(k), bumper_centre=k == 1 and felt == "bumper", cliff_centre=felt == "cliff"
        )
        pipeline.control(Odometry(float(k), Pose(), STANDSTILL), Felt(contact))
        pipeline.perceive(replace(scan, stamp=float(k), ranges=ranges))
    assert pipeline.mission.outcome == verdict
    if verdict:
        assert "uncover it" in pipeline.mission.reason
        assert pipeline.control(Odometry(4.0, Pose(), STANDSTILL)) == STANDSTILL


@pytest.mark.parametrize("reason", [None, "obstacle"])
def test_a_robot_that_comes_on_by_little_or_is_held_is_no_base_that_does_not_move(
    reason: Reason | None,
) -> None:
    """One that is driven 2 cm every ten seconds is that of a wheel that slips, or is very slow."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for second in range(50):
        x = 0.0 if reason else 0.02 * (second // 10)
        looked(pipeline, float(second), x=x, felt=Felt(stopped_for=reason))
    assert pipeline.mission.outcome is None


@pytest.mark.parametrize(("time_increment", "to_be_set"), [(2e-5, "true"), (-2e-5, "false")])
def test_who_takes_left_for_right_turns_and_stands_and_does_nothing_that_is_asked(
    time_increment: float, to_be_set: str
) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    theta, stamp, happened, twist = 0.0, 0.0, list[Event](), STANDSTILL
    for _ in range(100):
        twist = pipeline.control(Odometry(stamp, Pose(theta=theta), STANDSTILL))
        assert twist.linear == 0.0
        scan = sweep(ROOMS, Pose(-1.5, 0.0, theta), field_of_view=LASER_270)
        flipped = replace(scan, ranges=scan.ranges[::-1].copy(), time_increment=time_increment)
        happened += pipeline.perceive(replace(flipped, stamp=stamp))
        theta, stamp = theta + 0.1 * twist.angular, stamp + 0.1
    assert twist == STANDSTILL
    assert theta < 2.0
    assert isinstance(happened[-1], Finished)
    assert happened[-1].outcome == "failed"
    assert f"set laser.upside_down: {to_be_set}, " in happened[-1].reason
    for asked in (pipeline.errands.explore, pipeline.errands.home):
        with pytest.raises(Declined, match=to_be_set):
            asked(stamp)
    with pytest.raises(Declined, match=to_be_set):
        pipeline.errands.drive(Twist(0.2, 0.0), stamp)


def test_a_base_that_was_away_in_the_midst_of_a_turn_turns_on() -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(10):
        looked(pipeline, 0.1 * k, 0.1 * k)
    twist, happened = looked(pipeline, 13.0, 0.9)
    assert twist.angular > 0.0
    assert not happened
    assert looked(pipeline, 13.1, 0.9)[0].angular > 0.0


def test_on_the_charger_s_cable_it_waits_and_takes_nothing_for_an_obstacle() -> None:
    pipeline, theta, stamp = about_to_drive()
    plugged_in = Felt(Contact(stamp, charger_cable=True), "charger cable")
    scan = sweep(ROOMS, Pose(-1.5, 0.0, theta), field_of_view=LASER_270)
    keyframes = len(pipeline.past.keyframes)
    for later in np.arange(stamp, stamp + 600.0, 0.2).tolist():
        pipeline.control(Odometry(later, Pose(theta=theta), STANDSTILL), plugged_in)
        assert not pipeline.perceive(replace(scan, stamp=later, time_increment=0.0))
    assert len(pipeline.past.keyframes) == keyframes
    twist, happened = looked(pipeline, stamp + 601.0, theta)
    assert twist.linear > 0.0
    assert not any(isinstance(event, Recovery) for event in happened)


def test_all_of_the_way_is_kept_while_it_explores_and_of_what_comes_later_the_end() -> None:
    config = load_config(None, ["autonomy.keyframe.latest=3"])
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    happened = [looked(pipeline, float(k), 0.4 * k)[1] for k in range(10)]
    assert not any(isinstance(one, WayForgotten) for some in happened for one in some)
    assert len(pipeline.past.keyframes) == 10
    pipeline.traffic.passed = [Passed(k, np.zeros(2), 0.2) for k in (5, 11)]
    sights = [Observation(k, 99, Pose(), np.eye(2)) for k in (5, 11)]
    pipeline.mapper.observations[:] = sights
    for stamp in np.arange(10.0, 14.0).tolist():
        pipeline.errands.drive(STANDSTILL, stamp)
        happened.append(looked(pipeline, stamp, 0.4 * stamp)[1])
    assert WayForgotten(13.0, 10, 3) in happened[-1]
    assert len(pipeline.past.keyframes) == 11
    assert [one.keyframe for one in pipeline.traffic.passed] == [5, 10]
    assert [seen for seen in pipeline.mapper.observations if seen.vertex == 99] == sights[:1]
    assert all(seen.keyframe < 11 for seen in pipeline.mapper.observations)


def found_again(latest: int) -> tuple[float, int]:
    """How far off, m, a robot is that was carried unnoticed, stood, and has looked for itself.

    And how many keyframes there were before it looked, beside those that last.
    """
    config = load_config(None, [f"autonomy.keyframe.latest={latest}"])
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    carried, theta, stamp = Pose(), 0.0, 0.0

    def look() -> None:
        nonlocal theta, stamp
        stamp += 0.1
        twist = pipeline.control(Odometry(stamp, Pose(theta=theta), STANDSTILL))
        world_laser = Pose(-1.5).compose(carried).compose(Pose(theta=theta))
        scan = sweep(ROOMS, world_laser, field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
        theta = wrap_angle(theta + 0.125 * (twist.angular > 0.0))

    for _ in range(110):
        look()
    pipeline.errands.stop(stamp)
    carried = Pose(0.7, 0.2, 0.1)
    for _ in range(600):
        pipeline.errands.drive(STANDSTILL, stamp)
        look()
    late = len(pipeline.past.keyframes) - pipeline.past.lasting
    pipeline.errands.relocalise(stamp)
    while pipeline.errands.errand is not None:
        look()
    return pipeline.map_base.distance(carried), late


def test_who_looks_for_itself_forgets_nothing_of_what_it_sees_before_it_has_compared_that() -> None:
    off, late = found_again(latest=1000)
    assert off < 0.05
    off, _ = found_again(latest=late + 3)  # the way is long enough in the midst of the look
    assert off < 0.05


@pytest.mark.parametrize(("felt", "is_kept"), [("bumper_centre", False), ("cliff_centre", True)])
def test_a_cliff_is_in_the_way_for_ever_and_what_a_bumper_felt_for_some_metres(
    felt: str, *, is_kept: bool
) -> None:
    pipeline, theta, stamp = about_to_drive()
    contact = Contact(stamp, **{felt: True})
    pipeline.control(Odometry(stamp, Pose(theta=theta), STANDSTILL), Felt(contact, "bumper"))
    assert len(pipeline._hazards.points) > 0
    pipeline.past.travelled += 100.0
    looked(pipeline, stamp + 1.0, theta)
    assert (len(pipeline._hazards.points) > 0) == is_kept


def test_who_is_lifted_neither_drives_nor_looks_whoever_wants_it_to_drive() -> None:
    pipeline, theta, stamp = about_to_drive()
    keyframes, wanted = len(pipeline.past.keyframes), Twist(0.1, 0.2)
    scan = sweep(ROOMS, Pose(-1.5, 0.0, theta), field_of_view=LASER_270)
    for is_lifted in (False, True):
        felt = Felt(Contact(stamp, wheel_drop_left=is_lifted))
        for later in (stamp + 2.0, stamp + 4.0):
            pipeline.errands.drive(wanted, later)
            twist = pipeline.control(Odometry(later, Pose(theta=theta), STANDSTILL), felt)
            assert twist == (STANDSTILL if is_lifted else wanted)
            pipeline.perceive(replace(scan, stamp=later, time_increment=0.0))
        keyframes += 0 if is_lifted else 2
        assert len(pipeline.past.keyframes) == keyframes
        stamp += 4.0


def test_who_touches_a_robot_that_rests_is_no_obstacle_to_it_later() -> None:
    """It does not move by itself either, however the bumper is pressed."""
    pipeline, theta, stamp = about_to_drive()
    pipeline.errands.pause()
    for contact in (Contact(0.0, bumper_left=True), Contact(0.0), Contact(0.0, bumper_centre=True)):
        for _ in range(20):
            stamp += 0.05
            odometry = Odometry(stamp, Pose(theta=theta), STANDSTILL)
            assert pipeline.control(odometry, Felt(contact)) == STANDSTILL
    assert len(pipeline._hazards.points) == 0
    pipeline.errands.resume()
    _, happened = looked(pipeline, stamp + 10.0, theta)
    assert not [event for event in happened if isinstance(event, Recovery)]


@pytest.mark.parametrize(("covered", "looks"), [(0.6, 0), (0.4, 10)])
def test_who_sees_next_to_nothing_waits_as_for_a_laser_that_is_silent(
    covered: float, looks: int
) -> None:
    """Half an hour: to go on standing there would be no progress, and the end of all frontiers."""
    pipeline, theta, stamp = about_to_drive()
    keyframes = len(pipeline.past.keyframes)
    whole = sweep(ROOMS, Pose(-1.5, 0.0, theta), field_of_view=LASER_270)
    ranges = whole.ranges.copy()
    ranges[: round(covered * len(ranges))] = np.nan
    happened = []
    for later in np.linspace(stamp + 1.0, stamp + 1800.0, 10).tolist():
        pipeline.control(Odometry(later, Pose(theta=theta), STANDSTILL))
        scan = replace(whole, stamp=later, time_increment=0.0, ranges=ranges)
        happened += pipeline.perceive(scan)
    assert len(pipeline.past.keyframes) == keyframes + looks
    pipeline.control(Odometry(later + 0.1, Pose(theta=theta), STANDSTILL))
    happened += pipeline.perceive(replace(whole, stamp=later + 0.1, time_increment=0.0))
    assert len(pipeline.past.keyframes) > keyframes
    assert not any(isinstance(event, Recovery) for event in happened)


def speed_before(radius: float) -> float:
    """How fast somebody sets out who has another robot of a radius 0.9 m before it, m/s."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    here, stamp, twist = Pose(), 0.0, STANDSTILL
    while twist.linear == 0.0:
        here, stamp = here.compose(Pose(0.0, 0.0, 0.1 * twist.angular)), stamp + 0.1
        scan = sweep(ROOMS, Pose(-1.5, 0.0, 0.0).compose(here), field_of_view=LASER_270)
        twist = pipeline.control(Odometry(stamp, here, STANDSTILL))
        pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    ahead = pipeline.map_base.compose(Pose(0.9, 0.0, 0.0))
    pipeline.traffic.company = [Companion("other", ahead, goes_first=True, radius=radius)]
    return pipeline.control(Odometry(stamp + 0.02, here, STANDSTILL)).linear


def test_a_large_robot_is_kept_away_from_as_far_as_it_is_large() -> None:
    assert speed_before(radius=0.177) > 0.0  # 0.55 m are free between both bodies
    assert speed_before(radius=0.65) == 0.0  # 0.07 m


CORRIDOR = carved([(-10.0, -1.5, 10.0, 1.5)])


def test_it_backs_off_no_farther_than_to_a_virtual_wall() -> None:
    config = load_config(None, ["autonomy.virtual_walls=[[[-0.4, -2], [-0.4, 2]]]"])
    walled = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    config = load_config()
    free = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for pipeline in (walled, free):
        for heading in (0.0, np.pi):  # it sees 270 degrees
            pipeline.control(Odometry(heading, Pose(theta=heading), STANDSTILL))
            scan = sweep(CORRIDOR, Pose(theta=heading), field_of_view=LASER_270)
            pipeline.perceive(replace(scan, stamp=heading, time_increment=0.0))
    here = Pose(theta=np.pi)
    assert free._room(here, 0.0) > 0.2
    margin = config.autonomy.passage_margin_m
    expected = 0.4 - config.robot.radius_m - margin
    assert walled._room(here, 0.0) == pytest.approx(expected, abs=0.02)


def between_two(*, in_team: bool) -> Pipeline:
    """A robot in the middle of a corridor where others stand, 1.5 m away on either side."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    others = [
        Companion(str(x), Pose(x, 0.0, 0.0), goes_first=True, radius=0.18) for x in (-1.5, 1.5)
    ]
    pipeline.traffic.company = others if in_team else None
    theta, stamp = 0.0, 0.0
    while not len(pipeline.track):
        scan = sweep(CORRIDOR, Pose(0.0, 0.0, theta), field_of_view=LASER_270)
        twist = pipeline.control(Odometry(stamp, Pose(0.0, 0.0, theta), STANDSTILL))
        pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
        theta, stamp = theta + 0.1 * twist.angular, stamp + 0.1
    return pipeline


def test_a_robot_of_the_team_is_driven_round_and_shapes_no_edge() -> None:
    pipeline = between_two(in_team=True)
    edges = np.concatenate([edge.polyline for edge in pipeline.gvg.edges.values()])
    assert np.abs(edges[np.abs(edges[:, 0]) < 3.0, 1]).max() < 0.1
    x, y = pipeline.track.T
    assert np.hypot(np.abs(x) - 1.5, y).min() > 2 * 0.18 + 0.2
    assert np.abs(x).max() > 3.0
    x, y = between_two(in_team=False).track.T
    assert np.abs(y[np.abs(x) < 8.0]).max() < 0.1  # the end of the corridor has corners


@pytest.mark.parametrize("turned", [0.0, 0.3, 0.6, -0.6, 1.5, 3.0])
def test_a_base_that_started_anew_may_have_been_turned_meanwhile(turned: float) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(26):  # once round, so that all walls are known
        looked(pipeline, 0.1 * k, 0.25 * k)
    anew = Odometry(6.5, Pose(0.0, 0.0, 6.25), STANDSTILL, breaks=1)
    for k in range(3):
        pipeline.control(replace(anew, stamp=6.5 + 0.1 * k))
        scan = sweep(ROOMS, Pose(-1.5, 0.0, 6.25 + turned), field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=6.5 + 0.1 * k, time_increment=0.0))
    there = Pose(0.0, 0.0, 6.25 + turned).to(pipeline.map_base)
    assert math.hypot(there.x, there.y) < 0.05
    assert abs(wrap_angle(there.theta)) < 0.03


@pytest.mark.parametrize("turned", [0.0, 1.5, -1.5])
def test_in_a_corridor_it_is_unsure_along_that_however_the_base_was_turned_meanwhile(
    turned: float,
) -> None:
    """From west to east; the laser does not see the ends."""
    corridor, config = carved([(-30.0, -1.0, 30.0, 1.0)]), load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(27):  # once round, before the base starts anew
        odom_base, base = Pose(theta=0.25 * k), Pose(theta=0.25 * k + turned * (k == 26))
        pipeline.control(Odometry(0.1 * k, odom_base, STANDSTILL, breaks=int(k == 26)))
        scan = sweep(corridor, base)
        pipeline.perceive(replace(scan, stamp=0.1 * k, time_increment=0.0))
    along, across = np.sqrt(np.diag(pipeline.mapper.belief.P)[:2])
    assert along > 0.3
    assert across < 0.1


@pytest.mark.parametrize(("x", "y", "stands"), [(0.0, 0.5, False), (2.0, 3.0, True)])
def test_a_base_that_was_carried_away_before_it_started_anew_stands_and_says_so(
    x: float, y: float, stands: bool
) -> None:
    """Into the room at the side, of which it has seen little; or half a metre aside."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(26):  # once round, so that all walls are known
        looked(pipeline, 0.1 * k, 0.25 * k)
    known, walls = len(pipeline.past.keyframes), pipeline.tracker.maps.near.points().copy()
    happened: list[Event] = []
    for k in range(8):
        stamp = 6.5 + 0.1 * k
        anew = Odometry(stamp, Pose(0.0, 0.0, 6.25), STANDSTILL, breaks=1)
        pipeline.control(anew)
        scan = sweep(ROOMS, Pose(-1.5 + x, y, 0.0), field_of_view=LASER_270)
        happened += pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    told = [event.reason for event in happened if isinstance(event, Recovery)]
    assert any("restart the program" in reason for reason in told) == stands
    assert pipeline.errands.is_paused == stands
    assert not remember(pipeline).intent.is_paused  # when it is started anew, it looks
    if stands:
        assert pipeline.errands.is_lost  # it looks around where it is asked to resume
        assert len(pipeline.past.keyframes) == known  # and spoils no map
        assert (pipeline.tracker.maps.near.points() == walls).all()


@pytest.mark.parametrize("rest_s", [10.0, 3600.0])
def test_a_gyro_that_feels_nothing_for_an_hour_has_not_drifted(rest_s: float) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for k in range(26):
        looked(pipeline, 0.1 * k, 0.25 * k)
    drift = np.array([0.0, 0.0, 5e-4])  # rad/s, as was learnt in driving
    pipeline.tracker.maps.calibration.x = drift
    pipeline.errands.is_paused = True
    for stamp in np.arange(2.6, 2.6 + rest_s, 0.25):
        pipeline.control(Odometry(float(stamp), Pose(0.0, 0.0, 6.25), STANDSTILL))
    pipeline.errands.is_paused = False
    looked(pipeline, 2.7 + rest_s, 6.25)
    assert abs(wrap_angle(pipeline.map_base.theta - 6.25)) < 0.003


def turned_after_the_end(
    outcome: Outcome, away_m: float, *, lifted: bool = False, told: bool = False
) -> float:
    """The bearing of somebody who has finished in a corridor, another robot so far east of it.

    If it is lifted, or told to stop, that is just after the end.
    """
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    theta, twist = 0.0, STANDSTILL
    for k in range(140):
        if k == 60:  # it has been once round
            theta, twist, pipeline.mission.outcome = 0.0, STANDSTILL, outcome
            other = Companion("other", Pose(away_m), goes_first=True, radius=0.18)
            pipeline.traffic.company = [other]
            if told:
                pipeline.errands.stop(0.1 * k)
        theta += 0.1 * twist.angular
        scan = sweep(CORRIDOR, Pose(0.0, 0.0, theta), field_of_view=LASER_270)
        contact = Contact(0.1 * k, wheel_drop_left=lifted and k == 60)
        odometry = Odometry(0.1 * k, Pose(0.0, 0.0, theta), STANDSTILL)
        twist = pipeline.control(odometry, Felt(contact, None))
        pipeline.perceive(replace(scan, stamp=0.1 * k, time_increment=0.0))
    return theta


@pytest.mark.parametrize(
    ("outcome", "away_m", "turns"),
    [("explored", 2.5, True), ("explored", 5.0, False), ("stopped", 2.5, False)],
)
def test_who_has_finished_turns_its_back_to_a_wall_when_another_robot_comes_near(
    outcome: Outcome, away_m: float, *, turns: bool
) -> None:
    """And not to a way by which somebody may come; nobody who was told to stop moves."""
    theta = turned_after_the_end(outcome, away_m)
    assert abs(math.sin(theta)) > math.cos(0.5) if turns else theta == 0.0


def test_who_was_lifted_after_the_end_stays_where_it_was_put() -> None:
    assert turned_after_the_end("explored", 2.5, lifted=True) == 0.0


@pytest.mark.parametrize("is_asked", [False, True])
def test_who_was_pushed_and_is_asked_to_relocalise_finds_its_place_by_the_walls(
    *, is_asked: bool
) -> None:
    """By 0.8 m, along a corridor with a room at its side, of which odometry has felt nothing."""
    pipeline, theta, stamp = about_to_drive()
    start = pipeline.map_base
    if is_asked:
        pipeline.errands.relocalise(stamp)
    for _ in range(10):
        stamp += 0.1
        pipeline.control(Odometry(stamp, Pose(theta=theta), STANDSTILL))
    scan = sweep(ROOMS, Pose(-0.7, 0.0, theta), field_of_view=LASER_270)
    pipeline.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    moved = pipeline.map_base.distance(start)
    assert moved == pytest.approx(0.8 if is_asked else 0.0, abs=0.1)


@pytest.mark.parametrize("is_carried", [False, True])
def test_who_was_carried_after_the_end_does_not_believe_to_be_where_it_was(
    *, is_carried: bool
) -> None:
    pipeline, theta, stamp = about_to_drive()
    pipeline.mission.outcome = "explored"
    for k in range(50):
        stamp += 0.1
        felt = Felt(Contact(stamp, wheel_drop_left=is_carried and k == 1))
        pipeline.control(Odometry(stamp, Pose(theta=theta), STANDSTILL), felt)
    pipeline.errands.explore(stamp)
    scan = sweep(CLOSET if is_carried else ROOMS, Pose(-1.5 * (not is_carried), 0.0, theta))
    pipeline.perceive(replace(scan, stamp=stamp))
    assert pipeline.errands.is_paused == is_carried


def test_who_is_told_to_stop_after_the_end_stays_where_it_is() -> None:
    assert turned_after_the_end("explored", 2.5, told=True) == 0.0


def test_who_does_not_see_where_it_drives_does_not_begin_to() -> None:
    """Its laser looks astern."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    odometry = Odometry(0.0, Pose(), STANDSTILL)
    pipeline.control(odometry)
    scan = sweep(ROOMS, Pose(-1.5, 0.0, 0.0), field_of_view=LASER_270)
    (event,) = pipeline.perceive(replace(scan, stamp=0.0, base_laser=Pose(theta=math.pi)))
    assert isinstance(event, Finished)
    assert event.outcome == "failed"
    assert "laser.yaw_deg" in event.reason
    assert pipeline.control(replace(odometry, stamp=0.1)) == STANDSTILL
    with pytest.raises(Declined, match=r"laser\.yaw_deg"):
        pipeline.errands.explore(0.1)
