"""What telemetry costs the daemon at full rate, and how late it arrives in another process.

Run: python -m benchmarks.bench_telemetry [SECONDS]

Scans of 1081 beams at 40 Hz, odometry at its rate, the state at 10 Hz, and each second a map of
200 vertices, what has changed in a grid of 60 by 60 m, a trajectory of 2,000 poses, and the health
are made as the daemon makes them, and sent to a listener on loopback.
On a machine that is busy otherwise, `chrt -f 10` before it tells the delays of its own.
"""

import asyncio
import contextlib
import json
import math
import resource
import subprocess
import sys
import time
from collections.abc import AsyncIterable, Callable
from typing import Any, cast

import msgspec
import numpy as np

from benchmarks.report import report, report_fact
from benchmarks.rigs.addresses import free_endpoint
from gvgbot import client
from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.keyframes import Keyframe, Step
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import Belief, OdometryNoise
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Battery, Odometry, Scan
from gvgbot.hal.packed_scan import PackedScan
from gvgbot.live.feed import LiveFeed
from gvgbot.live.map import LiveMap
from gvgbot.snapshots import state
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    HEALTH,
    LinkHealth,
    Map,
)
from gvgbot.vitals import Vitals

VERTICES, BEAMS, SIDE = 200, 1081, 60.0
STATE_HZ, MAP_HZ, SCAN_HZ, ODOMETRY_HZ = 10.0, 1.0, 40.0, 50.0
FINE = LinkHealth(connected=True, messages=1, damaged=0, lost=0, reconnects=0, clock_offset=0.0)
_ANGLES = np.linspace(0.0, 2.0 * math.tau, 1800)  # where it stood at each keyframe
STEP_NOISE = np.diag([1e-4, 1e-4, 1e-4])
LISTENER = ("-m", "benchmarks.bench_telemetry", "listen")


def graph() -> tuple[GvgGraph, Belief]:
    """Vertices in a row, each joined to the next, with a frontier at the last."""
    made = GvgGraph()
    places = np.random.default_rng(2).uniform(0.0, SIDE, (VERTICES, 2))
    for number, (x, y) in enumerate(places.tolist()):
        made.vertices[number] = Vertex(number, 1.0, Pose(x, y), 0.0, 0.0)
    for number in range(VERTICES - 1):
        near, far = made.vertices[number], made.vertices[number + 1]
        out, back = near.add_half_edge(0.0), far.add_half_edge(math.pi)
        line = np.linspace(places[number], places[number + 1], 100) - places[number]
        made.join(HalfEdgeId(near.id, out), HalfEdgeId(far.id, back), line, 0.5, driven=True)
    made.vertices[VERTICES - 1].add_half_edge(1.0)
    x = np.zeros((VERTICES + 1, 3))
    x[1:, :2] = places
    return made, Belief(x.ravel(), 0.01 * np.eye(x.size), tuple(range(VERTICES)))


class Robot:
    """As much of a daemon as telemetry needs, somewhere in a large map."""

    def __init__(self, network: Telemetry) -> None:
        known, belief = graph()
        self.pipeline = _mind(known, belief)
        self.network, self.live_map = network, LiveMap(0.0)
        self.vitals = Vitals(time.perf_counter())
        self.feed = LiveFeed(network, self.pipeline, SCAN_HZ)
        self.rng, self.sequence = np.random.default_rng(1), 0

    def scan(self, stamp: float) -> Scan:
        ranges = self.rng.uniform(2.0, 12.0, BEAMS)
        step = math.radians(270.0) / (BEAMS - 1)
        return Scan(stamp, ranges, -math.radians(135.0), step, 0.1, 30.0)

    def odometry(self, stamp: float) -> Odometry:
        return Odometry(stamp, Pose(), Twist(0.2, 0.1))

    def on_scan(self) -> None:
        self.feed.on_scan(self.scan(time.perf_counter()))

    def on_odometry(self) -> None:
        self.feed.on_odometry(self.odometry(time.perf_counter()))

    def on_beat(self) -> None:
        stamp = time.perf_counter()
        self.sequence += 1
        self.network.publish(
            state(
                self.pipeline,
                self.odometry(stamp),
                Battery(stamp, 16.0, 0.9, charging=False),
                stamp=stamp,
                sequence=self.sequence,
                cycles=self.sequence,
                uptime=self.vitals.uptime(stamp),
                noise=OdometryNoise(),
                away=None,
                guard=None,
                contacts=0,
                slips=0,
                laser=FINE,
                base=FINE,
            )
        )
        self.feed.on_beat(stamp, "ear")

    def on_map(self) -> None:
        x, y = self.rng.uniform(0.0, SIDE, 2).tolist()
        stamp = time.perf_counter()
        self.arrive(Pose(x, y), self.scan(stamp))
        draw = self.live_map.update(self.pipeline, stamp)
        assert draw is not None
        for value, latest in draw():  # stamped when ready, so that only the way is measured
            now = msgspec.structs.replace(cast(Map, value), stamp=time.perf_counter())
            self.network.publish(now, latest)

    def on_health(self) -> None:
        stamp = time.perf_counter()
        self.vitals.note_cycle(0.01)
        self.network.publish(self.vitals.health(stamp, unsent=0, laser=FINE, base=FINE))

    def fill(self) -> None:
        """Have seen the whole map before, so that it is as large as it gets."""
        for x in np.arange(4.0, SIDE, 8.0).tolist():
            for y in np.arange(4.0, SIDE, 8.0).tolist():
                self.arrive(Pose(x, y), self.scan(0.0))
        for at in np.linspace(0.0, 50.0, 2000).tolist():
            self.arrive(Pose(at, at), None)

    def arrive(self, here: Pose, scan: Scan | None) -> None:
        """Add a keyframe, and the step that led to it."""
        past, kept = self.pipeline.past, None if scan is None else PackedScan(scan)
        if past.last is not None:
            past.steps.append(Step(past.last.map_base.to(here), STEP_NOISE))
        stamp = 0.0 if scan is None else scan.stamp
        past.keyframes.append(Keyframe(stamp, here, here, here, kept))


def _mind(known: GvgGraph, belief: Belief) -> Pipeline:
    """A mind with a map, at its first vertex, that goes to the last."""
    pipeline = Pipeline(AutonomyConfig(), ExplorationConfig(), 0.177)
    pipeline.mapper.graph, pipeline.mapper.belief = known, belief
    pipeline.mission.target = HalfEdgeId(VERTICES - 1, 1)
    pipeline.mission.where.on_edge = HalfEdgeId(0, 0)
    return pipeline


async def every(action: Callable[[], None], rate_hz: float, *, in_thread: bool = False) -> None:
    due = time.perf_counter()
    while True:
        if in_thread:
            await asyncio.to_thread(action)
        else:
            action()
        due += 1.0 / rate_hz
        await asyncio.sleep(max(0.0, due - time.perf_counter()))


async def speak(robot: Robot, seconds: float) -> tuple[float, float]:
    """The share of a core that it took, and the longest that one scan held the loop, s."""
    longest = 0.0

    def on_scan() -> None:
        nonlocal longest
        begin = time.perf_counter()
        robot.on_scan()
        longest = max(longest, time.perf_counter() - begin)

    robot.fill()
    for _ in range(8):  # as many messages as the grid takes
        robot.on_map()
    work = [
        every(on_scan, SCAN_HZ),
        every(robot.on_odometry, ODOMETRY_HZ),
        every(robot.on_beat, STATE_HZ),
        every(robot.on_map, MAP_HZ, in_thread=True),
        every(robot.on_health, HEALTH.rate_hz),
    ]
    used, begin = cpu(), time.perf_counter()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(seconds), asyncio.TaskGroup() as tasks:
            for task in work:
                tasks.create_task(task)
    return (cpu() - used) / (time.perf_counter() - begin), longest


async def idle(seconds: float) -> float:
    """The share of a core that the same timers and scans take without telemetry."""
    rng = np.random.default_rng(1)
    used, begin = cpu(), time.perf_counter()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(seconds), asyncio.TaskGroup() as tasks:
            tasks.create_task(every(lambda: _draw(rng), SCAN_HZ))
            for rate_hz in (ODOMETRY_HZ, STATE_HZ, MAP_HZ, HEALTH.rate_hz):
                tasks.create_task(every(lambda: None, rate_hz))
    return (cpu() - used) / (time.perf_counter() - begin)


def _draw(rng: np.random.Generator) -> None:
    rng.uniform(2.0, 12.0, BEAMS)


def redrawing() -> tuple[float, float]:
    """The CPU time of drawing grid and way anew after a closure, and how long it held the loop, s.

    The robot drove around a loop; the trip meter of odometry ran 1 % fast.
    """
    way = [Pose(20.0 * math.sin(a), 20.0 * (1.0 - math.cos(a)), a) for a in _ANGLES.tolist()]
    pipeline, rng = _mind(GvgGraph(), Belief()), np.random.default_rng(1)
    far = [Pose(1.01 * pose.x, 1.01 * pose.y, pose.theta) for pose in way]
    step = math.radians(270.0) / (BEAMS - 1)
    for i, (true, believed) in enumerate(zip(way, far, strict=True)):
        seen = Scan(0.1 * i, rng.uniform(2.0, 12.0, BEAMS), -2.35, step, 0.1, 30.0)
        keyframe = Keyframe(
            0.1 * i, believed, believed, believed, None if i % 3 else PackedScan(seen)
        )
        pipeline.past.keyframes.append(keyframe)
        pipeline.past.steps.append(Step(true.to(way[min(i + 1, len(way) - 1)]), STEP_NOISE))
    live_map, begin = LiveMap(0.0), time.perf_counter()
    draw = live_map.update(pipeline, 1.0)
    held, used = time.perf_counter() - begin, cpu()
    assert draw is not None
    draw()
    return cpu() - used, held


def cpu() -> float:
    """Seconds of all threads."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


async def listen(endpoint: str, seconds: float) -> None:
    """Print how late each kind of value is in this process, s, as JSON."""
    late: dict[str, list[float]] = {}

    async def note(kind: str, values: AsyncIterable[Any]) -> None:
        async for value in values:
            late.setdefault(kind, []).append(
                time.perf_counter() - value.stamp
            )  # one clock for all processes

    async with client.connect("bench", endpoint) as seen:
        sources: dict[str, AsyncIterable[Any]] = {
            "scan": seen.scan(),
            "state": seen.state(),
            "odometry": seen.odometry(),
            "map": seen.map(),
            "grid": seen.grid(),
            "trajectory": seen.trajectory(),
            "health": seen.health(),
        }
        print("ready", flush=True)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds), asyncio.TaskGroup() as tasks:
                for kind, values in sources.items():
                    tasks.create_task(note(kind, values))
    print(json.dumps(late), flush=True)


def main(seconds: float) -> None:
    endpoint = free_endpoint()
    with Telemetry(TelemetryConfig(listen=(endpoint,)), "bench") as network:
        robot = Robot(network)
        alone, _ = asyncio.run(speak(robot, seconds / 4))
        command = [sys.executable, *LISTENER, endpoint, f"{seconds + 2.0}"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as listener:
            assert listener.stdout is not None
            listener.stdout.readline()
            heard, longest = asyncio.run(speak(Robot(network), seconds))
            late = json.loads(listener.stdout.readline())
    timers = asyncio.run(idle(seconds / 4))
    report("telemetry with one listener", 100 * (heard - timers), "% of a core", at_most=5.0)
    report("telemetry that nobody listens to", 100 * (alone - timers), "% of a core", at_most=5.0)
    report("longest time that one scan held the loop", 1e3 * longest, "ms", at_most=5.0)
    redrawn, held = redrawing()
    report_fact("600 scans drawn anew after a closure: CPU", redrawn, "s")
    report("the same: time that it held the loop", 1e3 * held, "ms", at_most=5.0)
    for kind, seen in late.items():
        delays = 1e3 * np.array(seen[1:])  # the first one may have waited for the listener
        for share in (50, 99):
            name = f"{kind}: late, p{share} of {len(delays)}"
            report(name, float(np.percentile(delays, share)), "ms", at_most=10.0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["listen"]:
        asyncio.run(listen(sys.argv[2], float(sys.argv[3])))
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
