"""What the daemon on twins says of scans, odometry and its plan, held against the truth."""

import numpy as np
import pytest

from benchmarks.rigs.run_rig import Daemon
from gvgbot.clock import Clock
from gvgbot.geometry import Pose

SECONDS = 25.0

pytestmark = [pytest.mark.twin, pytest.mark.slow]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Daemon, Pose]:
    """A daemon that has lived for so long, and where it was then."""
    daemon, places = Daemon(tmp_path_factory.mktemp("told") / "run"), list[Pose]()

    async def story(clock: Clock) -> None:
        await clock.sleep_until(SECONDS)
        places.append(daemon.place)

    with daemon.session.directory:
        daemon.run(story)
    return daemon, places[0]


def test_scans_and_odometry_come_at_their_rates_from_where_the_robot_is(
    told: tuple[Daemon, Pose],
) -> None:
    daemon, place = told
    start = daemon.session.place
    assert start is not None
    truth = start.start.to(place)
    scans = [scan for scan in daemon.network.scans if 1.0 < scan.stamp < SECONDS]
    odometry = [said for said in daemon.network.odometry if 1.0 < said.stamp < SECONDS]
    assert len(scans) == pytest.approx(240, abs=3)
    assert len(odometry) == pytest.approx(480, abs=5)
    for believed in (scans[-1].map_base, odometry[-1].map_base):
        assert believed == pytest.approx((truth.x, truth.y, truth.theta), abs=0.15)
    far = np.nan_to_num(scans[-1].metres, nan=0.0, posinf=0.0).max()
    assert 1.0 < far < scans[-1].range_max


def test_the_plan_begins_at_the_robot_and_is_told_when_it_changes(
    told: tuple[Daemon, Pose],
) -> None:
    daemon, _ = told
    plans, states = daemon.network.plans, daemon.network.states
    assert 3 < len(plans) <= 51  # twice a second at most
    driving = [plan for plan in plans if len(plan.ahead)]
    assert driving
    for plan in driving:
        here = min(states, key=lambda state: abs(state.stamp - plan.stamp)).pose[:2]
        assert np.hypot(*(plan.ahead - here).T).min() < 0.3
    decisions = [e for e in daemon.network.events[-1].events if e.kind == "decision"]
    assert (plans[-1].vertex, plans[-1].reason) == (
        decisions[-1].details["vertex"],
        decisions[-1].details["reason"],
    )
