"""What `gvgbot map` writes takes the place of no file that a run needs."""

from pathlib import Path

import pytest

from gvgbot.cli import main
from tests.unit.maps.small_run import write_run

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """In the working directory, with what only simulations and teams leave."""
    run = write_run(tmp_path / "run")
    for name in ("world.png", "team.geojson"):
        (run / name).write_text("needed")
    return run


def content(run: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in run.iterdir()}


@pytest.mark.parametrize(
    "words",
    [
        "export run run/map.geojson",
        "export run other/../run/map.geojson",
        "export run other/map.geojson",
        "export run run/team.geojson",
        "export run run/seen.png",
        "show run --out run/seen.png",
        "show run --frames 2 --out run/world.png",
        "diff run other --out other/seen.png",
    ],
)
def test_what_a_run_needs_stays(
    words: str, run: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(run.parent)
    other = write_run(run.parent / "other")
    before = content(run), content(other)
    assert main(["map", *words.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words.rsplit(maxsplit=1)[-1] in line
    assert "name another file" in line
    assert (content(run), content(other)) == before


def test_the_picture_of_a_run_and_what_is_in_no_run_can_be_replaced(
    run: Path, tmp_path: Path
) -> None:
    for out in (run / "map.png", tmp_path / "seen.png", tmp_path / "map.geojson"):
        for _ in range(2):
            assert main(["map", "export", str(run), str(out)]) == 0
    assert main(["map", "info", str(run)]) == 0
