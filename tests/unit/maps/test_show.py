"""`gvgbot map` on a run that is known to the last number, and on damaged ones."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import networkx as nx
import pytest
import structlog
from PIL import Image

from gvgbot.cli import main
from gvgbot.maps import geojson
from gvgbot.maps.saved_run import SavedRun
from tests.unit.maps.small_run import GRAPH, SUMMARY, write_run

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "corridor-1")


@pytest.mark.parametrize(
    ("options", "name", "kind"),
    [
        ([], "picture.png", "PNG"),
        (["--frames", "3"], "strip.png", "PNG"),
        (["--animate", "--frames", "3"], "film.gif", "GIF"),
    ],
)
def test_a_picture_goes_into_the_run_directory_or_where_it_is_wanted(
    run: Path, tmp_path: Path, options: list[str], name: str, kind: str, capsys: Captured
) -> None:
    assert main(["map", "show", str(run), *options]) == 0
    assert capsys.readouterr().out == f"picture: {run / name}\n"
    wanted = tmp_path / f"wanted.{kind.lower()}"
    assert main(["map", "show", str(run), *options, "--out", str(wanted)]) == 0
    assert wanted.read_bytes() == (run / name).read_bytes()
    with Image.open(wanted) as image:
        assert image.format == kind
        assert getattr(image, "n_frames", 1) == (3 if kind == "GIF" else 1)


def test_info_says_what_the_map_holds(run: Path, capsys: Captured) -> None:
    assert main(["map", "info", str(run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    words = {line.split()[0]: " ".join(line.split()[1:]) for line in lines}
    assert words["outcome"] == "explored: no frontier is left"
    assert words["driven"] == "10.0 m in 0:10"
    assert words["vertices"] == "4: 3 meetpoints, 1 endpoint"
    assert words["frontiers"] == "4 left"
    assert words["edges"] == "3 of 11.0 m in all"
    assert words["narrowest"] == "0.90 m to the walls"
    assert words["extent"] == "12.0 m x 4.0 m, 46 m^2 of it free"  # 38 of 40 rows
    assert words["accuracy"].startswith("sigma of a vertex 0.050 m (median), 0.080 m at worst")


def test_the_narrowest_edge_is_the_one_with_the_least_clearance(
    run: Path, capsys: Captured
) -> None:
    edges = (replace(GRAPH.edges[0], min_clearance=0.31), *GRAPH.edges[1:])
    (run / "map.geojson").write_text(geojson.encode(replace(GRAPH, edges=edges)))
    assert main(["map", "info", str(run)]) == 0
    assert "narrowest  0.31 m to the walls" in capsys.readouterr().out


def test_a_run_that_was_killed_before_its_first_vertex_has_no_map_yet(
    tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "events.jsonl").touch()
    assert main(["map", "info", str(tmp_path)]) == 2
    assert f"{tmp_path} has no map.geojson yet" in capsys.readouterr().err


def test_a_run_that_was_killed_can_still_be_looked_at(run: Path, capsys: Captured) -> None:
    (run / "summary.json").unlink()
    with (run / "events.jsonl").open("a") as events:
        events.write('{"event": "vertex_a')
    assert main(["map", "info", str(run)]) == 0
    assert "outcome" not in capsys.readouterr().out
    assert main(["map", "show", str(run), "--frames", "2"]) == 0


BROKEN = [
    b'{"event": "vertex_a{"event": "decision", "stamp": 1006.0}',
    b"\0\0\0",
    b"\xff\xfe",
    b"[]",
    b'{"event": "finished"}',
    b'{"event": "finished", "stamp": 1006.0, "deep": ' + 5000 * b"[",
]


@pytest.mark.parametrize("broken", BROKEN)
def test_events_that_cannot_be_read_are_left_out_with_one_warning(run: Path, broken: bytes) -> None:
    whole = SavedRun.read(run).events
    before, *after = (run / "events.jsonl").read_bytes().splitlines(keepends=True)
    (run / "events.jsonl").write_bytes(b"".join([before, broken, b"\n", *after, broken, b"\n"]))
    with structlog.testing.capture_logs() as logs:
        assert SavedRun.read(run).events == whole
    (warning,) = logs
    assert (warning["log_level"], warning["first_line"], warning["lines"]) == ("warning", 2, 2)
    assert warning["path"] == str(run / "events.jsonl")
    assert main(["map", "show", str(run), "--frames", "2"]) == 0


DAMAGES: dict[str, tuple[str, str]] = {
    "no graph": ("map.geojson", "{"),
    "no trajectory": ("estimate.tum", "1 2 3\n"),
    "no odometry": ("odometry.tum", "1 2 3 0 0 0 0 nan\n"),
    "no summary": ("summary.json", "{}"),
    "a deep graph": ("map.geojson", '{"type": "FeatureCollection", "features": [' + 5000 * "["),
    "a deep summary": ("summary.json", '{"deep": ' + 5000 * "["),
    "a wall of no corners": (
        "summary.json",
        json.dumps(SUMMARY | {"config": {"autonomy": {"virtual_walls": [[]]}}}),
    ),
}


@pytest.mark.parametrize(("name", "content"), DAMAGES.values(), ids=DAMAGES)
@pytest.mark.parametrize("action", ["show", "info"])
def test_a_damaged_file_is_one_line_that_names_it(
    run: Path, action: str, name: str, content: str, capsys: Captured
) -> None:
    (run / name).write_text(content)
    assert main(["map", action, str(run)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert name in line


@pytest.mark.parametrize("name", ["map.geojson", "estimate.tum", "map.yaml", "map.pgm"])
def test_a_missing_file_is_one_line_that_names_it(run: Path, name: str, capsys: Captured) -> None:
    (run / name).unlink()
    assert main(["map", "show", str(run)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert name in line


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--out", "film.gif"], "film.gif"),
        (["--animate", "--out", "film.png"], "film.png"),
        (["--out", "nowhere/map.png"], "nowhere"),
    ],
)
def test_an_unfit_output_is_one_line_that_names_it(
    run: Path,
    tmp_path: Path,
    options: list[str],
    named: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["map", "show", str(run), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert named in line


def test_a_run_that_never_began_has_a_map_but_no_film(run: Path, capsys: Captured) -> None:
    for name in ("estimate.tum", "odometry.tum", "events.jsonl"):
        (run / name).write_text("")
    assert main(["map", "show", str(run)]) == 0
    capsys.readouterr()
    assert main(["map", "show", str(run), "--animate"]) == 2
    assert "nothing to animate" in capsys.readouterr().err


def test_a_run_that_lies_beside_others_is_no_run_of_several_robots(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    runs = tmp_path / "all"
    shutil.copytree(run, runs)
    shutil.copytree(run, runs / "office-1")
    assert main(["map", "info", str(runs)]) == 0
    assert "vertices" in capsys.readouterr().out


@pytest.fixture
def team(run: Path) -> Path:
    """What `explore --robots` leaves: the joined map, and beside it the directories of robots."""
    whole = run.parent
    for name in ("map.geojson", "map.yaml", "map.pgm", "events.jsonl"):
        shutil.copy(run / name, whole)
    summary = {"outcome": "explored", "reason": "all", "distance_m": 20.0, "duration_s": 10.0}
    (whole / "summary.json").write_text(json.dumps({**summary, "robots": ["robot-1", "robot-2"]}))
    return whole


def test_the_joined_map_of_several_robots_is_a_map(team: Path, run: Path, capsys: Captured) -> None:
    assert main(["map", "show", str(team)]) == 0
    assert main(["map", "export", str(team), str(team / "all.graphml")]) == 0
    assert len(nx.read_graphml(team / "all.graphml")) == 4
    assert main(["map", "diff", str(team), str(run)]) == 0
    capsys.readouterr()
    assert main(["map", "info", str(team)]) == 0
    told = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert told[:3] == ["outcome", "driven", "vertices"]  # closures are of one robot


@pytest.mark.parametrize("how", [["--animate"], ["--frames", "3"]])
def test_of_several_robots_one_has_to_be_named_to_see_how_its_map_grew(
    team: Path, run: Path, how: list[str], capsys: Captured
) -> None:
    assert main(["map", "show", str(team), *how]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(f"is a run of several robots: name one of {run}")
    assert main(["map", "show", str(run), *how]) == 0
