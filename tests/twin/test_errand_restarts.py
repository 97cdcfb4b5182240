"""A robot that is killed while it does what somebody asked for, and goes on with it."""

import contextlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.kills import vertices
from benchmarks.rigs.lives_rig import Lives, explored
from benchmarks.rigs.run_rig import Daemon, at_once
from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.errands.kinds import Patrol
from gvgbot.autonomy.keyframes import KeyframeConfig
from gvgbot.autonomy.memory import growth, remember
from gvgbot.clock import Clock
from gvgbot.config import Config, TwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.geometry import Pose
from gvgbot.persistence.keeper import _COUNTING_S, SNAPSHOT_EVERY, Keeper
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.persistence.records import packed
from gvgbot.robot import Robot
from gvgbot.session import Session
from gvgbot.simulation import Place
from gvgbot.snapshots import _phase
from gvgbot.worlds.canvas import Canvas

pytestmark = [pytest.mark.twin, pytest.mark.slow]

TWIN = TwinConfig(base=KobukiTwinConfig(odometry="perfect"))
START = Pose(2.5, 1.5, 0.1)
ARM = (4.5, 3.3)
CROSSING = (4.5, 1.675)  # as far from the corners (3.8, 2.2) and (5.2, 2.2) as from the wall at 0.8
LATEST = 20  # keyframes
UNSURE = _COUNTING_S + 5.0  # s: dead for so long, it does not know whether it was carried
AUTONOMY = AutonomyConfig(keyframe=KeyframeConfig(latest=LATEST))


def tee() -> Place:
    """A corridor with a side arm: three dead ends and one crossing."""
    canvas = Canvas(8.0, 5.5)
    canvas.carve_path([(2.0, 1.5), (7.0, 1.5)], 1.4)
    canvas.carve_path([(4.5, 1.5), (4.5, 4.0)], 1.4)
    return Place(canvas.world("tee"), START)


@dataclass
class Owner:
    """Asks for a patrol when all is explored, and pulls the plug when so many vertices are left."""

    count: int = 2
    rounds: int = 0  # before the one in which that is
    ends: list[int] = field(default_factory=list)
    left: tuple[int, ...] = ()  # of the round, when the plug was pulled
    since: float | None = None  # stamp when that was all that was left

    def sends_it(self, session: Session, now: float) -> bool:
        pipeline = session.pipeline
        errands, graph = pipeline.errands, pipeline.mapper.graph
        if not explored(session):
            return False
        if errands.errand is None:
            self.ends = [vertex.id for vertex in graph.vertices.values() if vertex.degree == 1]
            errands.patrol(tuple(self.ends), now)
        kept = errands.kept()
        assert kept is not None
        self.left = kept.left
        if kept.rounds != self.rounds or len(kept.left) != self.count:
            return False
        self.since = self.since or now
        return now > self.since + SNAPSHOT_EVERY + 1.0  # so that it has been kept


def told(out: Path, event: str) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    return [line for line in lines if line["event"] == event]


def rounds(out: Path) -> list[tuple[int, int, int]]:
    found = told(out, "round_ended")
    return [(line["round"], line["reached"], line["missed"]) for line in found]


def check_forgotten(lives: Lives, last: Session) -> None:
    """Of the rounds only the latest part is kept, on disk, too; the map stands where it stood."""
    pipeline, explored_by = (
        last.pipeline,
        {line["kept"] for line in told(lives.out, "way_forgotten")},
    )
    (lasting,) = explored_by
    assert len(told(lives.out, "way_forgotten")) > 2
    assert pipeline.past.lasting == lasting < len(pipeline.past.keyframes) <= lasting + LATEST
    assert len(pipeline.past.steps) == len(pipeline.past.keyframes) - 1
    saved = MissionFiles(lives.out).read()
    assert saved is not None
    assert packed(saved.past) == packed(growth(pipeline))
    assert packed(saved.memory) == packed(remember(pipeline))
    assert saved.journey.stamps == last.journey.stamps
    ((x, y),) = vertices(lives.out)["meetpoint"]
    assert math.dist(START.transform(np.array([x, y])), CROSSING) < 0.15


def test_a_patrol_goes_on_with_what_was_left_of_its_round(tmp_path: Path) -> None:
    owner, config = Owner(rounds=1), Config(twin=TWIN, autonomy=AUTONOMY)
    lives = Lives(config, tee(), tmp_path, over=lambda _: len(rounds(tmp_path)) == 2)
    last = lives.run([owner.sends_it])
    assert len(owner.ends) == 3
    assert last.pipeline.errands.errand == Patrol(tuple(owner.ends))
    assert owner.left == tuple(owner.ends[1:])
    # Of the second round one vertex was visited before, and two after the restart.
    assert rounds(tmp_path) == [(1, 3, 0), (2, 2, 0)]
    assert lives.world.body.contacts == 0
    check_forgotten(lives, last)


@pytest.mark.parametrize("dead_s", [3.0, UNSURE], ids=["wheels counted on", "perhaps carried"])
def test_a_robot_that_had_finished_can_be_sent_about_after_a_restart(
    tmp_path: Path, dead_s: float
) -> None:
    """It stands until it is asked to explore: that lets it find its place, and whatever then is."""
    refused: list[str] = []
    finished: list[float] = []

    def dies(session: Session, now: float) -> bool:
        if explored(session):
            finished.append(now)
        return bool(finished) and now > finished[0] + SNAPSHOT_EVERY + 1.0

    def is_there(session: Session) -> bool:
        pipeline = session.pipeline
        if session is lives.sessions[0] or not explored(session):
            return False
        errands, stamp = pipeline.errands, pipeline.past.keyframes[-1].stamp
        x, y = START.inverse().transform(np.array(ARM)).tolist()
        if not refused:
            with pytest.raises(Declined) as caught:
                errands.goto_point(x, y, stamp)
            refused.append(str(caught.value))
            errands.explore(stamp)
        elif not errands.is_waiting and errands.errand is None:
            errands.goto_point(x, y, stamp)
        return errands.is_waiting

    config = Config(twin=TWIN, autonomy=AUTONOMY)
    lives = Lives(config, tee(), tmp_path, dead_s=dead_s, over=is_there)
    last = lives.run([dies])
    assert "ask it to explore" in refused[0]
    assert not last.pipeline.is_lost
    assert len(last.pipeline.mapper.graph.vertices) == 4
    body = lives.world.body
    assert math.dist((body.pose.x, body.pose.y), ARM) < 0.3
    assert body.contacts == 0


def cross() -> Place:
    """Four equal arms: no drive can tell one from another."""
    canvas = Canvas(9.0, 9.0)
    canvas.carve_path([(2.0, 4.5), (7.0, 4.5)], 1.4)
    canvas.carve_path([(4.5, 2.0), (4.5, 7.0)], 1.4)
    return Place(canvas.world("cross"), Pose(2.5, 4.5, 0.1))


def test_a_robot_with_an_errand_stands_where_it_cannot_find_its_place(tmp_path: Path) -> None:
    """And keeps the errand, for when it is started where it stopped."""
    owner, failed = Owner(count=4), list[tuple[float, Pose]]()

    def stands_for_a_while(session: Session) -> bool:
        if len(lives.sessions) == 1 or session.pipeline.mission.outcome != "failed":
            return False
        failed.append((lives.world.body.distance_m, lives.world.body.pose))
        return len(failed) > 30

    config = Config(twin=TWIN, autonomy=AUTONOMY)
    lives = Lives(config, cross(), tmp_path, dead_s=UNSURE, over=stands_for_a_while)
    last = lives.run([owner.sends_it])
    assert len(owner.ends) == 4
    assert "looks the same from 4 places" in told(tmp_path, "finished")[-1]["reason"]
    assert failed[-1] == failed[10]  # it rolls to a stop
    assert _phase(last.pipeline, None) == "finished"
    assert last.pipeline.errands.errand == Patrol(tuple(owner.ends))
    with pytest.raises(Declined, match="asked to explore"):
        last.pipeline.errands.home(0.0)
    last.pipeline.errands.pause()
    assert "asked to explore" in last.pipeline.errands.resume()
    last.pipeline.errands.explore(0.0)
    assert not last.pipeline.errands.is_resting


@pytest.mark.parametrize("ends", ["after an errand", "paused on patrol"])
def test_a_map_that_is_lent_lends_nothing_that_was_asked_for(tmp_path: Path, ends: str) -> None:
    """Who begins with the map of a run explores, whatever that run was about when it ended."""
    config = Config(twin=TWIN, autonomy=AUTONOMY)

    def is_over(session: Session) -> bool:
        errands = session.pipeline.errands
        if explored(session) and not errands.is_waiting and errands.errand is None:
            stamp = session.pipeline.past.keyframes[-1].stamp
            if ends == "paused on patrol":
                errands.patrol((), stamp)
                errands.pause()
            else:
                errands.goto_point(1.0, 0.0, stamp)
        return errands.is_waiting or errands.is_paused

    Lives(config, tee(), tmp_path / "known", over=is_over).run([])
    last = Lives(config, tee(), tmp_path / "run", known=tmp_path / "known").run([])
    assert last.pipeline.mission.outcome == "explored"
    assert not last.pipeline.is_lost


def test_a_robot_that_waits_and_looks_for_its_place_waits_after_a_restart(tmp_path: Path) -> None:
    """It had been sent back before it had explored all, and was asked to look around there."""
    asked: list[float] = []  # stamps, of being sent, of standing there, of looking around

    def pulls_the_plug(session: Session, now: float) -> bool:
        errands = session.pipeline.errands
        if not asked and session.pipeline.mapper.graph.frontiers():
            with contextlib.suppress(Declined):  # it has not seen enough yet
                errands.goto_point(0.0, 0.0, now)
                asked.append(now)
        elif len(asked) == 1 and errands.is_waiting:
            asked.append(now)
        elif len(asked) == 2 and now > asked[1] + 2 * SNAPSHOT_EVERY:
            errands.relocalise(now)
            asked.append(now)
        return len(asked) == 3 and now > asked[2] + 2.0

    def is_over(session: Session) -> bool:
        lives = len(robot.sessions)
        return lives == 2 and session.pipeline.errands.is_resting

    robot = Lives(Config(twin=TWIN, autonomy=AUTONOMY), tee(), tmp_path, over=is_over)
    last = robot.run([pulls_the_plug])
    assert last.pipeline.errands.is_waiting
    assert last.pipeline.mission.outcome is None


def test_who_is_told_that_the_robot_stands_can_pull_the_plug_at_once(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, tee())
    keeper = Keeper(daemon.session, MissionFiles(tmp_path))
    daemon.robot = Robot(
        daemon.session, daemon.manager, daemon.network, off_loop=at_once, keeper=keeper
    )

    async def story(clock: Clock) -> None:
        await clock.sleep_until(4.1)
        assert (await daemon.network.ask("pause")).done
        saved = MissionFiles(tmp_path).read()
        assert saved is not None
        assert saved.memory.intent.is_paused

    with daemon.session.directory:
        daemon.run(story)
