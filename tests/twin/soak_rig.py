"""A laser and a base with all their faults at once, judged as they go so that nothing piles up."""

import gc
import math
import sys
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.geometry import Twist, wrap_angle
from gvgbot.hal.messages import Odometry
from tests.twin.device_rig import Work, play
from tests.twin.hokuyo_rig import LaserRig
from tests.twin.kobuki_rig import Robot

LOOK = 0.1  # s between two looks at the rig
SETTLING = 60.0  # s after a start in which stamps may be a little off
GROUP = 2  # steps that a URG-04LX must merge for 115200 bit/s
FAULTS_APART = 4.0  # s
DRIFT_PPM = 50.0
TWIST = Twist(0.2, 0.3)


@dataclass
class Recovery:
    """How long a device gave nothing at worst, counted from the end of its last fault.

    `lasting` tells how long the faults last that do (s). A device that goes down to boot, as long
    as its own configuration says, is not there yet.
    """

    lasting: Mapping[str, float]
    worst: float = 0.0
    cause: str = "none"
    _excused: float = 0.0
    _looked: float = 0.0
    _last_fault: str = "none"
    _seen: int = 0
    _counts: Counter[str] | None = None

    def look(self, now: float, last: float, counts: Counter[str], *, is_away: bool) -> None:
        """Judge by the last good value (s) and how often each fault has begun by now (s)."""
        if is_away:
            self._excused = max(self._excused, now)
        if counts.total() > self._seen:
            for name in counts - (self._counts or Counter()):
                end = self._looked + self.lasting.get(name, 0.0)
                if end >= self._excused:
                    self._excused, self._last_fault = end, name
            self._seen, self._counts = counts.total(), counts
        self._looked = now
        waited = now - max(last, self._excused)
        if waited > self.worst:
            self.worst, self.cause = waited, f"{self._last_fault} before {now:.1f} s"


@dataclass
class StampErrors:
    """Of stamps (s): the largest ever, and the mean square of those long after a start."""

    largest: float = 0.0
    settled: int = 0
    squares: float = 0.0

    def add(self, errors: list[float], *, are_settled: bool) -> None:
        if not errors:
            return
        self.largest = max(self.largest, *map(abs, errors))
        if are_settled:
            self.settled += len(errors)
            self.squares += sum(error * error for error in errors)

    @property
    def rms(self) -> float:
        return math.sqrt(self.squares / self.settled)


class Soak:
    """Both devices at work; `look` judges what they gave since the last time and forgets it."""

    def __init__(self, laser: HokuyoTwinConfig, base: KobukiTwinConfig, seed: int) -> None:
        driver = HokuyoConfig(link="serial", baud=laser.serial_baud)
        self.laser = LaserRig(laser, driver, laser.link, seed, group=GROUP)
        self.base = Robot(base, TWIST, seed + 1, DRIFT_PPM)
        self.scans = self.odometries = self.jumps = 0
        self.scan_stamps, self.odometry_stamps = StampErrors(), StampErrors()
        self.laser_recovery = Recovery(_durations(laser))
        self.base_recovery = Recovery(_durations(base))
        self.memory: list[tuple[int, int]] = []  # blocks allocated, and bytes resident
        self._last_scan = 0.0
        self._started = {"laser": (0, 0.0), "base": (0, 0.0)}
        self._last_heard = 0.0
        self._last: Odometry | None = None

    def work(self) -> Work:
        return [*self.laser.work(), *self.base.work()]

    async def last(self, seconds: float) -> None:
        """Look on for so long, and measure the memory at half of it and at the end.

        Each fault is made to happen once in the first minutes, whatever chance brings besides.
        """
        faults = self._faults()
        for half in (seconds / 2, seconds):
            while (now := self.laser.clock.now()) < half:
                if faults and now >= faults[0][0]:
                    faults.popleft()[1]()
                await self.laser.clock.sleep_until(now + LOOK)
                self._look_at_laser(now + LOOK)
                self._look_at_base(now + LOOK)
            gc.collect()
            self.memory.append((sys.getallocatedblocks(), _resident()))

    def _faults(self) -> deque[tuple[float, Callable[[], None]]]:
        """Every fault of a device or its link that can be called up, and when to do so (s)."""
        rigs = (self.laser, self.laser_recovery), (self.base, self.base_recovery)
        calls = [
            partial(rig.inject, name, seconds)
            for rig, recovery in rigs
            for name, seconds in recovery.lasting.items()
        ]
        return deque((FAULTS_APART * i, call) for i, call in enumerate(calls, 1))

    def _look_at_laser(self, now: float) -> None:
        rig = self.laser
        starts = rig.openings + rig.total("restarts") + rig.total("clock_resets")
        self.scan_stamps.add(rig.errors, are_settled=self._is_settled("laser", starts, now))
        self.scans += len(rig.arrivals)
        self._last_scan = rig.arrivals[-1] if rig.arrivals else self._last_scan
        is_away = rig.twin._is_down or rig.twin._answers.restarts_at is not None
        self.laser_recovery.look(
            now, self._last_scan, rig.link.counts + rig.twin.counts, is_away=is_away
        )
        rig.errors.clear()
        rig.arrivals.clear()

    def _look_at_base(self, now: float) -> None:
        robot = self.base
        starts = robot.openings + robot.feedback.statistics.resets
        self.odometry_stamps.add(robot.errors, are_settled=self._is_settled("base", starts, now))
        for arrival, odometry in robot.heard:
            self.jumps += self._last is not None and not _follows(self._last, odometry)
            self._last_heard, self._last = arrival, odometry
        self.odometries += len(robot.heard)
        counts = robot.link.counts + robot.twin.mishaps.counts
        self.base_recovery.look(
            now, self._last_heard, counts, is_away=robot.frames.next_due() > now + LOOK
        )
        for record in (robot.errors, robot.heard, robot.contacts, robot.body.commands):
            record.clear()

    def _is_settled(self, name: str, starts: int, now: float) -> bool:
        before, since = self._started[name]
        if starts != before:
            since = now
        self._started[name] = starts, since
        return now - since > SETTLING


def _durations(config: HokuyoTwinConfig | KobukiTwinConfig) -> dict[str, float]:
    """How long the faults last that do (s)."""
    lasting = {name: rate.duration for name, rate in config.mishaps.rates.items()}
    return lasting | {"silence": config.link.silence_s, "unplug": config.link.unplugged_s}


def _follows(before: Odometry, after: Odometry) -> bool:
    """Whether a body on its arc, or at rest, may get from one to the other, with a slip."""
    dt = after.stamp - before.stamp
    turn = abs(wrap_angle(after.odom_base.theta - before.odom_base.theta))
    way = after.odom_base.distance(before.odom_base)
    fast, quick = 1.5 * TWIST.linear, 1.5 * TWIST.angular
    return dt > 0.0 and way < fast * dt + 0.06 and (turn < quick * dt + 0.1 or dt > 5.0)


def _resident() -> int:
    pages = Path("/proc/self/statm").read_text("ascii").split()[1]
    return int(pages) * 4096


def soak(laser: HokuyoTwinConfig, base: KobukiTwinConfig, seconds: float, seed: int = 1) -> Soak:
    """Both devices after so long."""

    async def script(rig: Soak) -> None:
        await rig.last(seconds)

    return play(lambda: Soak(laser, base, seed), script)
