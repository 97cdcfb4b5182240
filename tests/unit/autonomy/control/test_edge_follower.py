"""Following an edge, with a robot that does at once what it is told and one that takes its time."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gvgbot.autonomy.control.edge_follower import EdgeFollowerConfig, Track, follow
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist, wrap_angle

RADIUS = 0.177
PERIOD = 0.02  # s
CONFIG = EdgeFollowerConfig()


def straight(length: float, clearance: float = 2.0) -> Track:
    x = np.arange(0.0, length + 0.05, 0.1)
    return Track.of(np.stack([x, 0 * x], axis=1), np.full(len(x), clearance))


def bent(angle: float, clearance: float = 2.0) -> Track:
    """Three metres along x, then three metres turned by an angle."""
    along = np.arange(0.0, 3.0, 0.1)
    first = np.stack([along, 0 * along], axis=1)
    rest = np.arange(0.0, 3.05, 0.1)[:, None] * [math.cos(angle), math.sin(angle)] + [3.0, 0.0]
    line = np.concatenate([first, rest])
    return Track.of(line, np.full(len(line), clearance))


@dataclass(frozen=True)
class Drive:
    """Poses and twists of a simulated drive, one per control period."""

    poses: list[Pose]
    twists: list[Twist]

    @property
    def places(self) -> Array:
        return np.array([[p.x, p.y] for p in self.poses])


def driven(track: Track, pose: Pose, duration: float, acceleration: float = math.inf) -> Drive:
    """The drive of a unicycle whose speeds follow the command as its acceleration allows."""
    poses, twists = [pose], []
    linear = angular = 0.0
    for _ in range(round(duration / PERIOD)):
        twist = follow(track, poses[-1], linear, RADIUS, CONFIG)
        most = acceleration * PERIOD
        linear += float(np.clip(twist.linear - linear, -most, most))
        angular += float(np.clip(twist.angular - angular, -6 * most, 6 * most))
        motion = Pose(linear * PERIOD, 0.0, angular * PERIOD)
        poses.append(poses[-1].compose(motion))
        twists.append(twist)
    return Drive(poses, twists)


@pytest.mark.parametrize("offset", [0.3, -0.3, 0.1])
@pytest.mark.parametrize("heading", [0.0, 0.6, -0.6])
@pytest.mark.parametrize("acceleration", [math.inf, 1.0])
def test_from_beside_it_the_robot_comes_onto_the_edge_without_swinging_across(
    offset: float, heading: float, acceleration: float
) -> None:
    drive = driven(straight(8.0), Pose(0.0, offset, heading), 12.0, acceleration)
    y = drive.places[:, 1] * math.copysign(1.0, offset)
    assert np.abs(y[drive.places[:, 0] > 3.0]).max() < 0.02
    assert y.min() > (-0.08 if heading * offset < 0 else -0.04)  # it may point across already


@pytest.mark.parametrize("acceleration", [math.inf, 1.0])
def test_it_stops_at_the_end(acceleration: float) -> None:
    drive = driven(straight(3.0), Pose(0.0, 0.0, 0.0), 20.0, acceleration)
    assert drive.poses[-1].x == pytest.approx(3.0, abs=0.1)
    assert drive.places[:, 0].max() < 3.05
    assert drive.twists[-1] == STANDSTILL


def test_it_comes_to_the_end_slowly_enough_to_brake_there() -> None:
    """From any place the robot could stop at the end, one point of the edge more or less."""
    drive = driven(straight(3.0), Pose(0.0, 0.0, 0.0), 20.0)
    assert drive.poses[-1].x > 2.9
    for pose, twist in zip(drive.poses, drive.twists, strict=False):
        left = max(0.0, 3.0 - pose.x) + 0.06
        assert twist.linear <= math.sqrt(2 * CONFIG.braking_mps2 * left) + 1e-9


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi / 2, 0.8, 2.2])
def test_a_bend_is_cut_by_less_than_the_look_ahead(angle: float) -> None:
    track = bent(angle)
    drive = driven(track, Pose(0.0, 0.0, 0.0), 30.0, 1.0)
    off = np.array([np.hypot(*(track.polyline - place).T).min() for place in drive.places])
    assert off.max() < 0.2
    assert math.dist(drive.places[-1], track.polyline[-1]) < 0.15


@pytest.mark.parametrize("heading", [math.pi, math.pi - 0.1, -2.5, 1.5])
def test_with_the_edge_behind_it_the_robot_turns_on_the_spot(heading: float) -> None:
    twist = follow(straight(5.0), Pose(1.0, 0.0, heading), 0.0, RADIUS, CONFIG)
    assert twist.linear == 0.0
    assert twist.angular * wrap_angle(0.0 - heading) >= 0.0 or heading == math.pi
    assert abs(twist.angular) > 0.3


def test_a_drive_that_begins_backwards_ends_at_the_end_all_the_same() -> None:
    drive = driven(straight(3.0), Pose(0.5, 0.1, math.pi), 20.0, 1.0)
    assert drive.poses[-1].x == pytest.approx(3.0, abs=0.1)


def test_the_robot_slows_down_where_it_is_narrow() -> None:
    speeds = [
        follow(straight(8.0, clearance), Pose(1.0, 0.0, 0.0), 0.3, RADIUS, CONFIG).linear
        for clearance in (RADIUS, 0.3, 0.45, 0.6, 3.0)
    ]
    assert speeds == sorted(speeds)
    assert speeds[0] == pytest.approx(CONFIG.min_speed_mps)
    assert speeds[3] == speeds[4] == pytest.approx(CONFIG.max_speed_mps)


@pytest.mark.parametrize("heading", [0.6, -0.6])
def test_where_it_is_tight_the_robot_turns_before_it_drives(heading: float) -> None:
    """On an arc its side would come nearer to a wall that is 5 cm away."""
    pose = Pose(1.0, 0.0, heading)
    tight = follow(straight(3.0, RADIUS + 0.05), pose, 0.0, RADIUS, CONFIG)
    assert tight.linear == 0.0
    assert tight.angular * heading < 0.0
    assert follow(straight(3.0), pose, 0.0, RADIUS, CONFIG).linear > 0.0


def test_a_narrow_place_ahead_slows_the_robot_before_it_is_there() -> None:
    track = straight(8.0)
    track.clearance[(track.stations > 1.3) & (track.stations < 1.6)] = 0.25
    wide = follow(straight(8.0), Pose(1.0, 0.0, 0.0), 0.5, RADIUS, CONFIG)
    narrow = follow(track, Pose(1.0, 0.0, 0.0), 0.5, RADIUS, CONFIG)
    assert narrow.linear < 0.6 * wide.linear


lengths = st.floats(-4.0, 4.0)


@example([(0.1 * i, 0.0) for i in range(30)], 3.0, Pose(1.0, 0.0, 0.8), 0.0)  # a sharp arc
@given(
    st.lists(st.tuples(lengths, lengths), min_size=2, max_size=30),
    st.floats(0.0, 3.0),
    st.builds(Pose, lengths, lengths, st.floats(-3.2, 3.2)),
    st.floats(-0.5, 1.0),
)
def test_no_track_makes_it_exceed_its_limits(
    points: list[tuple[float, float]], clearance: float, pose: Pose, speed: float
) -> None:
    line = np.array(points)
    twist = follow(Track.of(line, np.full(len(line), clearance)), pose, speed, RADIUS, CONFIG)
    assert 0.0 <= twist.linear <= CONFIG.max_speed_mps
    assert abs(twist.angular) <= CONFIG.max_turn_rate_radps + 1e-9


def is_clear_cut(track: Track, pose: Pose) -> bool:
    """Whether rounding cannot decide which point is nearest, or which way round is shorter."""
    d = np.sort(np.hypot(*(track.polyline - pose.position).T))
    twist = follow(track, pose, 0.37, RADIUS, CONFIG)
    return bool(d[1] - d[0] > 1e-6) and abs(twist.angular) < CONFIG.max_turn_rate_radps


@given(st.builds(Pose, lengths, lengths, st.floats(-3.2, 3.2)), st.floats(-0.5, 0.5))
def test_the_mirror_image_is_driven_as_a_mirror_image(pose: Pose, angle: float) -> None:
    assume(is_clear_cut(bent(angle), pose))
    twist = follow(bent(angle), pose, 0.37, RADIUS, CONFIG)
    mirrored = follow(bent(-angle), Pose(pose.x, -pose.y, -pose.theta), 0.37, RADIUS, CONFIG)
    assert mirrored.linear == pytest.approx(twist.linear, abs=1e-6)
    assert mirrored.angular == pytest.approx(-twist.angular, abs=1e-6)


@given(
    st.builds(Pose, lengths, lengths, st.floats(-3.2, 3.2)),
    st.builds(Pose, lengths, lengths, st.floats(-3.2, 3.2)),
)
def test_the_frame_of_track_and_robot_does_not_matter(pose: Pose, frame: Pose) -> None:
    track = bent(0.7)
    assume(is_clear_cut(track, pose))
    moved = Track.of(frame.transform(track.polyline), track.clearance)
    here = follow(track, pose, 0.37, RADIUS, CONFIG)
    there = follow(moved, frame.compose(pose), 0.37, RADIUS, CONFIG)
    assert there.linear == pytest.approx(here.linear, abs=1e-6)
    assert there.angular == pytest.approx(here.angular, abs=1e-6)


def test_the_length_of_a_track_is_that_of_its_steps() -> None:
    track = Track.of(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]), np.ones(3))
    assert track.stations.tolist() == [0.0, 3.0, 7.0]
    assert track.length == 7.0
