"""Change the source in small ways, and see whether the unit tests notice: with cosmic-ray.

    pip install 'gvgbot[dev,mutation]'
    python -m benchmarks.mutation [--parts guard ekf ...] [--sample 20] [--seed 1] [--keep]

Of all mutants of a part, but for the flags of dataclasses, a sample is drawn and tried with the
fast tests of that part, in a copy of the project; survivors are printed as a diff. `--keep` writes
the score for docs/benchmarks.md.
"""

import argparse
import contextlib
import difflib
import importlib
import io
import json
import os
import resource
import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results" / "mutation.json"
COPIED = ("gvgbot", "tests", "benchmarks", "docs", "pyproject.toml")
MOST_CPU_S = 40  # of the tests of one mutant; one that never ends is found by that
KILLED, SURVIVED = 1, 0
PRELOADED = ("msgspec", "numpy", "pytest", "scipy.spatial", "scipy.ndimage", "serial")


@dataclass(frozen=True)
class Part:
    """Modules, and the tests that should notice any change of them."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]


HOKUYO, KOBUKI, SLAM = "drivers/hokuyo", "drivers/kobuki", "autonomy/slam"
PARTS = {
    "hokuyo": Part(
        (f"{HOKUYO}/scip.py", f"{HOKUYO}/scip_codec.py", f"{HOKUYO}/scip_messages.py"),
        tuple(
            f"{HOKUYO}/test_scip_{name}.py"
            for name in ("codec", "messages", "properties", "vectors")
        ),
    ),
    "kobuki": Part(
        tuple(f"{KOBUKI}/{n}.py" for n in ("frames", "payloads", "sub_payloads", "commands")),
        tuple(f"{KOBUKI}/test_{n}.py" for n in ("frames", "payloads", "vectors", "commands")),
    ),
    "guard": Part(("hal/guard.py",), ("hal/test_guard.py", "hal/test_sweep.py")),
    "graph": Part((f"{SLAM}/graph.py",), (f"{SLAM}/test_graph.py", "autonomy/test_mapping.py")),
    "ekf": Part((f"{SLAM}/ekf.py",), (f"{SLAM}/test_ekf.py", "test_config.py")),
}


@dataclass(frozen=True)
class Mutant:
    """A module with one change."""

    module: str
    operator: str
    before: str
    after: str

    @property
    def diff(self) -> str:
        """The lines that differ."""
        lines = difflib.unified_diff(
            self.before.splitlines(), self.after.splitlines(), self.module, self.operator, n=0
        )
        return "\n".join(lines)


def mutants(module: str, rng: np.random.Generator, wanted: int) -> list[Mutant]:
    """Some of all changes of a module that cosmic-ray knows, drawn evenly by place and kind."""
    plugins, ast, mutating = (
        importlib.import_module(f"cosmic_ray.{name}") for name in ("plugins", "ast", "mutating")
    )
    source = (ROOT / "gvgbot" / module).read_text(encoding="utf-8")
    nodes = list(ast.ast_nodes(ast.get_ast(source)))
    lines, places = source.splitlines(), dict[tuple[str, Any], list[tuple[Any, int]]]()
    for name in plugins.operator_names():
        kind = plugins.get_operator(name)
        if not kind.arguments():
            found = [at for node in nodes for at in kind().mutation_positions(node)]
            for occurrence, (start, _) in enumerate(found):
                if lines[start[0] - 1].startswith("@dataclass("):
                    continue  # frozen and slots hinder mistakes, and do nothing
                family = name.partition("_")[0]  # a sign has a dozen others that may replace it
                places.setdefault((family, start), []).append((name, occurrence))
    chosen = [list(places.values())[i] for i in rng.permutation(len(places))[:wanted]]
    drawn = []
    for choices in chosen:
        name, occurrence = choices[int(rng.integers(len(choices)))]
        after = mutating.mutate_code(source, plugins.get_operator(name)(), occurrence)
        drawn.append(Mutant(module, name.removeprefix("core/"), source, after))
    return drawn


def is_killed(mutant: Mutant, tests: Sequence[str], copy: Path) -> bool:
    """Whether the tests fail, in a process that has loaded what takes long, but not gvgbot."""
    path = copy / "gvgbot" / mutant.module
    path.write_text(mutant.after, encoding="utf-8")
    child = os.fork()
    if child == 0:
        status = KILLED
        with contextlib.suppress(BaseException):
            status = _tried(tests, copy)
        os._exit(status)
    _, status = os.waitpid(child, 0)
    path.write_text(mutant.before, encoding="utf-8")
    return os.waitstatus_to_exitcode(status) != SURVIVED


def _tried(tests: Sequence[str], copy: Path) -> int:
    import pytest  # noqa: PLC0415  # needs nothing of this module's users

    resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
    os.chdir(copy)
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode = True
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        paths = [f"tests/unit/{test}" for test in tests]
        return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *paths]))


def score(name: str, part: Part, sample: int, seed: int, copy: Path) -> dict[str, Any]:
    """Try a sample of a part's mutants."""
    rng = np.random.default_rng(seed)
    drawn = [mutant for module in part.modules for mutant in mutants(module, rng, sample)]
    drawn = [drawn[i] for i in rng.permutation(len(drawn))[:sample]]
    source = drawn[0].before
    if is_killed(Mutant(drawn[0].module, "none", source, source), part.tests, copy):
        raise SystemExit(f"{name}: the tests fail without any change")
    survivors = []
    for mutant in drawn:
        if not is_killed(mutant, part.tests, copy):
            survivors.append(mutant)
            print(mutant.diff, flush=True)
    print(f"{name}: {len(drawn) - len(survivors)} of {len(drawn)} killed", flush=True)
    return {
        "part": name,
        "mutants": len(drawn),
        "killed": len(drawn) - len(survivors),
        "survivors": [mutant.diff for mutant in survivors],
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Try mutants of the parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--sample", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true")
    options = parser.parse_args(arguments)
    for module in PRELOADED:
        importlib.import_module(module)
    with tempfile.TemporaryDirectory() as folder:
        for name in COPIED:
            source, target = ROOT / name, Path(folder) / name
            _ = shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
        for name in options.parts:
            row = score(name, PARTS[name], options.sample, options.seed, Path(folder))
            if options.keep:
                keep(row)
    return 0


def keep(row: dict[str, Any]) -> None:
    """Put a part's score in the place of an earlier one."""
    earlier = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else []
    rows = [other for other in earlier if other["part"] != row["part"]] + [row]
    RESULTS.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
