"""Repeat the experiments of the paper: figures, verdicts, and the page that shows them.

    python -m benchmarks.figures [e1 ... e10]

Explorations are kept in runs/figures, and run again only if they are not there: remove it when the
program has changed. What is found goes to benchmarks/results/figures.json, of which
docs/figures.md is made, and pictures go to docs/images/figures.
"""

import importlib
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

FIGURES = Path(__file__).parent
RESULTS = FIGURES.parent / "results" / "figures.json"
MODULES = {path.stem.partition("_")[0]: path.stem for path in FIGURES.glob("e[0-9]*_*.py")}


def main(arguments: Sequence[str]) -> int:
    """Find what is named, or everything; 0 if every verdict is as it should be."""
    names = sorted(arguments or MODULES, key=lambda name: int(name.lstrip("e") or 0))
    found = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    for name in names:
        finding = importlib.import_module(f"benchmarks.figures.{MODULES[name]}").find()
        found[name] = asdict(finding)
        print(f"{name}: {'' if finding.holds else 'NOT SO: '}{finding.verdict}", flush=True)
        ordered = {key: found[key] for key in sorted(found, key=lambda key: int(key[1:]))}
        text = json.dumps(ordered, indent=1, ensure_ascii=False)
        RESULTS.write_text(text + "\n", encoding="utf-8")
    return int(not all(found[name]["holds"] for name in names))


if __name__ == "__main__":
    if unknown := [name for name in sys.argv[1:] if name not in MODULES]:
        print(f"{unknown[0]}: there are {' '.join(sorted(MODULES))}", file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1:]))
