"""A robot that comes back: what it says when it is lost, and what it knows when it is found."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.ending import Outcome
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Recovery
from gvgbot.autonomy.memory import growth, remember
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.relocalisation import (
    _STAYED_M,
    Hypothesis,
    Look,
    Opinion,
    Relocaliser,
)
from gvgbot.autonomy.returning import ReturningPipeline, _given_up
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.config import load_config
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.hal.messages import Contact, Odometry, Scan
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.persistence.mission_state import Saved
from tests.unit.autonomy.sights import carved, sweep
from tests.unit.autonomy.slam.beliefs import updated

MISSION = Path(__file__).parents[2] / "data" / "mission_v1"
CONFIG = load_config()
SETTINGS = CONFIG.autonomy, CONFIG.exploration, CONFIG.robot.radius_m


def mission() -> Saved:
    saved = MissionFiles(MISSION).read()
    assert saved is not None
    return saved


def lost(autonomy: AutonomyConfig = CONFIG.autonomy) -> ReturningPipeline:
    """A robot that does not know where it is on the map that it has kept."""
    saved = mission()
    return ReturningPipeline(autonomy, *SETTINGS[1:], saved.memory, saved.past, lambda: False)


@pytest.mark.parametrize(
    ("opinion", "says"),
    [
        (Opinion(None, 0.0, 0, 9), "no place on the map fits"),
        (Opinion(Pose(), 0.7, 2, 9), "2 places fit, 0.70 for the best"),
        (
            Opinion(Pose(), 0.25, 4, 9, is_hopeless=True),
            "all the map looks the same from 4 places",
        ),
    ],
)
def test_a_robot_that_gives_up_says_what_to_do(opinion: Opinion, says: str) -> None:
    assert _given_up(opinion) == (
        f"not sure where it is: {says}; "
        "start it where it stopped, or begin a new map (gvgbot run --new)"
    )


def test_who_is_lost_does_not_know_where_virtual_walls_are() -> None:
    robot = lost(replace(CONFIG.autonomy, virtual_walls=(((0.0, 1.0), (3.0, 1.0)),)))
    assert len(robot.sight.virtual_walls) > 30
    assert len(robot._new_mind().sight.virtual_walls) == 0


def test_a_gyro_that_stood_still_for_an_hour_has_not_drifted_meanwhile() -> None:
    """As it does on the move. Odometry has the heading that it had, and so has the robot."""
    scan = sweep(carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)]), Pose(-1.5))
    before = Pipeline(*SETTINGS)
    before.control(Odometry(0.0, Pose(), STANDSTILL))
    before.perceive(scan)
    before.tracker.maps.calibration.x[2] = math.radians(0.03)  # rad/s
    robot = ReturningPipeline(*SETTINGS, remember(before), growth(before), lambda: True)
    robot.errands.pause()
    for stamp in np.arange(1.0, 3601.0).tolist():
        robot.control(Odometry(stamp, Pose(), STANDSTILL))
    robot.errands.resume()
    assert not robot.perceive(replace(scan, stamp=3600.0))
    assert len(robot.past.keyframes) == 2
    assert robot.map_base.distance(Pose()) < 0.01
    assert robot.map_base.theta == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("x", "is_other_building", "is_there"),
    [(-1.5, False, True), (-1.3, False, True), (-0.7, False, False), (-1.5, True, False)],
)
def test_a_base_that_has_counted_on_is_believed_only_if_the_walls_are_as_they_should_be(
    x: float, *, is_other_building: bool, is_there: bool
) -> None:
    """Its wheels tell of no way, but somebody may have lifted it; some slip is no matter."""
    here = carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)])
    other = carved([(-2.5, -3.0, 0.5, 0.6), (-9.0, -3.0, 0.5, -2.0)])
    before = Pipeline(*SETTINGS)
    before.control(Odometry(0.0, Pose(), STANDSTILL))
    before.perceive(sweep(here, Pose(-1.5)))
    robot = ReturningPipeline(*SETTINGS, remember(before), growth(before), lambda: True)
    robot.control(Odometry(1.0, Pose(), STANDSTILL))
    scan = replace(sweep(other if is_other_building else here, Pose(x)), stamp=1.0)
    actions = [e.action for e in robot.perceive(scan) if isinstance(e, Recovery)]
    assert actions == ([] if is_there else ["begin a new map"])


def test_who_is_lost_does_not_drive_back_from_what_it_runs_into() -> None:
    """It does not know what is behind it."""
    robot = lost()
    assert not robot.errands.is_resting
    for k in range(20):
        odometry = Odometry(0.1 * k, Pose(), STANDSTILL)
        assert robot.control(odometry, Felt(Contact(0.0, bumper_centre=k == 1))) == STANDSTILL


def test_who_looks_for_its_place_does_so_as_it_is_told_meanwhile() -> None:
    robot = lost()
    robot.control(Odometry(0.0, Pose(), STANDSTILL))
    robot.perceive(sweep(carved([(-4.0, -1.0, 6.0, 1.0)]), Pose()))
    seeker = robot._seeker
    assert seeker is not None
    told = replace(CONFIG.exploration, in_the_way_s=99.0)
    robot.configure(told)
    for mind in (robot, seeker, robot._new_mind()):
        assert mind.mission._config == told


def seeking() -> tuple[ReturningPipeline, Scan, float]:
    """A robot that is about to drive to find its place, its next scan, and its heading, rad."""
    robot = lost()
    world = carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)])
    theta, stamp, twist, scan = 0.0, 0.0, STANDSTILL, sweep(world, Pose(-1.5))
    while twist.linear == 0.0:
        twist = robot.control(Odometry(stamp, Pose(theta=theta), STANDSTILL))
        robot.perceive(replace(scan, stamp=stamp, time_increment=0.0))
        theta, stamp = theta + 0.1 * twist.angular, stamp + 0.1
        scan = sweep(world, Pose(-1.5, 0.0, theta))
    return robot, replace(scan, stamp=stamp, time_increment=0.0), theta


def test_who_is_paused_while_it_looks_for_its_place_goes_on_with_that_afterwards() -> None:
    """It stands because it is told to; nothing is in its way, and its base is in order."""
    robot, scan, theta = seeking()
    stamp = scan.stamp
    robot.errands.pause()
    for _ in range(600):
        stamp += 0.1
        assert robot.control(Odometry(stamp, Pose(theta=theta), STANDSTILL)) == STANDSTILL
        assert not robot.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    robot.errands.resume()
    assert not robot.perceive(replace(scan, stamp=stamp, time_increment=0.0))
    twist = robot.control(Odometry(stamp + 0.1, Pose(theta=theta), STANDSTILL))
    assert twist != STANDSTILL
    assert not robot.errands.unfit
    assert robot.is_seeking
    assert robot._seeker is not None
    assert not len(robot._seeker._hazards.points)


@pytest.mark.parametrize(("sure_looks", "is_found"), [(2, False), (3, True)])
def test_who_looks_for_its_place_goes_on_until_it_is_sure(
    sure_looks: int, *, is_found: bool
) -> None:
    robot, scan, _ = seeking()
    opinion = Opinion(Pose(1.0, 0.5, 0.3), 0.999, 1, 9, sure_looks=sure_looks)

    class Certain(Relocaliser):
        def step(self, look: Look) -> Opinion:
            return opinion

    robot._relocaliser = Certain([], robot.matching, seen_at=Pose(), is_whole=True)
    happened = [event.action for event in robot.perceive(scan) if isinstance(event, Recovery)]
    assert happened == ["go on from its place on the map"] * is_found
    assert robot.is_seeking != is_found


def test_who_has_lost_its_latest_scans_was_not_where_the_older_ones_were_taken() -> None:
    """Nobody carries a robot whose journal is damaged: it is where it was when it was kept last."""
    saved = mission()
    assert saved.memory.last is not None
    first, last = saved.past[0].keyframe.map_base, saved.memory.last.map_base
    assert first.distance(last) > _STAYED_M
    robot = ReturningPipeline(*SETTINGS, saved.memory, saved.past[:1], lambda: False)
    robot.control(Odometry(0.0, Pose(), STANDSTILL))
    robot.perceive(sweep(carved([(-4.0, -1.0, 6.0, 1.0)]), Pose()))
    stayed = [robot._relocaliser._stayed(Hypothesis(where)) for where in (first, last)]
    assert stayed[0] == 0.0 < stayed[1]


@pytest.mark.parametrize(
    ("outcome", "action"),
    [
        (None, "begin a new map"),
        ("stopped", "begin a new map"),
        ("failed", "begin a new map"),
        ("explored", "look for its place on the map"),
    ],
)
def test_who_ended_before_its_first_vertex_has_no_map_to_be_lost_on(
    outcome: Outcome | None, action: str
) -> None:
    """It was started in the wrong place, told to stop, and carried; a room without edges is one."""
    corridor = carved([(-4.0, -1.0, 6.0, 1.0)])
    before = Pipeline(*SETTINGS)
    before.control(Odometry(0.0, Pose(), STANDSTILL))
    before.perceive(sweep(corridor, Pose()))
    before.mission.outcome = outcome
    robot = ReturningPipeline(*SETTINGS, remember(before), growth(before), lambda: False)
    robot.control(Odometry(1.0, Pose(), STANDSTILL))
    if outcome is not None:
        robot.errands.explore(1.0)
    happened = robot.perceive(replace(sweep(corridor, Pose(4.0, 0.5, 2.0)), stamp=1.0))
    assert [event.action for event in happened if isinstance(event, Recovery)] == [action]
    assert robot.is_lost == (outcome == "explored")


def test_who_has_found_its_place_on_a_map_knows_no_better_where_that_map_lies() -> None:
    """The map may lie metres aside of where it began, as a whole, and so may the robot on it.

    What it sees next to it, again and again, is where the map has it, wherever that is.
    """
    robot = lost()
    belief, aside = robot.mapper.belief, np.diag([2.0**2, 2.0**2, 0.0])
    shift = np.kron(np.ones((1 + len(belief.ids),) * 2), aside)
    robot.mapper.belief = Belief(belief.x, belief.P + shift, belief.ids)
    robot._estimate, seeker = smoothed(robot), robot._new_mind()
    seeker.control(Odometry(0.0, Pose(), STANDSTILL))
    seeker.perceive(sweep(carved([(-4.0, -1.0, 6.0, 1.0)]), Pose()))
    robot._arrive(seeker, Pose(1.0, 0.5, 0.3))
    found = robot.mapper.belief
    here = min(found.ids, key=lambda v: found.map_vertex(v).distance(found.map_base))
    base_vertex, R = ekf.expected(found, here)[0], 0.1**2 * np.eye(3)
    S = ekf.innovation(found, here, base_vertex, R)[1]
    assert np.sqrt(np.linalg.eigvalsh(S)[-1]) < 0.3
    for _ in range(3):
        found = updated(found, here, base_vertex, R)
    assert np.linalg.eigvalsh(found.vertex_covariance(here)).min() > 0.99 * 2.0**2


def test_who_finds_its_place_between_two_vertices_knows_the_ways_to_both() -> None:
    """In a corridor so long that neither of them is in sight."""
    robot = lost()
    robot._estimate, seeker = smoothed(robot), robot._new_mind()
    corridor = carved([(-25.0, -1.0, 25.0, 1.0)])
    seeker.control(Odometry(0.0, Pose(), STANDSTILL))
    seeker.perceive(sweep(corridor, Pose()))
    belief = robot.mapper.belief
    one, other = (belief.map_vertex(vertex).position for vertex in (1, 2))
    middle, along = (one + other) / 2, other - one
    x, y = middle.tolist()
    robot._arrive(seeker, Pose(x, y, float(np.arctan2(along[1], along[0]))))
    robot.control(Odometry(0.0, Pose(), STANDSTILL))
    robot.perceive(sweep(corridor, Pose()))
    metres = float(np.hypot(*along)) / 2
    for vertex in (1, 2):
        answer = robot.errands.goto_vertex(vertex, 0.0)
        found = re.fullmatch(rf"it drives (\S+) m to vertex {vertex}", answer)
        assert found is not None
        assert float(found[1]) == pytest.approx(metres, abs=0.2)


def test_what_was_seen_and_felt_before_and_meanwhile_is_where_it_was_when_the_place_is_found() -> (
    None
):
    """Stairs that were felt long ago, 100 m of driving, and a post just before it was found."""
    robot = lost()
    robot._estimate, seeker = smoothed(robot), robot._new_mind()
    room = sweep(carved([(-4.0, -1.0, 6.0, 1.0)]), Pose())
    seeker.control(Odometry(0.0, Pose(), STANDSTILL))
    seeker.perceive(room)
    last, robot.past.travelled, seeker.past.travelled = robot.past.last, 100.0, 3.0
    assert last is not None
    vertices = robot.mapper.graph.vertices.values()
    for vertex in vertices:
        vertex.seen_at = 99.0
    robot._hazards.add(Pose(2.0, 1.0, 2.0), (0.0,), 0.2, 0.0, lasting=True)
    seeker._hazards.add(Pose(0.5), (0.0,), 0.2, 2.0, lasting=False)
    before = robot.mapper.belief.map_base.compose(last.local_base.inverse())
    stairs = before.transform(robot._hazards.felt[-1].points)
    post = seeker._hazards.felt[0].points.copy()
    robot._arrive(seeker, Pose(1.0, 0.5, 0.3))
    found = robot.past.last
    assert found is not None
    now = robot.mapper.belief.map_base.compose(found.local_base.inverse())
    *_, first, second = robot._hazards.felt
    assert now.transform(first.points) == pytest.approx(stairs)
    assert second.points == pytest.approx(post)
    assert robot.past.travelled - second.travelled == pytest.approx(1.0)
    walls = len(robot.tracker.maps.near.points())
    blind = replace(room, ranges=np.full(len(room.ranges), np.nan))
    robot.tracker.maps.near.insert(blind, found.local_base, robot.past.travelled)
    assert len(robot.tracker.maps.near.points()) == walls > 0
    # none of them is told by its place in the local frame, which is another one
    assert {100.0 - vertex.seen_at for vertex in vertices} == {
        CONFIG.autonomy.recognition.tracked_m
    }
