"""When a scan is looked at: not before the odometry of its time is there, and soon in any case."""

import asyncio
from typing import Any

import numpy as np
import pytest

from gvgbot.autonomy.loop import Loop
from gvgbot.clock import run_in_virtual_time
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.hal.messages import Odometry, Scan

MADE = 1.01  # s; the scan
STEP = 0.02  # of the odometry
SLOWEST = 0.1  # s; nothing is waited for any longer


class Rig:
    """A laser, a base, a pipeline and a guard; one scan, which is here at once."""

    contact = None

    def __init__(self, late: float, silent_from: float) -> None:
        """Odometry comes so late (s), and none of this stamp or a later one."""
        self.late, self.silent_from = late, silent_from
        self.stamp = 0.9
        self.is_scanned = False
        self.looked_at: float | None = None  # when,
        self.newest = 0.0  # and the stamp of the newest odometry until then
        self.guarded_from: float | None = None  # when the guard first had the scan

    def now(self) -> float:
        return asyncio.get_running_loop().time()

    async def next_scan(self) -> Scan:
        if self.is_scanned:
            await asyncio.Event().wait()
        self.is_scanned = True
        await asyncio.sleep(MADE - self.now())
        return Scan(MADE, np.ones(9), -1.0, 0.25, 0.02, 30.0)

    async def next_odometry(self) -> Odometry:
        self.stamp = round(self.stamp + STEP, 2)
        if self.stamp >= self.silent_from:
            await asyncio.Event().wait()
        await asyncio.sleep(self.stamp + self.late - self.now())
        return Odometry(self.stamp, Pose(), STANDSTILL)

    def drive(self, _: object) -> None:
        """All the same."""

    def control(self, odometry: Odometry, _: object) -> object:
        if self.looked_at is None:
            self.newest = odometry.stamp
        return STANDSTILL

    def permit(self, state: object, wish: object, **given: Any) -> tuple[object, object, None]:
        if given["scan"] is not None and self.guarded_from is None:
            self.guarded_from = self.now()
        return state, wish, None

    def perceive(self, _: Scan) -> list[object]:
        self.looked_at = self.now()
        return []


def played(late: float, silent_from: float = 9.0) -> Rig:
    async def play() -> Rig:
        rig = Rig(late, silent_from)
        anything: Any = rig
        loop = Loop(
            *[anything] * 4,
            on_events=lambda _: None,
            on_cycle=lambda _: None,
            goes_on=lambda: rig.now() < 2.0,
        )
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(1.5):
                await loop.run()
        return rig

    return run_in_virtual_time(play())


@pytest.mark.parametrize("late", [0.0, 0.005, 0.03, 0.06])
def test_a_scan_waits_for_the_odometry_of_its_time_but_not_to_be_guarded_by(late: float) -> None:
    """The first that is not older than the scan is made at 1.02 s."""
    rig = played(late)
    assert rig.newest == 1.02
    assert rig.looked_at == pytest.approx(1.02 + late)
    assert rig.guarded_from is not None
    assert rig.guarded_from < MADE + STEP


def test_a_scan_that_is_older_than_the_odometry_does_not_wait() -> None:
    assert played(late=-0.03).looked_at == pytest.approx(MADE)


def test_a_scan_does_not_wait_long_for_a_base_that_is_silent() -> None:
    assert played(late=0.0, silent_from=1.0).looked_at == pytest.approx(MADE + SLOWEST)
