"""Run benchmarks one after another, and keep what they measure: `make bench`.

    python -m benchmarks.run_benches [NAME ...]

A name is a module's, such as bench_scip; without any, all are run that are called bench_... Each
has a process of its own and leaves benchmarks/results/NAME.json, of which docs/benchmarks.md is
made.
"""

import json
import multiprocessing
import os
import platform
import runpy
import sys
from collections.abc import Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path

FOLDER = Path(__file__).parent
RESULTS = FOLDER / "results"


def machine() -> dict[str, str]:
    """What the figures depend on."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "memory": f"{memory:.0f} GiB",
        "system": f"{platform.system()}, {platform.machine()}",
        "load": f"{os.getloadavg()[0]:.1f} processes on average in the minute before",
        "Python": platform.python_version(),
        "numpy": metadata.version("numpy"),
        "scipy": metadata.version("scipy"),
        "zenoh": metadata.version("eclipse-zenoh"),
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def run(name: str) -> None:
    """Run one benchmark in this process, and keep what it measured."""
    from benchmarks.report import measured  # noqa: PLC0415  # the list that the benchmark fills

    facts = machine()
    sys.argv = [name]
    runpy.run_module(f"benchmarks.{name}", run_name="__main__")
    kept = {"machine": facts, "figures": [asdict(figure) for figure in measured]}
    text = json.dumps(kept, indent=1, ensure_ascii=False)
    (RESULTS / f"{name}.json").write_text(text + "\n", encoding="utf-8")


def main(names: Sequence[str]) -> int:
    """Run them; how many failed, or 2 if there is no such benchmark."""
    known = sorted(path.stem for path in FOLDER.glob("bench_*.py"))
    unknown = [name for name in names if name not in known]
    if unknown:
        print(f"there is no {unknown[0]}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    failed = []
    for name in names or known:
        print(f"-- {name}", flush=True)
        process = multiprocessing.get_context("spawn").Process(target=run, args=(name,))
        process.start()
        process.join()
        failed += [name] if process.exitcode else []
    if failed:
        print(f"failed: {' '.join(failed)}", file=sys.stderr)
    return len(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
