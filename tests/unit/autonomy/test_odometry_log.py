"""Where the base was at the stamp of a scan, if anything is known of that time."""

import numpy as np
import pytest

from gvgbot.autonomy.odometry_log import OdometryLog
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Odometry, Scan


def driven(*stamps: float) -> OdometryLog:
    """Odometry at these stamps of a base that drives ahead at 0.5 m/s."""
    log = OdometryLog()
    for stamp in stamps:
        log.append(Odometry(stamp, Pose(0.5 * stamp, 0.0, 0.0), Twist(0.5, 0.0)))
    return log


def test_between_two_messages_the_base_was_in_proportion() -> None:
    found = driven(1.0, 1.1).odom_base_at(1.04)
    assert found is not None
    assert found.x == pytest.approx(0.52)


def test_a_scan_that_is_a_little_newer_than_odometry_was_taken_at_its_place() -> None:
    assert driven(1.0, 1.02).odom_base_at(1.1) == Pose(0.51, 0.0, 0.0)


@pytest.mark.parametrize(
    "stamp", [1.5, 3.0, 7.9, 9.0], ids=["just after", "in", "at the end", "on"]
)
def test_nobody_knows_where_the_base_was_in_an_outage(stamp: float) -> None:
    assert driven(0.98, 1.0, 8.0).odom_base_at(stamp) is None


def test_after_an_outage_the_base_is_known_again() -> None:
    found = driven(1.0, 8.0, 8.02).odom_base_at(8.01)
    assert found is not None
    assert found.x == pytest.approx(4.005)


def test_before_the_first_message_nothing_is_known() -> None:
    assert OdometryLog().odom_base_at(1.0) is None


@pytest.mark.parametrize(("since", "gap"), [(0.98, True), (1.0, True), (7.99, True), (8.0, False)])
def test_an_outage_is_known_until_the_base_was_heard_again(since: float, gap: bool) -> None:
    assert driven(0.98, 1.0, 8.0, 8.02).has_gap_since(since) is gap


def test_of_the_time_before_the_clock_was_set_back_nothing_is_known() -> None:
    log = driven(50.0, 50.02, 1.0, 1.02)
    assert log.odom_base_at(0.99) == Pose(0.5, 0.0, 0.0)
    assert not log.has_gap_since(0.99)


@pytest.mark.parametrize(
    ("headings", "still_s"),
    [
        ({0.0: 0.3, 1.0: 0.3, 1.9: 0.3}, 0.0),
        ({0.0: 0.3, 1.0: 0.3, 3.0: 0.3, 12.0: 0.3}, 10.0),
        ({0.0: 0.3, 100.0: 0.3, 100.1: 0.3}, 98.1),
        ({0.0: 0.3, 6.0: 0.4, 7.0: 0.4, 9.0: 0.4, 9.5: 0.5}, 1.0),
        ({0.0: 0.3, 5.0: 0.3, 6.0: 0.31, 7.0: 0.31, 11.0: 0.31}, 6.0),
        ({0.5 * i: 0.001 * i for i in range(100)}, 0.0),
    ],
    ids=["too short", "stands", "unheard", "turns between", "stands twice", "drifts"],
)
def test_a_gyro_whose_heading_stays_for_two_seconds_does_not_drift_from_then_on(
    headings: dict[float, float], still_s: float
) -> None:
    log = OdometryLog()
    for stamp, theta in headings.items():
        log.append(Odometry(stamp + 40.0, Pose(0.0, 0.0, theta), Twist()))
    assert log.unturned_s == pytest.approx(still_s)


@pytest.mark.parametrize("duration", [0.1, 0.025, -0.1, -0.025])
def test_a_sweep_is_driven_from_its_first_beam_to_its_last(duration: float) -> None:
    """A base that turns faster and faster; upside down, the last beam is the earlier one."""
    log = OdometryLog()
    for stamp in np.arange(1.0, 1.6, 0.02).tolist():
        log.append(Odometry(stamp, Pose(theta=1.5 * (stamp - 1.0) ** 2), Twist(0.0, 0.0)))
    scan = Scan(1.4, np.ones(10), -1.0, 0.2, 0.02, 30.0, duration / 10, Pose())
    turned = 1.5 * ((0.4 + duration) ** 2 - 0.4**2)
    assert log.motion_during(scan).theta == pytest.approx(turned, abs=0.003)
