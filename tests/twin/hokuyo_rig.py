"""A simulated laser behind a bad link that is opened again whenever it is lost, and its judge."""

import contextlib
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np

from gvgbot.clock import LoopClock
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.statistics import LinkStatistics
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig, LaserMishapConfig
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Array
from gvgbot.hal.messages import Scan
from gvgbot.hal.reopening import Opened, ReopeningLaser
from tests.twin.device_rig import ENDS_OF_LINK, Wire, Work, play

DIGITS = 4  # of the number of the scan, six bits each
HOLD_NUMBER = slice(0, 2 * DIGITS, 2)  # beams that tell them
ROUNDING = 0.0005 + 1e-9  # m: half a millimetre
KEPT = 1024  # scans whose time is remembered: far more than can be under way


class CountedWorld:
    """Ranges of which every one tells the number of its scan, and when the last were taken.

    `group` is how many steps the laser merges to one beam. No beam is between its neighbours, as on
    a slanted wall, where the driver would tell what is due in the middle of a group.
    """

    def __init__(self, beams: int = 1081, group: int = 1) -> None:
        self.count = 0
        self.group = group
        self._stamps: deque[float] = deque(maxlen=KEPT)
        k = np.arange(-(-beams // group))
        self._pattern = 1.0 + 1.5 * (k % 2) + (k * 7919 % 400) / 1000.0
        self._beams = beams

    def __call__(self, stamp: float, steps: int) -> Array:
        self.count += 1
        self._stamps.append(stamp)
        return np.repeat(self.truth(self.count - 1), self.group)[: self._beams]

    def truth(self, number: int) -> Array:
        """The beams of a scan, m."""
        ranges = self._pattern + (number * 389 % 1000) / 1000.0
        ranges[HOLD_NUMBER] = [1.0 + 0.01 * (number >> 6 * i & 63) for i in range(DIGITS)]
        return ranges

    def stamp_of(self, scan: Scan) -> float | None:
        """When this scan was really taken (s); None if no scan of the last ones was like it."""
        digits = np.rint((scan.ranges[HOLD_NUMBER] - 1.0) / 0.01)
        if not np.isfinite(digits).all():
            return None
        number = sum(int(digit) << 6 * i for i, digit in enumerate(digits))
        place = number - self.count + len(self._stamps)
        if not 0 <= place < len(self._stamps):
            return None
        is_right = np.allclose(scan.ranges, self.truth(number), rtol=0.0, atol=ROUNDING)
        return self._stamps[place] if is_right else None


class LaserRig:
    """A laser that is opened again whenever it is lost, and a record of every scan it gave.

    `arrivals` and `errors` of the stamps, both in s, are of good scans; `wrong` counts the others.
    """

    def __init__(
        self,
        twin: HokuyoTwinConfig,
        driver: HokuyoConfig,
        link: LinkFaultConfig,
        seed: int,
        group: int = 1,
    ) -> None:
        parameters = MODELS[twin.model].parameters
        beams = parameters.last_step - parameters.first_step + 1
        self.clock = LoopClock()
        self.world = CountedWorld(beams, group)
        self.twin = HokuyoTwin(twin, self.world, seed)
        self.wire = Wire(self.twin, link, seed)
        self.laser = ReopeningLaser(self.open, self.clock)
        self.wrong = 0
        self.openings = 0
        self.errors: list[float] = []
        self.arrivals: list[float] = []
        self._config = driver
        self._first_beam = parameters.first_step * parameters.step_time
        self._link = LinkStatistics()
        self._before = LinkStatistics()  # of the drivers that were lost, in sum

    @property
    def link(self) -> FaultyLink:
        return self.wire.link

    def inject(self, fault: str, seconds: float) -> None:
        """Let something befall the device or its link, for so long."""
        inject: Callable[..., None] = (
            self.link.inject if fault in ENDS_OF_LINK else self.twin.inject
        )
        inject(fault, seconds)

    def work(self) -> Work:
        return [self.wire.serve(self.clock), self.laser.run(), self.judge()]

    async def open(self) -> Opened[HokuyoLaser]:
        laser = HokuyoLaser(self.wire.cable.host, self._config, self.clock)
        self._before = LinkStatistics(
            **{name: self.total(name) for name in LinkStatistics.__slots__}
        )
        self._link = laser.link
        self.openings += 1
        return laser, lambda: None

    def total(self, name: str) -> int:
        """One of the link's counters, over all drivers."""
        return int(getattr(self._before, name)) + int(getattr(self._link, name))

    async def judge(self) -> None:
        while True:
            with contextlib.suppress(DeviceLost):
                self.judge_scan(await self.laser.next_scan())

    def judge_scan(self, scan: Scan) -> None:
        if np.isnan(scan.ranges).all():
            return  # the laser said itself that it was blind
        stamp = self.world.stamp_of(scan)
        if stamp is None:
            self.wrong += 1
        else:
            self.errors.append(scan.stamp - stamp - self._first_beam)
            self.arrivals.append(self.clock.now())

    async def good_scan(self, seconds: float) -> float:
        """How long (s) it takes until the next good scan; fails if longer than that."""
        began, before = self.clock.now(), len(self.arrivals)
        while len(self.arrivals) == before:
            assert self.clock.now() - began < seconds, "no scan came in time"
            await self.clock.sleep_until(self.clock.now() + 0.05)
        return self.arrivals[before] - began


def on_rig(
    scenario: Callable[[LaserRig], Awaitable[None]],
    *,
    link: LinkFaultConfig | None = None,
    mishaps: LaserMishapConfig | None = None,
    config: HokuyoConfig | None = None,
    seed: int = 41,
    **laser: Any,
) -> LaserRig:
    """Run the scenario with the laser at work behind the link."""
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0}
    settings = HokuyoTwinConfig(
        **{**quiet, **laser},
        mishaps=mishaps or LaserMishapConfig(),
    )
    link, config = link or LinkFaultConfig(), config or HokuyoConfig()
    return play(lambda: LaserRig(settings, config, link, seed), scenario)
