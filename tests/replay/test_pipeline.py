"""A recorded sequence of HAL messages drives a fresh pipeline to the same bits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from gvgbot import driving
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Event, LoopClosed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.links import Devices, Links
from gvgbot.maps import geojson
from gvgbot.report import route_graph
from gvgbot.simulation import Place, Simulation
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.timeout(60)]

Message = Scan | tuple[Odometry, Felt]
Answer = list[Event] | Twist
NOTHING_FELT = Felt()
# A dead end that leads to a ring of corridors: a meetpoint, an endpoint, and a loop to close.
LOLLIPOP = carved(
    [
        (-6.0, -1.0, 0.0, 1.0),
        (-1.0, -1.0, 9.0, 1.0),
        (-1.0, 7.0, 9.0, 9.0),
        (-1.0, -1.0, 1.0, 9.0),
        (7.0, -1.0, 9.0, 9.0),
    ]
)
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
    fresh = RecordedPipeline(drive.config)
    for message in drive.pipeline.messages:
        if isinstance(message, Scan):
            fresh.perceive(message)
        else:
            fresh.control(*message)
    return fresh


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
