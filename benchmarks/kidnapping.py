"""Starts the daemon on a known map at random poses that nobody tells it: does it find out where?

    python -m benchmarks.kidnapping --worlds office grid floor_plan:3 --poses 50

Each world is explored once; then the robot is put down at poses drawn from all that it can reach,
in virtual time, on the twins. `right` claims a place within 0.5 m and 15 degrees of the truth,
`wrong` claims another one, and `unsure` says that it does not know, or has not found out after
half an hour. Distance and time are what passes until a right claim. Maps and results stay in
`--out`, and a second call goes on from there; the exit status is 1 if a claim was wrong.
"""

import argparse
import math
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product, starmap
from pathlib import Path
from statistics import median

import numpy as np
import structlog
from scipy import ndimage

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.rigs.run_rig import at_once
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.daemon import explore
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose, wrap_angle
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import SNAPSHOT, MissionFiles
from gvgbot.robot import Robot
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import Place, open_place
from gvgbot.stop_signals import StopSignals

WORLDS = ("office", "floor_plan:3", "jittered:1", "grid", "rooms", "ring")
RESULTS = "kidnapping.jsonl"
NEAR_M, NEAR_RAD = 0.5, math.radians(15.0)  # of the truth, a place is right
SPARE_M = 0.1  # between the robot that is put down and a wall
PATIENCE_S = 1800.0
LOOK_S = 0.1  # between two looks at the robot


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each pose, then one for each world; 1 if a claim was wrong."""
    options = _options(arguments)
    rows = []
    for row in _rows(options):
        rows.append(row)
        print(line(row), flush=True)
    for text in summary(rows):
        print(text)
    return int(any(row["verdict"] == "wrong" for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--worlds", nargs="+", default=list(WORLDS))
    parser.add_argument("--poses", type=int, default=20, help="for each world")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of poses, from 1")
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path, default=Path("runs/kidnapping"))
    return parser.parse_args(arguments)


def _rows(options: argparse.Namespace) -> Iterator[Row]:
    """The results that are in `out`, then the others as they come."""
    numbers = options.only or range(1, options.poses + 1)
    return campaign.rows(
        options.out / RESULTS,
        product(options.worlds, numbers, [tuple(options.overrides)]),
        lambda cases: starmap(partial(_put_down, options.out), cases),
        case_of=lambda row: (row["world"], row["pose"], tuple(row.get("settings", ()))),
        anew=options.only is not None,
    )


def _put_down(out: Path, world: str, number: int, settings: tuple[str, ...]) -> Row:
    known = out / re.sub(r"[^\w.]", "-", " ".join([world, *settings]))
    config = load_config(None, [f"twin.world={world}", "twin.seed=1", *settings])
    if not (known / SNAPSHOT).exists():
        explore(config, print, StopSignals(), out=known, real_time=False)
    config = load_config(None, [f"twin.world={world}", f"twin.seed={number}", *settings])
    named = {"world": world, "pose": number, "settings": settings}
    with tempfile.TemporaryDirectory() as directory:
        return named | kidnapped(config, known, number, Path(directory))


def kidnapped(config: Config, known: Path, number: int, out: Path) -> Row:
    """What becomes of a robot that wakes at pose `number` of a world whose map is in `known`."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    place = open_place(config)
    rng = np.random.default_rng((number, 7))
    start = free_pose(place.world, place.start, config.robot.radius_m + SPARE_M, rng)
    there = Place(place.world, start, place.walkways)
    with RunDirectory(out) as directory:
        row: Row = run_in_virtual_time(_seek(config, known, directory, there, place.start))
    return {"start": [start.x, start.y, start.theta]} | row


async def _seek(
    config: Config, known: Path, directory: RunDirectory, place: Place, world_map: Pose
) -> Row:
    session = Session(config, directory, place)
    keeper = Keeper(session, MissionFiles(directory.path), MissionFiles(known).read())
    robot = Robot(session, Notifier(None), None, off_loop=at_once, keeper=keeper)
    clock = LoopClock()

    async def known_or_not() -> str:
        while session.pipeline.is_lost and session.pipeline.mission.outcome is None:
            if clock.now() > PATIENCE_S:
                break
            await clock.sleep_until(clock.now() + LOOK_S)
        return "found out, or not"

    await robot.serve(known_or_not())
    assert session.simulation is not None
    body = session.simulation.body
    truth, claim = world_map.inverse().compose(body.pose), session.pipeline.map_base
    off, turned = truth.distance(claim), abs(wrap_angle(truth.theta - claim.theta))
    is_right = off < NEAR_M and turned < NEAR_RAD
    verdict = "unsure" if session.pipeline.is_lost else "right" if is_right else "wrong"
    return {
        "verdict": verdict,
        "driven_m": body.distance_m,
        "duration_s": clock.now(),
        "off_m": None if session.pipeline.is_lost else off,
        "off_rad": None if session.pipeline.is_lost else turned,
        "contacts": body.contacts,
        "reason": session.pipeline.mission.reason,
    }


def free_pose(world: World, start: Pose, room: float, rng: np.random.Generator) -> Pose:
    """A pose in the world frame, drawn from all that a disc can reach from `start`."""
    res, (x0, y0) = world.resolution_m, world.origin
    free = ndimage.distance_transform_edt(~world.occupied) * res > room
    rooms, _ = ndimage.label(free)
    here = rooms[int((start.y - y0) / res), int((start.x - x0) / res)]
    rows, columns = np.nonzero(rooms == here)
    k = int(rng.integers(len(rows)))
    x, y = x0 + (columns[k] + 0.5) * res, y0 + (rows[k] + 0.5) * res
    return Pose(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


def line(row: Row) -> str:
    """What became of a pose."""
    off = "" if row["off_m"] is None else f"{row['off_m']:.2f} m {row['off_rad']:.2f} rad off"
    x, y, theta = row["start"]
    return (
        f"{row['world']:14} {row['pose']:3} ({x:5.1f}, {y:5.1f}, {theta:5.2f}) {row['verdict']:6} "
        f"{row['driven_m']:6.1f} m {row['duration_s']:6.0f} s  {off} {row['reason']}"
    )


def summary(rows: list[Row]) -> Iterator[str]:
    """The table."""
    yield "| world | poses | right | not sure | wrong | median m | 90 % m | median s | contacts |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for world in dict.fromkeys(row["world"] for row in rows):
        mine = [row for row in rows if row["world"] == world]
        right = [row for row in mine if row["verdict"] == "right"]
        unsure, wrong = (sum(r["verdict"] == v for r in mine) for v in ("unsure", "wrong"))
        driven = [row["driven_m"] for row in right] or [math.nan]
        yield (
            f"| {world} | {len(mine)} | {len(right)} ({len(right) / len(mine):.0%}) | {unsure} | "
            f"{wrong} | {median(driven):.1f} | {float(np.percentile(driven, 90)):.1f} | "
            f"{median([row['duration_s'] for row in right] or [math.nan]):.0f} | "
            f"{sum(row['contacts'] for row in mine)} |"
        )


if __name__ == "__main__":
    sys.exit(main())
