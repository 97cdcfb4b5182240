"""What travels on the network can be read by any program, and who may connect is configured."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import msgspec
import numpy as np
import pytest
import zenoh

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.pose_tracking import PoseTracker
from gvgbot.autonomy.slam.ekf import Belief, OdometryNoise
from gvgbot.config import load_config
from gvgbot.errors import ConfigError
from gvgbot.geometry import STANDSTILL, Array, Pose
from gvgbot.hal.messages import Odometry
from gvgbot.snapshots import pose_covariance
from gvgbot.telemetry import _session_config
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    STATE,
    TOPICS,
    LinkHealth,
    State,
    alive_key,
)

EXAMPLE = State(
    stamp=12.5,
    sequence=7,
    cycles=600,
    cycle_age=0.02,
    phase="exploring",
    outcome=None,
    reason="",
    errand=None,
    requests=("pause", "goto"),
    uptime=12.0,
    pose=(1.0, -2.0, 0.5),
    covariance=(1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0),
    twist=(0.25, -0.1),
    battery_voltage=16.1,
    battery_fraction=0.9,
    vertices=3,
    edges=2,
    frontiers=4,
    distance=31.5,
    guard=None,
    contacts=1,
    slips=2,
    laser=LinkHealth(
        connected=True, messages=100, damaged=3, lost=4, reconnects=0, clock_offset=-2.5
    ),
    base=LinkHealth(
        connected=False, messages=500, damaged=0, lost=9, reconnects=2, clock_offset=None
    ),
)
NOWHERE = (1e6, 0.0, 0.0, 0.0, 1e6, 0.0, 0.0, 0.0, 1e6)  # the covariance of an unknown pose
PLAIN = {
    "stamp": 12.5,
    "sequence": 7,
    "cycles": 600,
    "cycle_age": 0.02,
    "phase": "exploring",
    "outcome": None,
    "reason": "",
    "errand": None,
    "requests": ["pause", "goto"],
    "uptime": 12.0,
    "pose": [1.0, -2.0, 0.5],
    "covariance": [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0],
    "twist": [0.25, -0.1],
    "battery_voltage": 16.1,
    "battery_fraction": 0.9,
    "vertices": 3,
    "edges": 2,
    "frontiers": 4,
    "distance": 31.5,
    "guard": None,
    "contacts": 1,
    "slips": 2,
    "laser": {
        "connected": True,
        "messages": 100,
        "damaged": 3,
        "lost": 4,
        "reconnects": 0,
        "clock_offset": -2.5,
    },
    "base": {
        "connected": False,
        "messages": 500,
        "damaged": 0,
        "lost": 9,
        "reconnects": 2,
        "clock_offset": None,
    },
    "team": [],
}


def test_a_state_is_a_messagepack_map_that_needs_no_schema() -> None:
    data = msgspec.msgpack.encode(EXAMPLE)
    assert msgspec.msgpack.decode(data) == PLAIN


def test_the_bytes_of_a_state_are_as_the_messagepack_specification_has_them() -> None:
    data = msgspec.msgpack.encode(EXAMPLE)
    assert data[:3] == b"\xde" + len(PLAIN).to_bytes(2, "big")  # map 16
    assert b"\xa8sequence\x07" in data  # fixstr of 8, positive fixint
    assert b"\xa6cycles\xcd\x02\x58" in data  # fixstr of 6, uint 16
    assert b"\xa5stamp\xcb\x40\x29\0\0\0\0\0\0" in data  # float 64: 12.5 = 1.5625 * 2^3
    assert b"\xa5guard\xc0" in data  # nil


def test_a_state_survives_its_journey() -> None:
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(EXAMPLE), type=State) == EXAMPLE


def test_a_state_as_json_is_read_by_any_json_reader() -> None:
    assert json.loads(msgspec.json.encode(EXAMPLE)) == PLAIN


def test_the_table_s_keys_are_distinct_and_fit_for_the_network() -> None:
    keys = [topic.key("turtle_2-b") for topic in TOPICS] + [alive_key("turtle_2-b")]
    assert len(set(keys)) == len(keys)
    for key in keys:
        assert str(zenoh.KeyExpr(key)) == key
        assert key.startswith("gvgbot/turtle_2-b/")


def test_the_state_topic_is_the_promised_one() -> None:
    assert STATE.key("r") == "gvgbot/r/state"
    assert alive_key("r") == "gvgbot/r/alive"
    assert STATE.encoding == "application/msgpack;gvgbot.State.v1"
    assert STATE.rate_hz == 10.0
    assert STATE.queryable


@pytest.mark.parametrize(("relays", "mode"), [(False, "peer"), (True, "router")])
def test_a_session_listens_where_it_is_told_and_is_not_found_by_shouting(
    relays: bool, mode: str
) -> None:
    config = TelemetryConfig(listen=("tcp/127.0.0.1:7000",), lease_s=1.5)
    session = _session_config(config, relays=relays)
    told = {
        "mode": mode,
        "listen/endpoints": ["tcp/127.0.0.1:7000"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": 1500,
    }
    assert {key: json.loads(session.get_json(key)) for key in told} == told


def test_by_default_only_this_machine_can_watch() -> None:
    assert all("/127.0.0.1:" in endpoint for endpoint in load_config().telemetry.listen)


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("telemetry.listen=[nonsense]", "nonsense"),
        ("telemetry.listen=[tcp/]", "tcp/"),
        ("telemetry.listen=[tcp/127.0.0.1]", "host:port"),
        ("telemetry.connect=[tcp/127.0.0.1:65536]", "host:port"),
        ("telemetry.connect=['tls/[::1]']", "host:port"),
        ("ros2.connect=[localhost]", "localhost"),
        ("ros2.listen=[tcp/127.0.0.1]", "host:port"),
        ("telemetry.listen=[]", "enabled: false"),
        ("telemetry.listen=tcp/127.0.0.1:7447", "a list"),
        ("telemetry.lease_s=0", "from 0.5 to 60"),
    ],
)
def test_a_wrong_address_is_named_before_anything_starts(override: str, named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        load_config(None, [override])


NOISELESS = OdometryNoise(
    along_m_per_sqrt_m=0.0,
    along_m_per_sqrt_rad=0.0,
    turn_rad_per_sqrt_rad=0.0,
    turn_rad_per_sqrt_m=0.0,
    turn_rad_per_sqrt_s=0.0,
)
BELIEF = Belief(np.array([3.0, 1.0, 0.7]), np.diag([0.04, 0.01, 0.02]))


def mind(belief: Belief, keyframe: Pose | None) -> Pipeline:
    """As much of a pipeline as its covariance needs."""
    last = None if keyframe is None else SimpleNamespace(odom_base=keyframe, stamp=1.0)
    mapper, past = SimpleNamespace(belief=belief), SimpleNamespace(last=last)
    tracker = PoseTracker(AutonomyConfig(), matches_walls=True)
    return cast(Pipeline, SimpleNamespace(mapper=mapper, past=past, tracker=tracker, is_lost=False))


def test_without_a_keyframe_the_covariance_is_the_belief_s() -> None:
    now = Odometry(1.5, Pose(2.0, 0.0, 0.0), STANDSTILL)
    assert pose_covariance(mind(BELIEF, None), now, NOISELESS) == pytest.approx(BELIEF.P)
    assert pose_covariance(mind(BELIEF, Pose()), None, NOISELESS) == pytest.approx(BELIEF.P)


def test_of_a_robot_that_does_not_know_its_place_the_pose_says_nothing() -> None:
    """Wherever in a building it is, that is within one sigma of the pose."""
    here, kilometre = mind(BELIEF, Pose()), 1e3
    assert not state_with(pose_covariance(here, None, NOISELESS)).is_lost
    lost = cast(Pipeline, SimpleNamespace(mapper=here.mapper, is_lost=True))
    covariance = pose_covariance(lost, None, NOISELESS)
    assert np.sqrt(np.linalg.eigvalsh(covariance)[0]) == pytest.approx(kilometre)
    assert state_with(covariance).is_lost


def state_with(covariance: Array) -> State:
    return msgspec.structs.replace(EXAMPLE, covariance=tuple(covariance.ravel().tolist()))


def test_a_wrong_heading_puts_the_robot_to_the_side_as_it_goes_on() -> None:
    """Points drawn from the belief and moved ahead scatter as the covariance says."""
    start, ahead = Pose(5.0, 5.0, 1.0), Pose(0.4, 0.1, 0.3)
    belief = replace(BELIEF, P=np.diag([0.004, 0.001, 0.002]))
    now = Odometry(1.5, start.compose(ahead), STANDSTILL)
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(belief.x, belief.P, 100_000)
    c, s = np.cos(drawn[:, 2]), np.sin(drawn[:, 2])
    x = drawn[:, 0] + c * ahead.x - s * ahead.y
    y = drawn[:, 1] + s * ahead.x + c * ahead.y
    sampled = np.cov(np.stack([x, y, drawn[:, 2] + ahead.theta]))
    found = pose_covariance(mind(belief, start), now, NOISELESS)
    assert found == pytest.approx(sampled, rel=0.03, abs=2e-5)


@pytest.mark.parametrize(("turns_rad", "sigma_rad"), [(1e-4, 0.01 * 10.0), (0.0, 0.01 * 2.0**0.5)])
def test_the_covariance_grows_with_time_while_the_gyro_tells_of_turns(
    turns_rad: float, sigma_rad: float
) -> None:
    """A gyro that drifts shows it within two seconds: one that shows nothing does not drift."""
    drifting, robot = replace(NOISELESS, turn_rad_per_sqrt_s=0.01), mind(BELIEF, Pose())
    for second in range(1, 102):
        turned = Pose(0.0, 0.0, turns_rad * (second % 2))
        robot.tracker.odometry.append(Odometry(float(second), turned, STANDSTILL))
    found = pose_covariance(robot, robot.tracker.odometry.newest, drifting)
    assert math.sqrt(found[2, 2] - BELIEF.P[2, 2]) == pytest.approx(sigma_rad, rel=1e-3)
