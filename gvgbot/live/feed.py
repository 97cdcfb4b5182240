"""What the network hears while the robot moves: scans, odometry, and the plan."""

from typing import Protocol

import msgspec

from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.snapshots import movement, plan, sweep
from gvgbot.topics import ODOMETRY, PLAN, Payload, Plan
from gvgbot.topics import Odometry as OdometrySent
from gvgbot.topics import Scan as ScanSent

_EARLY = 0.25  # of a period


class Listeners(Protocol):
    """Those who may listen."""

    def publish(self, value: Payload) -> None:
        """Send without waiting."""

    def is_heard(self, payload: type[Payload]) -> bool:
        """Whether anybody listens to values of a type."""


class LiveFeed:
    """Sends each thing at most at its rate, and only if anybody listens."""

    def __init__(self, network: Listeners, pipeline: Pipeline, scan_rate_hz: float) -> None:
        self._network, self._pipeline = network, pipeline
        self._scans, self._odometry = Pace(scan_rate_hz), Pace(ODOMETRY.rate_hz)
        self._plans = Pace(PLAN.rate_hz)
        self._plan: Plan | None = None  # that was sent

    def on_scan(self, scan: Scan) -> None:
        """Send a scan."""
        if self._scans.allows(scan.stamp) and self._network.is_heard(ScanSent):
            middle = scan.stamp + 0.5 * scan.time_increment * len(scan.ranges)
            pipeline = self._pipeline
            map_base = None if pipeline.is_lost else pipeline.map_base_at(middle)
            self._network.publish(sweep(scan, map_base))

    def on_odometry(self, odometry: Odometry) -> None:
        """Send odometry."""
        # Asking whether somebody listens costs more than to look at the clock.
        if self._odometry.allows(odometry.stamp) and self._network.is_heard(OdometrySent):
            self._network.publish(movement(odometry, self._pipeline.map_base))

    def on_beat(self, stamp: float, reason: str) -> None:
        """Send the plan, if it has changed; `reason` is the last decision's."""
        if not self._plans.allows(stamp):
            return
        now = plan(self._pipeline, reason, stamp)
        if self._plan is None or now != msgspec.structs.replace(self._plan, stamp=stamp):
            self._plan = now
            self._network.publish(now)


class Pace:
    """Lets things happen at a rate at most, and keeps to it when they come almost that often."""

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._due = -float("inf")

    def allows(self, stamp: float) -> bool:
        """Whether it is time again; a little early counts, and makes the next one later."""
        early = _EARLY * self._period
        if stamp < self._due - early:
            return False
        self._due = max(self._due, stamp - early) + self._period
        return True
