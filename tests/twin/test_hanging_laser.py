"""A laser that hangs upside down, or looks ahead, and is not said to, or the other way round."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import structlog

from benchmarks.rigs import lives_rig, run_rig
from benchmarks.rigs.lives_rig import GoingWorld, Lives, at
from benchmarks.rigs.run_rig import STOP, Daemon, base_commands
from gvgbot import daemon as program
from gvgbot.autonomy.returning import ReturningPipeline
from gvgbot.cli import main
from gvgbot.clock import Clock
from gvgbot.config import Config, load_config
from gvgbot.persistence.mission_files import SNAPSHOT
from gvgbot.requests import Answer
from gvgbot.session import Session
from gvgbot.simulation import Place, Simulation
from tests.twin.test_errand_restarts import tee

pytestmark = [pytest.mark.slow, pytest.mark.twin]

Kill = Callable[[Session, float], bool]
MOVING = ("explore", "home", "goto", "patrol", "coverage", "relocalise")
LEFT_IS_RIGHT = "what is on the left of the robot counts as being on the right: "
SET_TRUE = f"{LEFT_IS_RIGHT}set laser.upside_down: true, and restart the program"
SET_FALSE = f"{LEFT_IS_RIGHT}set laser.upside_down: false, and restart the program"


def other_way_up(config: Config) -> Config:
    return replace(config, laser=replace(config.laser, upside_down=not config.laser.upside_down))


def turned_over(config: Config, place: Place, clock: Clock) -> Simulation:
    """A world in which the laser hangs the other way up than the configuration says."""
    return Simulation(other_way_up(config), place, clock)


def astern(config: Config) -> Config:
    return replace(config, laser=replace(config.laser, yaw_deg=180.0))


@pytest.mark.parametrize(("said", "to_be_set"), [("false", SET_TRUE), ("true", SET_FALSE)])
@pytest.mark.parametrize("model", ["UTM-30LX", "URG-04LX"])
def test_exploring_ends_in_the_first_turn_with_what_to_set(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    model: str,
    said: str,
    to_be_set: str,
) -> None:
    monkeypatch.setattr(program, "Simulation", turned_over)
    settings = [f"twin.laser.model={model}", f"laser.upside_down={said}"]
    arguments = [word for one in settings for word in ("--set", one)]
    assert main(["explore", *arguments, "--out", str(tmp_path / "run")]) == 1
    assert f"failed: {to_be_set}; " in capsys.readouterr().err
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["outcome"], summary["reason"]) == ("failed", to_be_set)
    assert summary["distance_m"] < 0.05
    assert summary["duration_s"] < 5.0
    last = json.loads((tmp_path / "run" / "events.jsonl").read_text().splitlines()[-1])
    assert (last["event"], last["reason"]) == ("finished", to_be_set)
    assert not (tmp_path / "run" / SNAPSHOT).exists()


def test_a_daemon_stands_whatever_is_asked_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_rig, "Simulation", turned_over)
    daemon, answers = Daemon(tmp_path / "run"), {}

    async def story(clock: Clock) -> None:
        await clock.sleep_until(10.0)
        wishes: dict[str, dict[str, Any]] = {"goto": {"x": 0.5, "y": 0.0}}
        for name in (*MOVING, "pause"):
            answers[name] = await daemon.network.ask(name, **wishes.get(name, {}))
        answers["resume"] = await daemon.network.ask("resume")
        await clock.sleep_until(40.0)

    with daemon.session.directory, structlog.testing.capture_logs() as logs:
        daemon.run(story)
    state = daemon.network.states[-1]
    assert (state.phase, state.outcome, state.reason) == ("finished", "failed", SET_TRUE)
    assert [one for one in logs if one["log_level"] == "error"] == [
        {"event": "finished", "outcome": "failed", "reason": SET_TRUE, "log_level": "error"}
    ]
    assert f"STATUS=failed: {SET_TRUE}; 0 vertices, 0 frontiers" in daemon.manager.told
    assert {name: answers[name] for name in MOVING} == dict.fromkeys(
        MOVING, Answer(False, SET_TRUE)
    )
    assert answers["resume"].text == f"it does not drive: {SET_TRUE}"
    late = base_commands(bytes(daemon.cable.written))[-1700:]  # of 50 a second
    assert set(late) == {STOP}


class Remounted(Lives):
    """A robot whose configuration is another one in each life; it stands a while in the end."""

    stood = 0

    def stands(self, session: Session) -> bool:
        self.stood = 0 if session.pipeline.mission.outcome is None else self.stood + 1
        return self.stood > 20

    def live_with(self, configs: list[Config], kills: list[Kill]) -> Session:
        def exchange(*_: object) -> None:
            self.stood, self.config = 0, rest.pop(0)

        rest, self.between, self.over = configs, exchange, self.stands
        return self.run(kills)


def never(session: Session, stamp: float) -> bool:
    return False


@pytest.mark.parametrize("wrong", [other_way_up, astern])
def test_what_was_mapped_by_then_is_no_map_to_go_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: Callable[[Config], Config]
) -> None:
    config = load_config(None, ["twin.seed=1"])
    monkeypatch.setattr(lives_rig, "GoingWorld", lambda _, *there: GoingWorld(config, *there))
    lives = Remounted(wrong(config), tee(), tmp_path)
    last = lives.live_with([config], [never])
    assert [one.pipeline.mission.outcome for one in lives.sessions] == ["failed", "explored"]
    assert not isinstance(last.pipeline, ReturningPipeline)


@pytest.mark.parametrize(
    ("wrong", "why", "reboots"),
    [
        (other_way_up, LEFT_IS_RIGHT, False),
        (other_way_up, LEFT_IS_RIGHT, True),
        (astern, "the laser does not see where the robot drives", False),
    ],
)
def test_a_map_of_before_is_gone_on_with_when_it_is_set_right(
    tmp_path: Path, wrong: Callable[[Config], Config], why: str, *, reboots: bool
) -> None:
    config = load_config(None, ["twin.seed=1"])
    lives = Remounted(config, tee(), tmp_path, reboots=reboots)
    last = lives.live_with([wrong(config), config], [at(8.0), never])
    before, unfit, _ = lives.sessions
    assert len(before.pipeline.mapper.graph.vertices) > 0
    assert before.pipeline.mission.outcome is None
    assert before.pipeline._defects._handedness.is_settled
    assert unfit.pipeline.errands.unfit.startswith(why)
    assert isinstance(last.pipeline, ReturningPipeline)
    assert not last.pipeline.is_lost
    assert last.pipeline.mission.outcome == "explored"
    assert len(last.pipeline.mapper.graph.vertices) == 4
