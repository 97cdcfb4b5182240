"""Kills `gvgbot run` itself at random moments and starts it again: is the map the same?

    python -m benchmarks.process_kills --runs 2 --kills 10

In real time: `gvgbot twin` serves the devices on pseudo-terminals and lives on, `gvgbot run` is a
process that keeps its mission in a state directory. The last map is compared, as in
`benchmarks.kills`, with that of a run in virtual time that nobody interrupted. Results and what was
said stay in `--out`, and a second call goes on from there; the exit status is 1 if a run failed.
"""

import argparse
import asyncio
import contextlib
import json
import os
import shutil
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.kills import compared, has_failed, line, searches, summary, vertices
from benchmarks.small_worlds import two_rings
from gvgbot.clock import LoopClock
from gvgbot.drivers.world import save_world
from gvgbot.maps.run_directory import EVENTS, SUMMARY
from gvgbot.persistence.mission_files import SNAPSHOT

RESULTS = "process_kills.jsonl"
SHORTEST_S = 2.0  # from a start to the next kill
DEAD_S = 1.0  # from a kill to the next start
LOOK_S = 0.2
PATIENCE_S = 900.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each run, then all of them together; 1 if one failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--kills", type=int, default=10, help="in each run")
    parser.add_argument("--out", type=Path, default=Path("runs/kills"))
    options = parser.parse_args(arguments)
    rows = []
    for row in campaign.rows(
        options.out / RESULTS,
        range(1, options.runs + 1),
        lambda numbers: (interrupted(options.out, n, options.kills) for n in numbers),
        case_of=lambda row: int(row["run"]),
    ):
        rows.append(row)
        print(line(row), flush=True)
    print(summary(rows))
    return int(any(has_failed(row) for row in rows))


def interrupted(out: Path, number: int, kills: int) -> Row:
    """How a run with kills compares with the same run without any."""
    directory = out / f"killed-{number}"
    shutil.rmtree(directory, ignore_errors=True)
    directory.mkdir(parents=True)
    row: Row = {"run": number, "kills": kills, "damage": {"none": kills}}
    return row | asyncio.run(_interrupted(directory.resolve(), number, kills))


async def _interrupted(directory: Path, number: int, kills: int) -> Row:
    place, whole, robot = two_rings(), directory / "whole", _Robot(directory)
    settings = [f"twin.world={save_world(place.world, directory)}", f"twin.seed={number}"]
    settings.append(f"twin.start=[{place.start.x},{place.start.y},{place.start.theta}]")
    await (await _gvgbot(directory, "explore", settings, "--out", str(whole))).wait()
    mean = json.loads((whole / SUMMARY).read_text("utf-8"))["duration_s"] / kills
    rng = np.random.default_rng((number, 17))
    async with _twins(directory, settings):
        for _ in range(kills):
            await robot.live(SHORTEST_S + float(rng.exponential(max(0.0, mean - SHORTEST_S))))
        await robot.finish()
    return robot.row | compared(vertices(whole), vertices(robot.out))


class _Robot:
    """`gvgbot run`, again and again, on the ports in a directory."""

    def __init__(self, directory: Path) -> None:
        self._directory, self._state_dir = directory, directory / "state"
        self._settings = [
            "twin.enabled=false",
            "telemetry.enabled=false",
            "robot.name=killed",
            f"laser.port={directory / 'laser'}",
            f"base.port={directory / 'base'}",
            f"service.state_dir={self._state_dir}",
        ]
        self._killed_early = 0  # while it explored

    @property
    def out(self) -> Path:
        """Where its mission is."""
        (path,) = (self._state_dir / "runs").iterdir()
        return path

    async def live(self, seconds: float) -> None:
        """Be killed so long after the start, or after the first look: before, there is nothing."""
        process = await _gvgbot(self._directory, "run", self._settings)
        await asyncio.wait_for(_until(self._has_begun), PATIENCE_S)
        await asyncio.sleep(seconds)
        self._killed_early += not self._is_done()
        process.kill()
        await process.wait()
        await asyncio.sleep(DEAD_S)

    async def finish(self) -> None:
        """Live until all is explored."""
        process = await _gvgbot(self._directory, "run", self._settings)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(_until(self._is_done), PATIENCE_S)
        process.terminate()
        await process.wait()

    def _has_begun(self) -> bool:
        return any(self._state_dir.glob(f"runs/*/{SNAPSHOT}"))

    def _is_done(self) -> bool:
        return '"event": "finished"' in (self.out / EVENTS).read_text("utf-8")

    @property
    def row(self) -> Row:
        """What became of it."""
        said = json.loads((self.out / SUMMARY).read_text("utf-8"))
        told = {key: said[key] for key in ("outcome", "reason", "contacts", "duration_s")}
        return told | {"searches": searches(self.out), "killed_early": self._killed_early}


async def _gvgbot(
    directory: Path, command: str, settings: list[str], *more: str
) -> asyncio.subprocess.Process:
    """A process that tells of itself in the directory."""
    words = [word for setting in settings for word in ("--set", setting)]
    with (directory / f"{command}.log").open("ab") as log:
        return await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "gvgbot", command, *more, *words),
            stdout=log,
            stderr=log,
            env=os.environ | campaign.ONE_CORE,
        )


@asynccontextmanager
async def _twins(directory: Path, settings: list[str]) -> AsyncIterator[None]:
    """Both devices at `laser` and `base` in a directory."""
    ports = [directory / "laser", directory / "base"]
    links = ("--laser-link", str(ports[0]), "--base-link", str(ports[1]))
    process = await _gvgbot(directory, "twin", settings, *links)
    try:
        await asyncio.wait_for(_until(lambda: all(p.exists() for p in ports)), PATIENCE_S)
        yield
    finally:
        process.terminate()
        await process.wait()


async def _until(is_so: Callable[[], bool]) -> None:
    clock = LoopClock()
    while not is_so():
        await clock.sleep_until(clock.now() + LOOK_S)


if __name__ == "__main__":
    sys.exit(main())
