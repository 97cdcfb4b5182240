"""Times of the laser's hot paths for a full UTM-30LX scan: `python benchmarks/bench_scip.py`."""

import asyncio
import timeit
from collections.abc import Callable

import numpy as np

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.scan_geometry import scan_geometry
from gvgbot.drivers.hokuyo.scip import ScipParser, encode_scan
from gvgbot.drivers.hokuyo.scip_codec import block, to_characters, to_values, unblock
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.transport import pipe, serve_twin

REPEATS = 5
RUNS = 1000
RANGES = np.random.default_rng(1).uniform(0.5, 20.0, 1081)


def microseconds(work: Callable[[], object]) -> float:
    return min(timeit.repeat(work, number=RUNS, repeat=REPEATS)) / RUNS * 1e6


def report(name: str, measured_us: float, budget_us: float) -> None:
    verdict = "" if measured_us <= budget_us else "  OVER BUDGET"
    print(f"{name:40} {measured_us:8.1f} us  (budget {budget_us:.0f}){verdict}")


def parsed(frame: bytes) -> Callable[[], object]:
    parser = ScipParser()

    def one_scan() -> None:
        (scan,) = parser.feed(frame)
        assert isinstance(scan, ScanReply)

    return one_scan


def twin_scan() -> Callable[[], object]:
    twin = HokuyoTwin(HokuyoTwinConfig(), lambda stamp: RANGES, seed=1)
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
    twin = HokuyoTwin(HokuyoTwinConfig(), lambda stamp: RANGES, seed=1)
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
    report("decode data blocks", microseconds(lambda: to_values(unblock(data), 3)), 25)
    strong = ScanReply(ScanRequest("ME", 0, 1080), "99", 4096, readings, readings)
    report("check and decode a frame, MD", microseconds(parsed(frame)), 25)
    report("check and decode a frame, ME", microseconds(parsed(encode_scan(strong))), 30)
    report("encode a frame", microseconds(lambda: encode_scan(scan)), 60)
    report("driver: bytes to Scan", microseconds(driver_scan(frame, request)), 100)
    report("twin: ranges to bytes", microseconds(twin_scan()), 150)
    seconds = timeit.timeit(lambda: run_in_virtual_time(stream(RUNS)), number=1)
    report("twin and driver over a pipe, per scan", seconds / RUNS * 1e6, 500)


if __name__ == "__main__":
    main()
