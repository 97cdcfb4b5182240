"""A mind that was kept and recalled goes on as one whose devices were silent for a while."""

import numpy as np
import pytest

from gvgbot.autonomy.memory import Growth, Memory, growth, recall, remember
from gvgbot.autonomy.passed import Passed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import without_trail
from gvgbot.clock import run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.hal.messages import Scan
from gvgbot.persistence.records import packed, unpacked
from tests.replay.test_pipeline import Message, RecordedPipeline, drive_through_the_twins

pytestmark = [pytest.mark.slow, pytest.mark.timeout(60)]

SILENCE = 1.2  # s, longer than any keyframe interval
MOMENTS = (0.2, 0.7)  # shares of the drive


@pytest.fixture(scope="module")
def drive() -> tuple[Config, list[Message]]:
    config = load_config()
    pipeline = RecordedPipeline(config)
    run_in_virtual_time(drive_through_the_twins(config, pipeline))
    return config, pipeline.messages


def stamp(message: Message) -> float:
    return message.stamp if isinstance(message, Scan) else message[0].stamp


def fed(pipeline: Pipeline, messages: list[Message]) -> Pipeline:
    for message in messages:
        if isinstance(message, Scan):
            pipeline.perceive(message)
        else:
            pipeline.control(*message)
    return pipeline


def fresh(config: Config) -> Pipeline:
    return Pipeline(config.autonomy, config.exploration, config.robot.radius_m)


def everything(pipeline: Pipeline) -> bytes:
    return packed((remember(pipeline), growth(pipeline)))


def kept(pipeline: Pipeline) -> tuple[Memory, list[Growth]]:
    return (
        unpacked(packed(remember(pipeline)), Memory),
        unpacked(packed(growth(pipeline)), list[Growth]),
    )


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_restart_is_no_more_than_a_silence(
    drive: tuple[Config, list[Message]], moment: float
) -> None:
    """To the last bit of belief, graph, maps and past; nothing durable may be forgotten."""
    config, messages = drive
    at = int(moment * len(messages))
    later = [m for m in messages[at:] if stamp(m) > stamp(messages[at]) + SILENCE]
    lived = fed(fresh(config), messages[:at])
    restarted = fresh(config)
    recall(restarted, *kept(lived))
    assert everything(fed(restarted, later)) == everything(fed(lived, later))
    assert len(restarted.past.keyframes) > 50


def test_who_was_passed_is_looked_at_again_by_whoever_was_restarted() -> None:
    config = load_config()
    lived, restarted = fresh(config), fresh(config)
    lived.traffic.passed = [Passed(7, np.array([1.0, 2.0]), 0.1)]
    recall(restarted, *kept(lived))
    assert packed(restarted.traffic.passed) == packed(lived.traffic.passed)


def test_what_an_older_version_learnt_of_the_noise_is_learnt_anew() -> None:
    """It kept three factors."""
    lived, restarted = fresh(load_config()), fresh(load_config())
    lived.tracker.maps.calibration.x = np.array([0.01, 0.0, 0.0])
    lived.tracker.maps.calibration.noise, lived.tracker.maps.calibration.told = np.full((2, 3), 0.1)
    recall(restarted, *kept(lived))
    calibration = restarted.tracker.maps.calibration
    assert calibration.x[0] == 0.01
    assert np.array_equal(calibration.noise, fresh(load_config()).tracker.maps.calibration.noise)


def test_what_the_journal_says_after_the_snapshot_is_lived_again(
    drive: tuple[Config, list[Message]],
) -> None:
    """Place, belief and distance are as they were; a map of fewer scans is a map of fewer scans."""
    config, messages = drive
    at = int(0.55 * len(messages))
    lived = fed(fresh(config), messages[:at])
    memory, _ = kept(lived)
    stamps = [stamp(m) for m in messages]
    fed(lived, messages[at : next(i for i, s in enumerate(stamps) if s > stamps[at] + 4.0)])
    restarted = fresh(config)
    recall(restarted, memory, kept(lived)[1])
    assert len(restarted.past.keyframes) == len(lived.past.keyframes) > memory.keyframes
    assert restarted.past.travelled == pytest.approx(lived.past.travelled, abs=0.05)
    one, other = restarted.mapper.belief, without_trail(lived.mapper.belief)
    assert one.ids == other.ids
    assert one.x == pytest.approx(other.x, abs=1e-9)
    assert pytest.approx(other.P[3:, 3:], abs=1e-12) == one.P[3:, 3:]
    # the old poses are gone that would tell the covariance of the way since then
    assert np.sqrt(np.diag(one.P)) == pytest.approx(np.sqrt(np.diag(other.P)), rel=0.1)
    assert restarted.map_base.distance(lived.mapper.belief.map_base) < 1e-9


@pytest.mark.parametrize("left", [0, 1, 30])
def test_without_its_latest_past_a_mind_still_knows_its_map_and_its_place(
    drive: tuple[Config, list[Message]], left: int
) -> None:
    config, messages = drive
    lived = fed(fresh(config), messages[: int(0.6 * len(messages))])
    memory, past = kept(lived)
    restarted = fresh(config)
    recall(restarted, memory, past[:left])
    believed = without_trail(lived.mapper.belief)  # whose old poses are not kept
    assert restarted.mapper.belief.x.tobytes() == believed.x.tobytes()
    assert restarted.mapper.belief.P.tobytes() == believed.P.tobytes()
    assert restarted.mapper.belief.trail == ()
    assert restarted.map_base.distance(lived.mapper.belief.map_base) < 1e-9
    assert restarted.past.last is not None
    assert lived.past.last is not None
    assert restarted.past.last.local_base == lived.past.last.local_base
    assert len(restarted.past.steps) == len(restarted.past.keyframes) - 1
    seen = {observation.vertex for observation in restarted.mapper.observations}
    assert seen == set(lived.mapper.belief.ids)
    numbers = [observation.keyframe for observation in restarted.mapper.observations]
    assert max(numbers) < len(restarted.past.keyframes)
