"""A patrol of many hours while doors close and open: is the map still right, and nothing grows?

    python -m benchmarks.patrol --hours 24

In virtual time, on the twins: the robot explores two rings with a bar in common, and drives from
vertex to vertex from then on; its battery stays full. Two doors in the bar swing at random moments.
After every hour a line says how many vertices were reached and missed, how far the worst vertex is
from where it was when the patrol began and the robot from where it believes to be, what the map and
the mission have come to, in memory and on disk, and what the hour cost. The exit status is 1 if the
map has changed, if the robot touched something, or if at the end the journal is a tenth longer than
it ever was before, or memory holds a tenth more objects than after the second hour.
"""

import argparse
import gc
import json
import math
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from benchmarks.rigs.doors_rig import FLUSH, MIDDLE, START, swing, theta
from benchmarks.rigs.run_rig import at_once
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.maps.run_directory import EVENTS, RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT, MissionFiles
from gvgbot.robot import Robot
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import Place

OPEN_S, SHUT_S = 600.0, 300.0  # a door, on average
HOUR_S = 3600.0
ROOM_M = 0.4  # from a door, if it shall close
REACTION_S, BRAKING_MPS2 = 0.4, 0.5  # of a robot on its way: a scan, and what a base takes to obey
MOVED_M = 0.2  # a vertex may come to stand so far off
GROWTH = 1.1
HEAD = (
    "hour rounds reached missed vertices edges moved m  pose m hits keyframes journal kB "
    "snapshot kB events kB objects k memory MB  CPU s"
)

KEPT = (JOURNAL, SNAPSHOT, EVENTS)
Door = tuple[float, float, float, float]  # x, x, y, y
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each hour; 1 if the map has changed or something grows."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--hours", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path, help="a file for a line of JSON per hour")
    options = parser.parse_args(arguments)
    settings = [f"twin.seed={options.seed}", "twin.base.battery_drain_v_per_h=0"]
    config = load_config(None, [*settings, *options.overrides])
    with tempfile.TemporaryDirectory() as directory, RunDirectory(Path(directory)) as run:
        patrol = Patrol(config, run, options.hours, options.out)
        print(HEAD, flush=True)
        run_in_virtual_time(patrol.live())
    return int(has_failed(patrol.rows))


class Patrol:
    """A robot, its world and its owner."""

    def __init__(self, config: Config, run: RunDirectory, hours: int, out: Path | None) -> None:
        self._world, self._hours, self._out = theta(), hours, out
        self._session = Session(config, run, Place(self._world, START))
        self._keeper = Keeper(self._session, MissionFiles(run.path))
        self._rng = np.random.default_rng((config.twin.seed, 13))
        self._shut: dict[Door, bool] = {MIDDLE: False, FLUSH: False}
        self._places: dict[int, np.ndarray] = {}
        self._cpu = time.process_time()
        self.rows: list[Row] = []

    async def live(self) -> None:
        """Explore and patrol until the hours are over."""
        robot = Robot(self._session, Notifier(None), None, off_loop=at_once, keeper=self._keeper)
        await robot.serve(self._own())

    async def _own(self) -> str:
        clock, pipeline = LoopClock(), self._session.pipeline
        while pipeline.mission.outcome is None:
            await clock.sleep_until(clock.now() + 1.0)
        self._places = self._now()
        pipeline.errands.patrol((), clock.now())
        began = clock.now()
        swings = {door: self._next(clock.now(), door) for door in self._shut}
        for hour in range(1, self._hours + 1):
            while clock.now() < began + hour * HOUR_S:
                await clock.sleep_until(clock.now() + 1.0)
                for door, due in swings.items():
                    if clock.now() > due and not self._is_in(door):
                        self._shut[door] = not self._shut[door]
                        swing(self._world, door, shut=self._shut[door])
                        swings[door] = self._next(clock.now(), door)
            self._take_down(hour)
        return "the end"

    def _next(self, now: float, door: Door) -> float:
        return now + float(self._rng.exponential(SHUT_S if self._shut[door] else OPEN_S))

    def _is_in(self, door: Door) -> bool:
        """Whether the robot stands in a door, or is so near that it could not stop before it."""
        assert self._session.simulation is not None
        body = self._session.simulation.body
        x0, x1, y0, y1 = door
        here, speed = body.pose, abs(body.linear)
        gap = math.hypot(max(x0 - here.x, 0.0, here.x - x1), max(y0 - here.y, 0.0, here.y - y1))
        return gap < ROOM_M + REACTION_S * speed + speed**2 / (2 * BRAKING_MPS2)

    def _now(self) -> dict[int, np.ndarray]:
        """Where the vertices are, map frame."""
        belief = self._session.pipeline.mapper.belief
        return {vertex: belief.map_vertex(vertex).position for vertex in belief.ids}

    def _take_down(self, hour: int) -> None:
        session, now = self._session, self._now()
        rounds = [line for line in _lines(session.directory.path) if line["event"] == "round_ended"]
        assert session.simulation is not None
        body, cpu = session.simulation.body, time.process_time()
        off = START.compose(session.pipeline.map_base).distance(body.pose)
        same = now.keys() & self._places.keys()
        size = {name: (session.directory.path / name).stat().st_size for name in KEPT}
        gc.collect()
        row = {
            "hour": hour,
            "rounds": len(rounds),
            "reached": sum(line["reached"] for line in rounds),
            "missed": sum(line["missed"] for line in rounds),
            "is_same": now.keys() == self._places.keys(),
            "vertices": len(now),
            "edges": len(session.pipeline.mapper.graph.edges),
            "moved_m": max(float(np.hypot(*(now[v] - self._places[v]))) for v in same),
            "pose_m": off,
            "contacts": body.contacts,
            "keyframes": len(session.pipeline.past.keyframes),
            "bytes": size,
            "objects": len(gc.get_objects()),
            "memory_mb": _memory_mb(),
            "cpu_s": cpu - self._cpu,
        }
        self._cpu = cpu
        self.rows.append(row)
        print(line(row), flush=True)
        if self._out is not None:
            with self._out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    for text in (path / EVENTS).read_text(encoding="utf-8").splitlines():
        yield json.loads(text)


def _memory_mb() -> float:
    """What the process holds in memory now."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * 4096 / 1e6


def line(row: Row) -> str:
    """An hour."""
    journal, snapshot, events = (row["bytes"][name] / 1000 for name in KEPT)
    return (
        f"{row['hour']:4} {row['rounds']:6} {row['reached']:7} {row['missed']:6} "
        f"{row['vertices']:8} {row['edges']:5} {row['moved_m']:7.3f} {row['pose_m']:7.3f} "
        f"{row['contacts']:4} {row['keyframes']:9} {journal:10.0f} {snapshot:11.0f} "
        f"{events:9.0f} {row['objects'] / 1000:9.1f} {row['memory_mb']:9.0f} {row['cpu_s']:6.0f}"
        f"{'' if row['is_same'] else '  OTHER VERTICES'}"
    )


def has_failed(rows: list[Row]) -> bool:
    """Whether the map has changed, or the mission grows from the second hour on."""
    second, last = rows[min(1, len(rows) - 1)], rows[-1]
    return (
        not last["is_same"]
        or last["moved_m"] > MOVED_M
        or last["contacts"] > 0
        or last["bytes"][JOURNAL] > GROWTH * max(row["bytes"][JOURNAL] for row in rows[:-1] or rows)
        or last["objects"] > GROWTH * second["objects"]
    )


if __name__ == "__main__":
    sys.exit(main())
