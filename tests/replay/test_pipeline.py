"""A recorded sequence of HAL messages drives a fresh pipeline to the same bits.

And a mind that was kept and recalled goes on as one whose devices were silent for a while.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from gvgbot import driving
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Event, LoopClosed
from gvgbot.autonomy.memory import Growth, Memory, growth, recall, remember
from gvgbot.autonomy.passed import Passed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import without_trail
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.links import Devices, Links
from gvgbot.maps import geojson
from gvgbot.persistence.records import packed, unpacked
from gvgbot.report import route_graph
from gvgbot.simulation import Place, Simulation
from tests.twin.lollipop_rig import lollipop

pytestmark = pytest.mark.slow

Message = Scan | tuple[Odometry, Felt]
Answer = list[Event] | Twist
NOTHING_FELT = Felt()
SILENCE = 1.2  # s, longer than any keyframe interval
MOMENTS = (0.2, 0.7)  # shares of the drive
# A dead end that leads to a ring of corridors: a meetpoint, an endpoint, and a loop to close.
LOLLIPOP = lollipop(1.0, -6.0, 9.0)
START = Pose(-3.5, -0.1, 0.2)


class RecordedPipeline(Pipeline):
    """Takes down each message that it gets, and what it answers."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.autonomy, config.exploration, config.robot.radius_m)
        self.messages: list[Message] = []
        self.answers: list[Answer] = []

    def perceive(self, scan: Scan) -> list[Event]:
        answer = super().perceive(scan)
        self.messages.append(scan)
        self.answers.append(answer)
        return answer

    def control(self, odometry: Odometry, felt: Felt = NOTHING_FELT) -> Twist:
        answer = super().control(odometry, felt)
        self.messages.append((odometry, felt))
        self.answers.append(answer)
        return answer


def events_of(pipeline: RecordedPipeline) -> list[Event]:
    return [event for answer in pipeline.answers if isinstance(answer, list) for event in answer]


def fed(pipeline: Pipeline, messages: list[Message]) -> Pipeline:
    for message in messages:
        if isinstance(message, Scan):
            pipeline.perceive(message)
        else:
            pipeline.control(*message)
    return pipeline


@dataclass(frozen=True)
class Drive:
    """A drive through the twins."""

    config: Config
    pipeline: RecordedPipeline
    ranges: list[Array]  # of its scans, as they were then


async def drive_through_the_twins(config: Config, pipeline: Pipeline) -> None:
    clock = LoopClock()
    simulation = Simulation(config, Place(LOLLIPOP, START), clock)
    await driving.drive(config.robot, Devices(Links(config, clock, simulation)), pipeline)


@pytest.fixture(scope="module")
def drive() -> Drive:
    config = load_config()
    pipeline = RecordedPipeline(config)
    run_in_virtual_time(drive_through_the_twins(config, pipeline))
    scans = [message for message in pipeline.messages if isinstance(message, Scan)]
    return Drive(config, pipeline, [scan.ranges.copy() for scan in scans])


@pytest.fixture(scope="module")
def again(drive: Drive) -> RecordedPipeline:
    """The same messages, to a fresh mind."""
    pipeline = RecordedPipeline(drive.config)
    fed(pipeline, drive.pipeline.messages)
    return pipeline


def test_the_recorded_drive_is_a_whole_exploration(drive: Drive) -> None:
    assert drive.pipeline.mission.outcome == "explored"
    assert len(drive.pipeline.mapper.graph.vertices) == 2
    assert len(drive.pipeline.mapper.graph.edges) == 2
    assert any(isinstance(event, LoopClosed) for event in events_of(drive.pipeline))


def test_a_replay_answers_every_message_with_the_same_twist_and_events(
    drive: Drive, again: RecordedPipeline
) -> None:
    assert again.answers == drive.pipeline.answers


def test_a_replay_leaves_the_same_map_to_the_last_bit(
    drive: Drive, again: RecordedPipeline
) -> None:
    first = drive.pipeline
    one, other = first.mapper.belief, again.mapper.belief
    assert one.ids == other.ids
    assert one.x.tobytes() == other.x.tobytes()
    assert one.P.tobytes() == other.P.tobytes()
    maps = [geojson.encode(route_graph(p, *smoothed(p)[1:])) for p in (first, again)]
    assert maps[0] == maps[1]


def test_a_replay_makes_the_same_keyframes(drive: Drive, again: RecordedPipeline) -> None:
    assert len(again.past.keyframes) == len(drive.pipeline.past.keyframes)
    for one, other in zip(again.past.keyframes, drive.pipeline.past.keyframes, strict=True):
        assert one.local_base == other.local_base
        assert one.map_base == other.map_base
        assert (one.scan is None) == (other.scan is None)
        if one.scan is not None and other.scan is not None:
            assert one.scan.stamp == other.scan.stamp
            assert one.scan.unpacked().ranges.tobytes() == other.scan.unpacked().ranges.tobytes()


def test_messages_are_only_read(drive: Drive, again: RecordedPipeline) -> None:
    scans = [message for message in again.messages if isinstance(message, Scan)]
    for scan, ranges in zip(scans, drive.ranges, strict=True):
        assert np.array_equal(scan.ranges, ranges, equal_nan=True)
        assert not scan.ranges.flags.writeable


def test_a_range_that_differs_by_a_centimetre_is_another_drive(drive: Drive) -> None:
    """The comparison above is fine enough to see it."""
    fresh, beginning = RecordedPipeline(drive.config), 500  # messages: nine seconds
    for message in drive.pipeline.messages[:beginning]:
        if isinstance(message, tuple):
            fresh.control(*message)
        else:
            nearer = message.ranges - 0.01 * (message.stamp > 3.0)
            fresh.perceive(replace(message, ranges=nearer))
    assert fresh.answers != drive.pipeline.answers[:beginning]


def test_a_message_too_many_after_the_end_changes_nothing(
    drive: Drive, again: RecordedPipeline
) -> None:
    last = next(m for m in reversed(drive.pipeline.messages) if isinstance(m, Scan))
    belief = again.mapper.belief
    assert again.perceive(last) == []
    assert again.mapper.belief is belief


def test_no_twist_is_beyond_the_limits_of_the_follower(drive: Drive) -> None:
    limits = drive.config.autonomy.edge_follower
    twists = [answer for answer in drive.pipeline.answers if isinstance(answer, Twist)]
    assert max(abs(t.linear) for t in twists) <= limits.max_speed_mps
    assert max(abs(t.angular) for t in twists) <= limits.max_turn_rate_radps


# -- kept and recalled -----------------------------------------------------------------------------


def stamp(message: Message) -> float:
    return message.stamp if isinstance(message, Scan) else message[0].stamp


def fresh(config: Config) -> Pipeline:
    return Pipeline(config.autonomy, config.exploration, config.robot.radius_m)


def everything(pipeline: Pipeline) -> bytes:
    return packed((remember(pipeline), growth(pipeline)))


def kept(pipeline: Pipeline) -> tuple[Memory, list[Growth]]:
    return (
        unpacked(packed(remember(pipeline)), Memory),
        unpacked(packed(growth(pipeline)), list[Growth]),
    )


def test_a_restart_is_no_more_than_a_silence_and_another_one_neither(drive: Drive) -> None:
    """To the last bit of belief, graph, maps and past; nothing durable may be forgotten."""
    messages = drive.pipeline.messages
    moments = [int(share * len(messages)) for share in MOMENTS]
    lived = restarted = fed(fresh(drive.config), messages[: moments[0]])
    for at, end in pairwise([*moments, len(messages)]):
        mind, restarted = restarted, fresh(drive.config)
        recall(restarted, *kept(mind))
        later = [m for m in messages[at:end] if stamp(m) > stamp(messages[at]) + SILENCE]
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
    drive: Drive,
) -> None:
    """Place, belief and distance are as they were; a map of fewer scans is a map of fewer scans."""
    config, messages = drive.config, drive.pipeline.messages
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


@pytest.fixture(scope="module")
def lived(drive: Drive) -> Pipeline:
    """A mind on its way; only looked at."""
    messages = drive.pipeline.messages
    return fed(fresh(drive.config), messages[: int(0.6 * len(messages))])


@pytest.mark.parametrize("left", [0, 1, 30])
def test_without_its_latest_past_a_mind_still_knows_its_map_and_its_place(
    drive: Drive, lived: Pipeline, left: int
) -> None:
    memory, past = kept(lived)
    restarted = fresh(drive.config)
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
