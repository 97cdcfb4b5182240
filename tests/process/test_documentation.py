"""What the documentation tells people to type works.

Every `gvgbot` command in a shell block must be one that the program understands. The blocks below a
line `<!-- run -->` are carried out, page by page, in an empty directory, with a bend of three
metres for the ring that the pages explore: what they do with a map they do with a small one.
"""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gvgbot.cli import parser
from gvgbot.config import load_config
from gvgbot.drivers.world import save_world
from gvgbot.strict_yaml import packaged
from gvgbot.worlds.canvas import Canvas

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(
    r"(?P<run><!-- run -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S
)
EARLIER = ("sudo", "nice", ".venv/bin/")


def blocks(page: Path) -> list[re.Match[str]]:
    return list(BLOCK.finditer(page.read_text(encoding="utf-8")))


def commands(text: str) -> Iterator[list[str]]:
    """The words behind `gvgbot` of each such command in a shell block."""
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        while words and words[0] in EARLIER:
            words = words[1:]
        if words and Path(words[0]).name == "gvgbot":
            yield words[1:]


COMMANDS = [
    pytest.param(words, id=f"{page.stem}: gvgbot {' '.join(words)}")
    for page in PAGES
    for block in blocks(page)
    if block["language"] == "sh"
    for words in commands(block["text"])
]
WITH_SAMPLES = [page for page in PAGES if any(block["run"] for block in blocks(page))]


@pytest.mark.parametrize("words", COMMANDS)
def test_the_program_understands_a_command(words: list[str]) -> None:
    if words == ["--version"]:
        return
    options = parser().parse_args(words)
    config = getattr(options, "config", None)
    known = config if config is not None and packaged(config).exists() else None
    load_config(known, getattr(options, "overrides", []))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_samples_compile(page: Path) -> None:
    for block in blocks(page):
        text = block["text"]
        if block["language"] == "python":
            compile(text, str(page), "exec")


def test_make_has_installed_what_the_pages_say_it_has() -> None:
    """The extras of the environment that `make explore` makes, and that the first pages use."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (installed,) = re.findall(r"^\.venv/core:(?:.*\n\t)*.*'\.\[([\w,]+)\]'$", makefile, re.M)
    promised = {
        extra
        for page in PAGES
        for extra in re.findall(r"'gvgbot\[(\w+)\]' +# .*`make` has", page.read_text("utf-8"))
    }
    assert {"web", "record"} <= promised <= set(installed.split(","))
    tutorial = (ROOT / "docs" / "tutorial" / "simulation.md").read_text(encoding="utf-8")
    assert f"pip install '.[{installed}]'" in tutorial


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_to_files(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


@pytest.fixture(scope="module")
def bend(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What to tell the program for it to explore a small world."""
    canvas = Canvas(6.5, 6.5)
    canvas.carve_path([(2.0, 2.0), (4.5, 2.0), (4.5, 4.5)], 1.6)
    world = save_world(canvas.world("bend"), tmp_path_factory.mktemp("world"))
    return f"--world {world} --start 2 2 0"


@pytest.fixture(scope="module")
def explored(bend: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a run that ended by itself, with its recording beside it."""
    where = tmp_path_factory.mktemp("explored")
    recorded = f"gvgbot explore {bend} --set recording.path=run.mcap --out run"
    done = carry_out(["sh"], where, recorded)
    assert done.returncode == 0, done.stderr
    return where / "run"


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_SAMPLES, ids=lambda page: page.stem)
def test_marked_samples_run(page: Path, tmp_path: Path, bend: str, explored: Path) -> None:
    (tmp_path / "runs").mkdir()
    ring, recorded = "gvgbot explore --world ring", "--set recording.path=runs/ros2.mcap"
    copies = {  # most pages begin with that
        f"{ring} --out": f"cp -r {explored}",
        f"{ring} {recorded} --out": f"cp {explored}.mcap runs/ros2.mcap; cp -r {explored}",
    }
    for block in blocks(page):
        if block["run"]:
            program = {"sh": ["sh", "-e"], "python": [sys.executable, "-"]}[block["language"]]
            text = block["text"]
            for one, copied in copies.items():
                text = text.replace(one, copied)
            done = carry_out(program, tmp_path, text.replace("--world ring", bend))
            assert done.returncode == 0, f"{text}\n{done.stderr}"


@pytest.mark.slow
def test_every_file_of_a_run_is_described(explored: Path) -> None:
    page = (ROOT / "docs" / "reference" / "run-directory.md").read_text(encoding="utf-8")
    told = set(re.findall(r"^\| (.*?) \|", page, re.M))
    names = {name for cell in told for name in re.findall(r"`([\w.-]+)`", cell)}
    files = {path.name for path in explored.iterdir()}
    assert "map.geojson" in files
    assert files - names == set()
    assert set(json.loads((explored / "summary.json").read_text())) - names == set()


def carry_out(program: list[str], where: Path, text: str) -> "subprocess.CompletedProcess[str]":
    """What came of a text that a program reads, with `gvgbot` among the commands."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return subprocess.run(
        program,
        input=text,
        capture_output=True,
        check=False,
        cwd=where,
        env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)},
        text=True,
    )
