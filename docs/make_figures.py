"""Writes figures.md from benchmarks/results/figures.json: python -m docs.make_figures."""

import json
from pathlib import Path
from typing import Any

from docs.source import table

DOCS = Path(__file__).parent
PAGE = DOCS / "figures.md"
RESULTS = DOCS.parent / "benchmarks" / "results" / "figures.json"
HEAD = """\
# The paper's experiments

<!-- Written by docs/make_figures.py from what `make figures` leaves in benchmarks/results. -->

Qiwen Zhang, David Whitney, Florian Shkurti and Ioannis Rekleitis published the method with
experiments: *Ear-based exploration on hybrid metric/topological maps*, IROS 2014. They are repeated
here, each by a script of its own in `benchmarks/figures`. `make figures` runs them all, draws the
pictures and writes this page; it fails if a verdict is not as it should be.

"""


def page() -> str:
    """The whole page, Markdown."""
    found = json.loads(RESULTS.read_text(encoding="utf-8"))
    return HEAD + "\n".join(_section(name, finding) for name, finding in found.items())


def _section(name: str, finding: dict[str, Any]) -> str:
    parts = [f"## {name.upper()}: {finding['title']}", f"Claim: {finding['claim']}"]
    parts.append(f"**{'Found' if finding['holds'] else 'Not so'}:** {finding['verdict']}")
    if finding["figure"]:
        parts.append(f"![{finding['title']}]({finding['figure']})")
    parts.append(finding["explained"])
    if finding["table"]:
        head, *rows = finding["table"]
        parts.append(table(head, rows).rstrip())
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
