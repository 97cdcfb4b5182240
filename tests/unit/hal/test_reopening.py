"""A lost device is opened again, and nobody who waits for it notices."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
import structlog

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import STANDSTILL, Pose, Twist
from gvgbot.hal.messages import Battery, Contact, Odometry, Scan, Sign
from gvgbot.hal.reopening import Opened, ReopeningBase, ReopeningLaser


def scan_at(stamp: float) -> Scan:
    return Scan(stamp, np.ones(3), -1.0, 1.0, 0.1, 30.0)


@dataclass
class ShortLivedLaser:
    """Gives one scan after a tenth of a second, and fails half a second later."""

    failure: Exception
    scans: int = 1

    async def run(self) -> None:
        await asyncio.sleep(0.6)
        raise self.failure

    async def next_scan(self) -> Scan:
        await asyncio.sleep(0.1 if self.scans else 1e9)
        self.scans -= 1
        return scan_at(asyncio.get_running_loop().time())


@dataclass
class Port:
    """Opens as many devices as there are, then never again; remembers when it was asked."""

    lasers: list[ShortLivedLaser]
    asked: list[float] = field(default_factory=list)
    closed: int = 0

    async def open(self) -> Opened[ShortLivedLaser]:
        self.asked.append(asyncio.get_running_loop().time())
        if not self.lasers:
            raise DeviceLost("no such port")
        return self.lasers.pop(0), self.close

    def close(self) -> None:
        self.closed += 1


def live(port: Port, seconds: float) -> list[float | str]:
    """Serve a laser on the port for so long; stamps of scans, and losses, as they are noticed."""
    noticed: list[float | str] = []

    async def collect(laser: ReopeningLaser) -> None:
        while True:
            try:
                noticed.append(round((await laser.next_scan()).stamp, 6))
            except DeviceLost as loss:
                noticed.append(str(loss))

    async def main() -> None:
        laser = ReopeningLaser(port.open, LoopClock())
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(laser.run()), tasks.create_task(collect(laser))]
            await asyncio.sleep(seconds)
            for task in serving:
                task.cancel()

    run_in_virtual_time(main())
    return noticed


def test_a_port_that_stays_away_is_tried_twice_a_second() -> None:
    port = Port([])
    live(port, 20.0)
    assert port.asked == pytest.approx(np.arange(0.0, 20.0, 0.5))


@pytest.mark.parametrize("failure", [DeviceLost("silent"), DeviceRefused("laser off")], ids=str)
def test_scans_go_on_after_a_laser_was_lost(failure: Exception) -> None:
    port = Port([ShortLivedLaser(failure), ShortLivedLaser(failure)])
    # open at 0, lost at 0.6, again at 1.1, lost at 1.7
    assert live(port, 2.0) == [0.1, str(failure), 1.2, str(failure)]
    assert port.asked == pytest.approx([0.0, 1.1])


def test_who_waits_for_a_scan_is_told_once_that_the_laser_is_lost() -> None:
    port = Port([ShortLivedLaser(DeviceLost("silent"))])
    assert live(port, 60.0) == [0.1, "silent"]


def test_every_link_is_closed_once() -> None:
    port = Port([ShortLivedLaser(DeviceLost("silent")) for _ in range(3)])
    live(port, 30.0)
    assert port.closed == 3


def test_a_link_is_closed_when_the_daemon_ends() -> None:
    port = Port([ShortLivedLaser(DeviceLost("silent"))])
    live(port, 0.3)
    assert port.closed == 1


@pytest.mark.parametrize("turns_later", range(6))
def test_a_daemon_ends_even_at_the_moment_when_a_laser_is_lost(turns_later: int) -> None:
    async def main() -> bool:
        port = Port([ShortLivedLaser(DeviceLost("silent"))])
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(ReopeningLaser(port.open, LoopClock()).run())
            await asyncio.sleep(0.6)
            for _ in range(turns_later):
                await asyncio.sleep(0)
            serving.cancel()
            await asyncio.sleep(5.0)
            has_ended = serving.cancelled()
            serving.cancel()
        return has_ended

    assert run_in_virtual_time(main())


def test_a_mistake_of_the_program_is_not_taken_for_a_lost_device() -> None:
    with pytest.raises(ExceptionGroup) as caught:
        live(Port([ShortLivedLaser(ZeroDivisionError("mistake"))]), 5.0)
    assert caught.group_contains(ZeroDivisionError)


def test_the_log_says_once_that_a_laser_came_went_and_came_back() -> None:
    port = Port([ShortLivedLaser(DeviceLost("silent")), ShortLivedLaser(DeviceLost("silent"))])
    with structlog.testing.capture_logs() as logs:
        live(port, 60.0)
    assert [(log["event"], log.get("reason"), log.get("after_s")) for log in logs] == [
        ("laser is there", None, None),
        ("laser lost", "silent", None),
        ("laser back", None, 0.6),
        ("laser lost", "silent", None),
        ("waiting for the laser", "no such port", None),
    ]


class Wheels:
    """A base that lives until it is told to fail, and remembers what it was told to drive."""

    def __init__(self) -> None:
        self.driven: list[Twist] = []
        self.shown: list[Sign] = []
        self.fail = asyncio.Event()
        self.contact: Contact | None = Contact(0.0, bumper_left=True)
        self.battery: Battery | None = Battery(0.0, 16.0, 0.9, charging=False)

    async def run(self) -> None:
        await self.fail.wait()
        raise DeviceLost("cable")

    async def next_odometry(self) -> Odometry:
        await asyncio.sleep(0.02)
        return Odometry(asyncio.get_running_loop().time(), Pose(1.0, 2.0, 0.5), STANDSTILL)

    def drive(self, twist: Twist) -> Twist:
        self.driven.append(twist)
        return twist

    def show(self, sign: Sign) -> None:
        self.shown.append(sign)


def with_a_base(story: Callable[[ReopeningBase, list[Wheels]], Awaitable[None]]) -> None:
    """Tell a story of a base that is opened, with all the devices that were opened so far."""

    async def main() -> None:
        opened: list[Wheels] = []

        async def open_device() -> Opened[Wheels]:
            opened.append(Wheels())
            return opened[-1], lambda: None

        base = ReopeningBase(open_device, LoopClock())
        async with asyncio.TaskGroup() as tasks:
            serving = tasks.create_task(base.run())
            await story(base, opened)
            serving.cancel()

    run_in_virtual_time(main())


async def never() -> Opened[Wheels]:
    raise DeviceLost("no such port")


def test_before_it_is_opened_a_base_can_be_driven_in_vain() -> None:
    async def main() -> None:
        base = ReopeningBase(never, LoopClock())
        assert base.drive(Twist(0.3, 0.0)) == STANDSTILL
        base.show("busy")
        assert base.contact is None
        assert base.battery is None

    run_in_virtual_time(main())


def test_a_lost_base_is_driven_no_more_and_the_new_one_is() -> None:
    async def story(base: ReopeningBase, opened: list[Wheels]) -> None:
        await base.next_odometry()
        assert base.drive(Twist(0.1, 0.0)) == Twist(0.1, 0.0)
        opened[0].fail.set()
        await asyncio.sleep(0.1)
        away = [base.away]
        assert base.drive(Twist(0.2, 0.0)) == STANDSTILL
        odometry = await base.next_odometry()
        assert odometry.odom_base == Pose(1.0, 2.0, 0.5)
        away.append(base.away)
        assert away == ["cable", None]
        base.drive(Twist(0.3, 0.0))
        assert [device.driven for device in opened] == [[Twist(0.1, 0.0)], [Twist(0.3, 0.0)]]

    with_a_base(story)


def test_contact_and_battery_are_those_of_the_open_device() -> None:
    async def story(base: ReopeningBase, opened: list[Wheels]) -> None:
        await base.next_odometry()
        assert base.contact is opened[0].contact
        assert base.battery is opened[0].battery

    with_a_base(story)
