"""A robot that is killed while it does what somebody asked for, and goes on with it."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from gvgbot.autonomy.errands.kinds import Patrol
from gvgbot.config import Config, TwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.geometry import Pose
from gvgbot.persistence.keeper import SNAPSHOT_EVERY
from gvgbot.session import Session
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas
from tests.twin.lives_rig import Lives, explored

pytestmark = [pytest.mark.twin, pytest.mark.slow, pytest.mark.timeout(300)]

TWIN = TwinConfig(base=KobukiTwinConfig(odometry="perfect"))


def tee() -> Place:
    """A corridor with a side arm: three dead ends and one crossing."""
    canvas = Canvas(9.0, 6.0)
    canvas.carve_path([(1.5, 1.5), (7.5, 1.5)], 1.4)
    canvas.carve_path([(4.5, 1.5), (4.5, 4.5)], 1.4)
    return Place(canvas.world("tee"), Pose(2.5, 1.5, 0.1))


@dataclass
class Owner:
    """Asks for a patrol when all is explored, and pulls the plug on the second round."""

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
        if kept.rounds != 1 or len(kept.left) != 2:
            return False
        self.since = self.since or now
        return now > self.since + SNAPSHOT_EVERY + 1.0  # so that it has been kept


def rounds(out: Path) -> list[tuple[int, int, int]]:
    lines = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    found = [line for line in lines if line["event"] == "round_ended"]
    return [(line["round"], line["reached"], line["missed"]) for line in found]


def test_a_patrol_goes_on_with_what_was_left_of_its_round(tmp_path: Path) -> None:
    owner = Owner()
    lives = Lives(Config(twin=TWIN), tee(), tmp_path, over=lambda _: len(rounds(tmp_path)) == 3)
    last = lives.run([owner.sends_it])
    assert len(owner.ends) == 3
    assert last.pipeline.errands.errand == Patrol(tuple(owner.ends))
    assert owner.left == tuple(owner.ends[1:])
    # Of the second round one vertex was visited before, and two after the restart.
    assert rounds(tmp_path) == [(1, 3, 0), (2, 2, 0), (3, 3, 0)]
    assert lives.world.body.contacts == 0
