"""The corrected trajectory against a drive whose odometry is wrong by a known rate."""

import pytest

from gvgbot.autonomy.pipeline import Keyframe, Pipeline
from gvgbot.config import Config
from gvgbot.geometry import Pose
from gvgbot.report import Journey, _corrected


def pipeline(keyframes: list[Keyframe]) -> Pipeline:
    config = Config()
    mind = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    mind.keyframes = keyframes
    return mind


def test_what_odometry_is_wrong_by_is_spread_over_the_time_between_keyframes() -> None:
    """A metre a second along x, of which odometry sees nine tenths; a keyframe each second."""
    stamps = [0.1 * k for k in range(31)]
    felt = [Pose(0.9 * t, 0.0, 0.0) for t in stamps]
    frames = [Keyframe(float(k), felt[10 * k], Pose(), Pose(), None) for k in range(3)]
    journey = Journey(
        stamps=stamps, keyframes=[min(2, int(t + 1e-9)) for t in stamps], odom_base=felt
    )
    poses = _corrected(journey, pipeline(frames), [Pose(float(k), 0.0, 0.0) for k in range(3)])
    for stamp, pose in zip(stamps[:21], poses, strict=False):
        assert pose.x == pytest.approx(stamp)
    for stamp, pose in zip(stamps[21:], poses[21:], strict=True):  # nothing tells what is wrong
        assert pose.x == pytest.approx(2.0 + 0.9 * (stamp - 2.0))


def test_a_row_at_the_stamp_of_a_keyframe_that_came_later_is_that_keyframe() -> None:
    frames = [Keyframe(float(k), Pose(1.3 * k, 0.1, 0.2), Pose(), Pose(), None) for k in range(2)]
    true = [Pose(), Pose(1.0, 0.5, 0.1)]
    journey = Journey(stamps=[1.0], keyframes=[0], odom_base=[frames[1].odom_base])
    (pose,) = _corrected(journey, pipeline(frames), true)
    assert pose.distance(true[1]) < 1e-9
    assert pose.theta == pytest.approx(true[1].theta)
