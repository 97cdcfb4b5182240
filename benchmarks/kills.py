"""Kills an exploration at random moments and starts it again until it is done: is the map the same?

    python -m benchmarks.kills --runs 20 --kills 10

In virtual time, on the twins, whose world goes on while the robot is dead. A kill abandons the
whole stack, and the next one is built from the files alone. Before that the files are damaged, in
turn: not at all, the journal's tail cut, a bit of it flipped, the newest snapshot's end cut. The
last map is compared with that of a run that nobody interrupted: `lost` vertices have no partner of
their kind within 0.5 m, `extra` ones are nobody's partner, `off` is the worst distance of a pair.
Results stay in `--out`, and a second call goes on from there; the exit status is 1 if a run failed.
"""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import structlog
from scipy.optimize import linear_sum_assignment

from benchmarks import campaign
from benchmarks.campaign import Row
from benchmarks.rigs.lives_rig import GoingWorld, Lives
from benchmarks.small_worlds import two_rings
from gvgbot.config import load_config
from gvgbot.geometry import Array
from gvgbot.maps import geojson
from gvgbot.maps.run_directory import EVENTS
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT
from gvgbot.session import Session
from gvgbot.simulation import open_place

RESULTS = "kills.jsonl"
WANTED_M = 0.05  # vertices may be so far from those of the uninterrupted run
PARTNERS_M = 0.5  # farther apart, they are not the same
TAIL = 200  # bytes at the end of a file in which it is damaged
SHORTEST_S = 1.0  # from a start to the next kill

Points = dict[str, Array]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print a line for each run, then all of them together; 1 if one failed."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    options = _options(arguments)
    rows = []
    for row in _rows(options):
        rows.append(row)
        print(line(row), flush=True)
    print(summary(rows))
    return int(any(has_failed(row) for row in rows))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--world", help="default: two small rings")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--kills", type=int, default=10, help="in each run")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of runs, from 1")
    parser.add_argument("--out", type=Path, default=Path("runs/kills"))
    return parser.parse_args(arguments)


def _rows(options: argparse.Namespace) -> Iterator[Row]:
    """The results that are in `out`, then the others as they come."""
    return campaign.rows(
        options.out / RESULTS,
        options.only or range(1, options.runs + 1),
        lambda numbers: (interrupted(options.world, n, options.kills) for n in numbers),
        case_of=lambda row: int(row["run"]),
        anew=options.only is not None,
    )


def interrupted(world: str | None, number: int, kills: int) -> Row:
    """How a run with kills compares with the same run without any."""
    config = load_config(None, [f"twin.seed={number}", f"twin.world={world or 'office'}"])
    place = open_place(config) if world else two_rings()
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        whole = Lives(config, place, Path(one))
        duration = whole.run([]).tally.last_stamp
        wanted = vertices(Path(one))
        damage = Damage(number)
        lives = Lives(config, place, Path(other), between=damage)
        mean = duration / kills
        moments = _Lifetimes(lives, mean, np.random.default_rng((number, 11)))
        row: Row = {"run": number, "kills": kills, "damage": damage.counts}
        try:
            last = lives.run([moments] * kills)
        except Exception as error:  # noqa: BLE001  # each is a finding
            return row | {"outcome": "crashed", "reason": f"{type(error).__name__}: {error}"}
        return row | _ended(last, lives) | compared(wanted, vertices(Path(other)))


class _Lifetimes:
    """Lives as long as they are drawn, s."""

    def __init__(self, lives: Lives, mean: float, rng: np.random.Generator) -> None:
        self._lives, self._mean, self._rng = lives, mean, rng
        self._number, self._end = 0, 0.0

    def __call__(self, session: Session, now: float) -> bool:
        if len(self._lives.sessions) > self._number:
            self._number = len(self._lives.sessions)
            self._end = now + SHORTEST_S + self._rng.exponential(self._mean - SHORTEST_S)
        return now >= self._end


class Damage:
    """What happens to the files of a dead robot, each kind in turn."""

    def __init__(self, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self._rng = np.random.default_rng((seed, 12))

    def __call__(self, world: GoingWorld, out: Path) -> None:
        kind = ("none", "journal cut", "journal bit", "snapshot cut")[self.counts.total() % 4]
        path = out / (SNAPSHOT if kind == "snapshot cut" else JOURNAL)
        self.counts[kind] += 1
        if kind == "none" or not path.exists():
            return
        data = bytearray(path.read_bytes())
        place = int(self._rng.integers(1, min(TAIL, len(data)) + 1))
        if kind == "journal bit":
            data[-place] ^= 1 << int(self._rng.integers(8))
        else:
            del data[-place:]
        path.write_bytes(data)


def compared(wanted: Points, found: Points) -> Row:
    """How the vertices of a map differ from those of the map that was wanted."""
    lost, extra, offs = 0, 0, [0.0]
    for kind in wanted.keys() | found.keys():
        one, other = (points.get(kind, np.empty((0, 2))) for points in (wanted, found))
        gaps = np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1))
        pairs = np.array(linear_sum_assignment(np.minimum(gaps, PARTNERS_M))).T
        near = [gaps[i, j] for i, j in pairs if gaps[i, j] < PARTNERS_M]
        lost, extra = lost + len(one) - len(near), extra + len(other) - len(near)
        offs += near
    return {
        "vertices": sum(len(points) for points in wanted.values()),
        "lost": lost,
        "extra": extra,
        "off_m": float(max(offs)),
    }


def _ended(last: Session, lives: Lives) -> Row:
    return {
        "outcome": last.pipeline.mission.outcome,
        "reason": last.pipeline.mission.reason,
        "searches": searches(lives.out),
        "contacts": lives.world.body.contacts,
        "duration_s": last.tally.last_stamp,
    }


def searches(out: Path) -> int:
    """How often a robot had to look for its place on the map."""
    told = (out / EVENTS).read_text(encoding="utf-8")
    return told.count("look for its place on the map")


def vertices(out: Path) -> Points:
    """The places of a run's vertices (N, 2), m, map frame, by kind."""
    found: dict[str, list[Any]] = {}
    route = geojson.decode((out / "map.geojson").read_text(encoding="utf-8"))
    for vertex in route.vertices:
        found.setdefault(vertex.kind, []).append(vertex.position)
    return {kind: np.array(points, np.float64) for kind, points in found.items()}


def has_failed(row: Row) -> bool:
    """Whether a run did not end with the map of the uninterrupted one."""
    return bool(
        row["outcome"] != "explored"
        or row["lost"] + row["extra"] + row["contacts"] > 0
        or row["off_m"] > WANTED_M
    )


def line(row: Row) -> str:
    """What became of a run."""
    if row["outcome"] == "crashed":
        return f"run {row['run']:3}: {row['kills']} kills, CRASHED: {row['reason']}"
    return (
        f"run {row['run']:3}: {row['kills']} kills, {row['outcome']}, {row['vertices']} vertices, "
        f"lost {row['lost']}, extra {row['extra']}, off {row['off_m'] * 100:.1f} cm, "
        f"searches {row['searches']}, contacts {row['contacts']}, {row['duration_s']:.0f} s"
        f"{'  FAILED' if has_failed(row) else ''}"
    )


def summary(rows: list[Row]) -> str:
    """All runs together."""
    whole = [row for row in rows if row["outcome"] != "crashed"]
    damage = sum((Counter[str](row["damage"]) for row in rows), Counter[str]())
    return (
        f"{len(rows)} runs, {sum(row['kills'] for row in rows)} kills ("
        + ", ".join(f"{kind} {count}" for kind, count in damage.items())
        + f"); failed {sum(map(has_failed, rows))}, vertices {sum(r['vertices'] for r in whole)}, "
        f"lost {sum(r['lost'] for r in whole)}, extra {sum(r['extra'] for r in whole)}, "
        f"worst {max((r['off_m'] for r in whole), default=0.0) * 100:.1f} cm, "
        f"contacts {sum(r['contacts'] for r in whole)}"
    )


if __name__ == "__main__":
    sys.exit(main())
