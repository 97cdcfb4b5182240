"""Times of the laser's hot paths for a full UTM-30LX scan: `python -m benchmarks.bench_scip`."""

import asyncio
import timeit
from collections.abc import Callable
from time import process_time

import numpy as np

from benchmarks.report import report
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.scan_geometry import scan_geometry
from gvgbot.drivers.hokuyo.scip import ScipParser, encode_scan
from gvgbot.drivers.hokuyo.scip_codec import block, to_characters, to_values, unblock
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.transport import pipe, serve_twin

REPEATS = 50
RUNS = 200
SCANS = 1000  # over a pipe
RANGES = np.random.default_rng(1).uniform(0.5, 20.0, 1081)


def microseconds(work: Callable[[], object]) -> float:
    """CPU time of the best of many rounds, that other programs disturbed least."""
    return min(timeit.repeat(work, timer=process_time, number=RUNS, repeat=REPEATS)) / RUNS * 1e6


def report_time(name: str, work: Callable[[], object], at_most: float) -> None:
    report(f"scan of 1081 points: {name}", microseconds(work), "us", at_most=at_most)


def parsed(frame: bytes) -> Callable[[], object]:
    parser = ScipParser()

    def one_scan() -> None:
        (scan,) = parser.feed(frame)
        assert isinstance(scan, ScanReply)

    return one_scan


def twin_scan() -> Callable[[], object]:
    twin = HokuyoTwin(HokuyoTwinConfig(), lambda *_: RANGES, seed=1)
    twin.receive(b"MD0000108001000\n", 0.0)

    def one_scan() -> None:
        while not twin.advance(twin.next_due()):
            pass

    return one_scan


def driver_scan(frame: bytes, request: ScanRequest) -> Callable[[], object]:
    geometry = scan_geometry(HokuyoConfig(), MODELS["UTM-30LX"].parameters, request)
    parser = ScipParser()

    def one_scan() -> None:
        (scan,) = parser.feed(frame)
        assert isinstance(scan, ScanReply)
        geometry.scan(scan.ranges, 0.0)

    return one_scan


async def stream(scans: int) -> None:
    here, there = pipe()
    clock = LoopClock()
    twin = HokuyoTwin(HokuyoTwinConfig(), lambda *_: RANGES, seed=1)
    laser = HokuyoLaser(here, HokuyoConfig(rate_hz=40.0), clock)
    async with asyncio.TaskGroup() as tasks:
        running = [
            tasks.create_task(serve_twin(twin, there, clock)),
            tasks.create_task(laser.run()),
        ]
        for _ in range(scans):
            await laser.next_scan()
        for task in running:
            task.cancel()


def main() -> None:
    readings = (RANGES * 1000).astype(np.int32)
    data = block(to_characters(readings, 3))
    request = ScanRequest("MD", 0, 1080)
    scan = ScanReply(request, "99", 4096, readings)
    frame = encode_scan(scan)
    strong = ScanReply(ScanRequest("ME", 0, 1080), "99", 4096, readings, readings)
    report_time("decode data blocks", lambda: to_values(unblock(data), 3), 25)
    report_time("check, decode MD", parsed(frame), 25)
    report_time("check, decode ME", parsed(encode_scan(strong)), 30)
    report_time("encode MD", lambda: encode_scan(scan), 60)
    report_time("driver, bytes to Scan", driver_scan(frame, request), 100)
    report_time("twin, ranges to bytes", twin_scan(), 150)
    run = timeit.timeit(lambda: run_in_virtual_time(stream(SCANS)), timer=process_time, number=1)
    report("scan over a pipe: twin and driver", run / SCANS * 1e6, "us", at_most=500)


if __name__ == "__main__":
    main()
