"""Where the base is at a look, when odometry is to be trusted and when it is not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.keyframes import Past
from gvgbot.autonomy.map_edits import MapEdits
from gvgbot.autonomy.pose_tracking import PoseTracker
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.hal.messages import Odometry
from tests.unit.autonomy.sights import carved, sweep

ROOMS = carved([(-4.0, -1.0, 4.0, 1.0), (0.0, -1.0, 2.0, 4.0)])
START = Pose(-1.5, 0.0)


class Tracked:
    """A tracker that has looked round once, and what hangs on it; a second from look to look."""

    def __init__(self, *, matches_walls: bool = True) -> None:
        self.tracker = PoseTracker(AutonomyConfig(), matches_walls=matches_walls)
        self.past, self.mapper = Past(), MapEdits(MappingConfig(), RecognitionConfig())
        self._stamp = 0.0
        self._keep(Pose(), Pose())

    def look(
        self,
        odom_base: Pose,
        local_base: Pose,
        *,
        breaks: int = 0,
        is_doubted: bool = False,
        reach: float = math.inf,
        hidden: float = 0.0,
    ) -> Pose | None:
        """Where it finds itself that odometry has at one pose, and the walls at another.

        It sees no farther than `reach`, m, and somebody stands before a share of the walls.
        """
        for stamp in np.arange(self._stamp, self._stamp + 1.01, 0.2).tolist():
            self.tracker.odometry.append(Odometry(stamp, odom_base, STANDSTILL, breaks))
        self._stamp += 1.0
        is_broken = self.tracker.notice_break()
        scan = replace(sweep(ROOMS, START.compose(local_base)), stamp=self._stamp)
        ranges = np.where(scan.ranges < reach, scan.ranges, np.inf)
        ranges[: round(hidden * len(ranges))] *= 0.7
        scan = replace(scan, ranges=ranges)
        found = self.tracker.track(
            scan, odom_base, self.past, self.mapper, is_broken=is_broken, is_doubted=is_doubted
        )
        if found is not None:
            self._keep(odom_base, found)
        return found

    def _keep(self, odom_base: Pose, local_base: Pose) -> None:
        scan = replace(sweep(ROOMS, START.compose(local_base)), stamp=self._stamp)
        self.tracker.maps.insert(scan, local_base, self.past.travelled)
        self.past.keep(scan, odom_base, local_base, self.mapper.belief.map_base)


def test_a_base_that_has_started_anew_is_noticed_once() -> None:
    tracker = PoseTracker(AutonomyConfig(), matches_walls=True)
    tracker.odometry.append(Odometry(0.0, Pose(), STANDSTILL))
    assert not tracker.notice_break()
    tracker.odometry.append(Odometry(0.1, Pose(), STANDSTILL, breaks=1))
    assert tracker.notice_break()
    assert not tracker.notice_break()


def test_belief_and_past_come_along() -> None:
    tracked, way = Tracked(), Pose(0.3)
    found = tracked.look(way, way)
    assert found is not None
    assert found.distance(way) < 0.02
    assert tracked.past.travelled == pytest.approx(0.3)
    assert [step.motion for step in tracked.past.steps] == [found]
    assert tracked.mapper.belief.map_base.distance(found) < 1e-9


@pytest.mark.parametrize("lifted", [True, False])
def test_who_was_lifted_is_looked_for_around_and_once_only(*, lifted: bool) -> None:
    tracked, aside = Tracked(), Pose(0.6, 0.3)
    tracked.tracker.was_lifted = lifted
    found = tracked.look(Pose(), aside)
    assert found is not None
    assert (found.distance(aside) < 0.05) == lifted
    assert not tracked.tracker.was_lifted


def test_who_drives_by_odometry_alone_does_so_after_it_was_lifted_too() -> None:
    tracked = Tracked(matches_walls=False)
    tracked.tracker.was_lifted = True
    assert tracked.look(Pose(0.1), Pose(0.6, 0.3)) == Pose(0.1)
    assert np.linalg.eigvalsh(tracked.past.steps[-1].covariance)[1] > 0.25**2  # and knows of it


def test_who_sees_no_known_walls_after_the_base_started_anew_may_be_anywhere() -> None:
    tracked = Tracked()
    assert tracked.look(Pose(), Pose(3.0, 3.0), breaks=1) is None
    assert not tracked.past.steps
    assert tracked.mapper.belief.map_base == Pose()


def test_who_sees_no_known_walls_after_it_was_lifted_may_be_anywhere() -> None:
    tracked = Tracked()
    tracked.tracker.was_lifted = True
    assert tracked.look(Pose(0.2), Pose(3.0, 3.0)) is None
    assert not tracked.past.steps
    again = tracked.look(Pose(0.2), Pose(0.2), is_doubted=True)  # it was put back
    assert again is not None
    assert again.distance(Pose(0.2)) < 0.05
    assert tracked.past.travelled == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("reach", "hidden"), [(1.0005, 0.0), (math.inf, 0.25)], ids=["hardly a wall", "among people"]
)
def test_who_sees_few_walls_that_it_knows_after_it_was_lifted_goes_on(
    reach: float, hidden: float
) -> None:
    tracked = Tracked()
    tracked.tracker.was_lifted = True
    found = tracked.look(Pose(0.1), Pose(0.1), reach=reach, hidden=hidden)
    assert found is not None
    assert found.distance(Pose(0.1)) < 0.05


def test_few_walls_in_the_open_are_no_reason_to_stand_after_a_lift() -> None:
    tracked = Tracked()
    tracked.tracker.was_lifted = True
    assert tracked.look(Pose(), Pose(3.0, 3.0), reach=0.6) is not None


def test_who_takes_over_from_another_goes_on_by_its_walls_and_odometry() -> None:
    one, other = Tracked(), Tracked()
    other.look(Pose(), Pose(), breaks=3)
    one.tracker.was_lifted = True  # before the other one began
    one.tracker.take_over(other.tracker)
    assert not one.tracker.was_lifted
    assert one.tracker.maps is other.tracker.maps
    assert not one.tracker.notice_break()  # the other one has taken account of it
