"""Writes benchmarks.md from what is in benchmarks/results: python -m docs.make_benchmarks."""

import json
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean, median
from typing import Any

from benchmarks.campaign import Row
from benchmarks.explore_table import has_failed
from benchmarks.report import Measured
from docs.source import table

DOCS = Path(__file__).parent
PAGE = DOCS / "benchmarks.md"
RESULTS = DOCS.parent / "benchmarks" / "results"
HEAD = """\
# Benchmarks

<!-- Written by docs/make_benchmarks.py from what `make bench` leaves in benchmarks/results. -->

`make bench` measures, keeps the figures in `benchmarks/results` and writes this page; `ratio` is
the figure by its target. A figure that misses its target says so. Times are of the processor
unless a name says otherwise, but other programs on the machine lengthen those as well.

Tables of explorations take hours on one machine. With `--scheduler tcp://HOST:8786` the runs of
`python -m benchmarks.explore_table` are shared out on a Dask cluster instead (`gvgbot[cluster]`),
and `make keep RESULTS=FILE` quotes what comes back here and in the README.

"""
TITLES = {  # in the order of the page
    "bench_step": "A scan, stage by stage",
    "bench_daemon": "The daemon",
    "bench_devices": "The drivers at work",
    "bench_scip": "Bytes of the laser",
    "bench_kobuki": "Bytes of the base",
    "bench_filter": "The filter with many vertices",
    "bench_telemetry": "Telemetry",
    "bench_recording": "Recording",
    "bench_following": "How straight it drives",
    "bench_maps": "What is written at the end",
    "bench_ray_casting": "The simulated world",
}


def page() -> str:
    """The whole page, Markdown."""
    names = [name for name in TITLES if (RESULTS / f"{name}.json").exists()]
    kept = {name: json.loads((RESULTS / f"{name}.json").read_text("utf-8")) for name in names}
    parts = [_machine(kept), *(_section(name, part) for name, part in kept.items())]
    parts += [_explorations(), *_logs(), *_mutants()]
    return HEAD + "\n".join(parts)


def _machine(kept: dict[str, Any]) -> str:
    facts = next(iter(kept.values()))["machine"]
    rows = [(key, value) for key, value in facts.items() if key != "load"]
    return "## Machine\n\n" + table(("", ""), rows)


def _section(name: str, kept: dict[str, Any]) -> str:
    rows = [_row(Measured(**figure)) for figure in kept["figures"]]
    load = f"`{name}`, beside {kept['machine']['load']}."
    return f"## {TITLES[name]}\n\n{load}\n\n" + table(("", "measured", "target", "ratio", ""), rows)


def _row(figure: Measured) -> tuple[str, ...]:
    ratio = "" if figure.ratio is None else f"{figure.ratio:.2f}"
    missed = "**missed**" if figure.is_missed else ""
    return figure.what, f"{figure.value:.4g} {figure.unit}", figure.target, ratio, missed


def _explorations() -> str:
    """A line for each built-in world, and one for all floor plans, with each laser."""
    rows = []
    for name in ("worlds", "floor_plans"):
        lines = (RESULTS / f"{name}.jsonl").read_text(encoding="utf-8").splitlines()
        found: list[Row] = [json.loads(line) for line in lines]
        title = dict.fromkeys(
            (row["world"] if name == "worlds" else "floor plans", row["laser"]) for row in found
        )
        for world, laser in title:
            some = [
                r for r in found if r["laser"] == laser and world in (r["world"], "floor plans")
            ]
            rows.append((world, laser, *_common(some)))
    head = ("world", "laser", "runs", "complete", "recall", "with 3 cm to spare", "precision")
    more = (
        *("vertex RMSE, m", "worst"),
        *("way by shortest tour", "way by all edges once", "faster than life", "memory, MB"),
    )
    return (
        "## Exploration\n\nMeans over runs, but the median of ways. The shortest tour is the open "
        "postman's over all edges; a robot that sees a dead end from its mouth may drive less. "
        "Recall with 3 cm to spare is that of what a robot reaches that keeps these on each "
        "side, where runs were scored by that, too.\n\n" + table((*head, *more), rows)
    )


def _common(rows: list[Row]) -> tuple[str, ...]:
    """What runs have in common."""
    good = sum(not has_failed(row) for row in rows)
    scored = [row for row in rows if row.get("recall") is not None]
    means = [
        _mean([row[key] for row in scored if row.get(key) is not None])
        for key in ("recall", "roomy_recall", "precision", "vertex_rmse_m")
    ]
    means.append(f"{max(row['vertex_rmse_m'] for row in scored):.3f}")
    ways = median(row["path_ratio"] for row in scored if row["path_ratio"] is not None)
    once = median(row["driven_m"] / row["gvg_m"] for row in scored if row["gvg_m"])
    speed, memory = (fmean(row[key] for row in rows if key in row) for key in SPEED)
    return (
        str(len(rows)),
        str(good),
        *means,
        f"{ways:.2f}",
        f"{once:.2f}",
        f"{speed:.0f}",
        f"{memory:.0f}",
    )


def _mean(values: list[float]) -> str:
    return f"{fmean(values):.3f}" if values else ""


SPEED = ("speed_factor", "memory_mb")


def _logs() -> Iterator[str]:
    path = RESULTS / "relations.json"
    if not path.exists():
        return
    kept = json.loads(path.read_text(encoding="utf-8"))
    head = ("mapper", "relations", "mean, m", "median, m", "most, m", "mean, degrees", "CPU, s")
    rows = [
        (
            row["mapper"],
            str(row["pairs"]),
            *(f"{row[key]:.4f}" for key in ("mean_m", "median_m", "most_m")),
            f"{row['mean_deg']:.3f}",
            f"{row['cpu_s']:.1f}",
        )
        for row in kept["rows"]
    ]
    yield (
        f"## A recorded log\n\n`python -m benchmarks.relations`, with {kept['log']}: errors of the "
        "relations that people made for it. The target is a mean of 0.06 m in 10 s; published are "
        "0.070 m for a particle filter and 0.031 m for graph mapping.\n\n" + table(head, rows)
    )


def _mutants() -> Iterator[str]:
    path = RESULTS / "mutation.json"
    if not path.exists():
        return
    found = json.loads(path.read_text(encoding="utf-8"))
    rows = [(f"`{row['part']}`", str(row["mutants"]), str(row["killed"])) for row in found]
    killed, tried = (sum(row[key] for row in found) for key in ("killed", "mutants"))
    yield (
        f"## Do the tests notice?\n\n{killed} of {tried} mutants were killed: small changes of the "
        "source, drawn by `python -m benchmarks.mutation` from all that cosmic-ray can make but "
        "for the flags of dataclasses, and tried with the fast unit tests of their part alone.\n\n"
        + table(("part", "mutants", "killed"), rows)
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
