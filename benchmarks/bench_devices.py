"""Both drivers at work on pseudo-terminals, and how good their stamps are."""

import asyncio
import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import process_time

from benchmarks.report import report, report_rate
from benchmarks.rigs.stamp_errors import odometry_stamp_errors, rms, scan_stamp_errors
from gvgbot.clock import LoopClock
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.drivers.link_faults import LinkFaultConfig
from gvgbot.drivers.transport import SerialStream
from gvgbot.geometry import Twist

OPENING = 5.0  # s
MEASURED = 30.0  # s
LASER = HokuyoConfig(link="usb", rate_hz=40.0)
LASER_LINK, BASE_LINK = "laser", "base"


@contextmanager
def twins(folder: Path) -> Iterator[None]:
    """Both twins in a process of their own, behind links in the folder."""
    links = ("--laser-link", str(folder / LASER_LINK), "--base-link", str(folder / BASE_LINK))
    command = [sys.executable, "-m", "gvgbot", "twin", *links]
    with subprocess.Popen(command, text=True, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            while "base:" not in (line := process.stdout.readline()):
                assert line, "the twins did not start"
            yield
        finally:
            process.terminate()


async def follow(laser: HokuyoLaser) -> None:
    while True:
        await laser.next_scan()


async def drive(base: KobukiBase) -> None:
    """One command per odometry message, as the control loop sends them."""
    while True:
        await base.next_odometry()
        base.drive(Twist(0.0, 0.4))


async def work(folder: Path) -> None:
    """Measure this process only, from when everything has been opened."""
    clock = LoopClock()
    with contextlib.ExitStack() as stack:
        ports = [SerialStream(str(folder / name), 115200) for name in (LASER_LINK, BASE_LINK)]
        for port in ports:
            stack.callback(port.close)
        laser = HokuyoLaser(ports[0], LASER, clock)
        base = KobukiBase(ports[1], KobukiConfig(), clock)
        async with asyncio.TaskGroup() as tasks:
            jobs = (laser.run(), base.run(), follow(laser), drive(base))
            running = [tasks.create_task(job) for job in jobs]
            await asyncio.sleep(OPENING)
            began, cpu = clock.now(), process_time()
            scans, frames = laser.link.scans, base.statistics.frames
            await asyncio.sleep(MEASURED)
            took, cpu = clock.now() - began, process_time() - cpu
            scans, frames = laser.link.scans - scans, base.statistics.frames - frames
            for task in running:
                task.cancel()
    report("both drivers: CPU", 100 * cpu / took, "% of a core", at_most=3.0)
    report_rate("both drivers: scans", scans / took, "Hz", at_least=39.0)
    report_rate("both drivers: base frames", frames / took, "Hz", at_least=49.0)


def stamps() -> None:
    """In virtual time: 5 ms of jitter, and clocks that run 50 ppm fast, after a minute."""
    link, drift_ppm = LinkFaultConfig(jitter_s=0.005), 50.0
    scan = 1e3 * rms(scan_stamp_errors(link, drift_ppm))
    report("scan stamps: rms error", scan, "ms", at_most=1.5)
    odometry = 1e3 * rms(odometry_stamp_errors(link, drift_ppm))
    report("odometry stamps: rms error", odometry, "ms", at_most=0.5)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, twins(Path(folder)):
        asyncio.run(work(Path(folder)))
    stamps()


if __name__ == "__main__":
    main()
