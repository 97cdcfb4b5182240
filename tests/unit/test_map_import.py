"""A map that somebody else has made becomes a run, or one line that says why not."""

import itertools
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import binary_dilation

from benchmarks.reference_gvg import reference_gvg
from gvgbot.cli import main
from gvgbot.config import Config
from gvgbot.drivers.world import World, load_map, save_world
from gvgbot.map_import import import_map
from gvgbot.maps.saved_run import SavedRun
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.session import Session
from gvgbot.worlds import open_world
from gvgbot.worlds.canvas import Canvas

GREY = {"wall": 0, "free": 254, "unknown": 205}  # of map_saver


def vertices(run: Path) -> np.ndarray:
    return np.array([vertex.position for vertex in SavedRun.read(run).graph.vertices])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["office", "ring", "rooms"])
def test_the_graph_of_an_imported_world_is_that_of_the_world(name: str, tmp_path: Path) -> None:
    """By the exact Voronoi diagram of the bitmap, which shares no code with the robot's."""
    world, start = open_world(name)
    assert start is not None
    run = tmp_path / "run"
    count, edges = import_map(save_world(world, tmp_path), run, Config())
    reference = reference_gvg(world, (start.x, start.y), Config().robot.radius_m)
    nodes = dict(reference.graph.nodes(data=True))
    required = np.array([node["position"] for node in nodes.values() if node["is_required"]])
    all_ = np.array([node["position"] for node in nodes.values()])
    found = vertices(run)
    assert len(found) == count
    apart = np.hypot(*(required[:, None] - found[None]).transpose(2, 0, 1))
    assert apart.min(axis=1).max() < 0.4
    assert np.hypot(*(found[:, None] - all_[None]).transpose(2, 0, 1)).min(axis=1).max() < 0.4
    assert abs(edges - reference.graph.number_of_edges()) <= count - len(required)


def cross() -> World:
    canvas = Canvas(15.0, 9.0)
    canvas.carve_path([(1.5, 4.5), (13.5, 4.5)], 1.4)
    canvas.carve_path([(4.5, 1.5), (4.5, 7.5)], 1.4)
    return canvas.world("cross")


def painted(directory: Path, hidden: tuple[slice, slice] | None = None) -> Path:
    """The cross in map_server form, with a part of it unknown; rows from the bottom."""
    path = save_world(cross(), directory)
    picture = directory / "cross.png"
    grey = np.asarray(Image.open(picture)).copy()
    grey[grey == 254] = GREY["free"]
    if hidden is not None:
        grey[::-1][hidden] = GREY["unknown"]
    Image.fromarray(grey).save(picture)
    return path


def test_walls_behind_a_pixel_that_nobody_knows_are_walls(tmp_path: Path) -> None:
    """A robot's own grid has such pixels wherever beams have ended now here and now there."""
    path = painted(tmp_path)
    picture = tmp_path / "cross.png"
    grey = np.asarray(Image.open(picture)).copy()
    free = grey == GREY["free"]
    grey[free & binary_dilation(~free, np.ones((3, 3), np.bool_))] = GREY["unknown"]
    Image.fromarray(grey).save(picture)
    import_map(path, tmp_path / "run", Config())
    graph = SavedRun.read(tmp_path / "run").graph
    assert sorted(vertex.kind for vertex in graph.vertices) == ["endpoint"] * 4 + ["meetpoint"]
    assert not any(vertex.frontiers for vertex in graph.vertices)


def test_what_is_unknown_becomes_a_frontier_and_no_wall(tmp_path: Path) -> None:
    rows, columns = cross().occupied.shape
    eastern = np.s_[0:rows, columns * 10 // 15 : columns]
    path = painted(tmp_path, eastern)
    assert not load_map(path)[1][eastern].any()
    import_map(path, tmp_path / "run", Config())
    run = SavedRun.read(tmp_path / "run")
    frontiers = [(vertex.position, vertex.frontiers) for vertex in run.graph.vertices]
    ((place, (bearing,)),) = [found for found in frontiers if found[1]]
    assert place == pytest.approx((4.5, 4.5), abs=0.1)
    assert bearing == pytest.approx(0.0, abs=0.1)
    assert sum(vertex.kind == "endpoint" for vertex in run.graph.vertices) == 3


def test_beyond_the_edge_of_the_image_nothing_is_known(tmp_path: Path) -> None:
    """A corridor leaves it there, as on the plan of one floor of several."""
    path = painted(tmp_path)
    picture = tmp_path / "cross.png"
    Image.open(picture).crop((60, 0, 300, 180)).save(picture)  # from 3 m of 15 on
    import_map(path, tmp_path / "run", Config())
    grid = SavedRun.read(tmp_path / "run").grid
    _, columns = np.nonzero(grid.cells == 0)
    x = grid.origin[0] + (columns + 0.5) * grid.resolution_m
    assert -0.1 < x.min() < 0.1  # the file still says that the image begins at 0


def test_there_is_a_wall_on_every_side_of_what_is_free(tmp_path: Path) -> None:
    """The arms of the cross are 1.4 m wide and end at 0.8 and 14.2 m, and at 0.8 and 8.2 m."""
    import_map(painted(tmp_path), tmp_path / "run", Config())
    grid = SavedRun.read(tmp_path / "run").grid
    walls = grid.middles(grid.cells == 100)
    beside, ahead = ((1.0, 3.7), (4.0, 5.0)), ((0.8, 14.2), (0.8, 8.2))
    sides = [(axis, at, *beside[0]) for axis in (0, 1) for at in (3.8, 5.2)]
    ends = [(axis, at, *beside[1]) for axis in (0, 1) for at in ahead[axis]]
    for axis, at, low, high in sides + ends:
        along = walls[np.abs(walls[:, axis] - at) < 0.08][:, 1 - axis]
        seen = np.histogram(along, np.arange(low, high + 1e-9, 0.1))[0]
        assert (seen > 0).mean() > 0.8, (axis, at)


def test_a_plan_on_white_paper_is_imported_from_inside(tmp_path: Path) -> None:
    """More of the paper lies around the walls, of 10 cm, than within them."""
    path = painted(tmp_path)
    free = ~cross().occupied
    walls = binary_dilation(free, iterations=2) & ~free
    Image.fromarray(np.where(walls, 0, 255).astype(np.uint8)[::-1]).save(tmp_path / "cross.png")
    assert free.mean() < 0.3
    import_map(path, tmp_path / "run", Config())
    found = sorted(map(tuple, vertices(tmp_path / "run").round(1).tolist()))
    kinds = [vertex.kind for vertex in SavedRun.read(tmp_path / "run").graph.vertices]
    assert (4.5, 4.5) in found
    assert sorted(kinds) == ["endpoint"] * 4 + ["meetpoint"]


def test_streets_are_imported_for_all_the_yards_between_them(tmp_path: Path) -> None:
    """They leave the image on all sides, and a house of the nine has a yard of two metres."""
    grey = np.full((260, 260), GREY["free"], np.uint8)
    for row, column in itertools.product((0, 100, 200), repeat=2):
        grey[row : row + 60, column : column + 60] = GREY["wall"]
    grey[110:150, 110:150] = GREY["free"]
    path = painted(tmp_path)
    Image.fromarray(grey).save(tmp_path / "cross.png")
    import_map(path, tmp_path / "run", Config())
    crossings = {(x, y) for x in (4.0, 9.0) for y in (4.0, 9.0)}
    assert crossings <= set(map(tuple, vertices(tmp_path / "run").round().tolist()))


def test_a_map_of_older_nav2_is_told_apart_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It wrote a `free_thresh` by which its own unknown pixels are free."""
    rows, columns = cross().occupied.shape
    path = painted(tmp_path, np.s_[0:rows, columns * 10 // 15 : columns])
    path.write_text(path.read_text().replace("free_thresh: 0.196", "free_thresh: 0.25"))
    assert main(["map", "import", str(path), "--out", str(tmp_path / "run")]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "grey 205 is unknown, not free" in line
    graph = SavedRun.read(tmp_path / "run").graph
    assert sum(len(vertex.frontiers) for vertex in graph.vertices) == 1


def test_the_run_holds_a_mission_on_which_a_daemon_can_begin(tmp_path: Path) -> None:
    assert main(["map", "import", str(painted(tmp_path)), "--out", str(tmp_path / "run")]) == 0
    saved = MissionFiles(tmp_path / "run").read()
    assert saved is not None
    assert len(saved.memory.graph.vertices) == 5
    assert len(saved.past) == saved.memory.keyframes == saved.memory.lasting
    assert saved.memory.intent.outcome is None
    assert main(["map", "show", str(tmp_path / "run")]) == 0


def test_a_map_whose_name_is_no_utf_8_is_imported(tmp_path: Path) -> None:
    """As old archives have them; Python has such a byte as half of a surrogate pair."""
    path = painted(tmp_path).rename(tmp_path / "k\udcfcche.yaml")
    assert main(["map", "import", str(path), "--out", str(tmp_path / "run")]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_bytes())
    assert summary["reason"] == "imported from k\udcfcche.yaml"


def test_an_import_that_is_interrupted_leaves_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(session: Session) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Session, "save", interrupt)
    assert main(["map", "import", str(painted(tmp_path)), "--out", str(tmp_path / "run")]) == 130
    assert not (tmp_path / "run").exists()


def test_what_to_do_with_an_imported_map_can_be_pasted_into_a_shell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The simulated robot has to be put into that building as well, a real one is in it."""
    place, out = painted(tmp_path), tmp_path / "my run"
    assert main(["map", "import", str(place), "--out", str(out)]) == 0
    words = capsys.readouterr().out.splitlines()[-1].removeprefix("to drive in it: ")
    expected = ["gvgbot", "run", "--map", str(out), "--set", f"twin.world={place}"]
    assert shlex.split(words) == expected
    config, real = tmp_path / "my robot.yaml", tmp_path / "real"
    config.write_text("twin: {enabled: false}")
    robot = ["--set", "robot.name=lisa"]
    given = ["--out", str(real), "--config", str(config), *robot]
    assert main(["map", "import", str(place), *given]) == 0
    words = capsys.readouterr().out.splitlines()[-1].removeprefix("to drive in it: ")
    assert shlex.split(words) == ["gvgbot", "run", str(config), *robot, "--map", str(real)]


def test_a_map_of_somebody_else_has_not_been_driven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import_map(painted(tmp_path), tmp_path / "run", Config())
    assert main(["map", "info", str(tmp_path / "run")]) == 0
    assert "driven     0.0 m in 0:00" in capsys.readouterr().out


def test_a_run_that_is_there_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["map", "import", str(painted(tmp_path)), "--out", str(tmp_path / "run")]
    assert main(words) == 0
    capsys.readouterr()
    assert main(words) == 2
    assert "holds a run already" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["map import {} --out {}", "explore --world {} --out {}"])
def test_a_map_is_not_replaced_by_the_run_that_is_made_of_it(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = painted(tmp_path).rename(tmp_path / "map.yaml")
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    start = ["--start", "4.5", "4.5", "0"] if "explore" in command else []
    assert main([*command.format(path, tmp_path).split(), *start]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(path) in line
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def broken(directory: Path, what: str) -> Path:
    """A map with a mistake."""
    path = painted(directory)
    text, picture = path.read_text(), directory / "cross.png"
    match what:
        case "no file":
            return directory / "nowhere.yaml"
        case "no image":
            picture.unlink()
        case "cut image":
            picture.write_bytes(picture.read_bytes()[:200])
        case "no yaml":
            path.write_bytes(b"\x00\xff\x13" * 50)
        case "other yaml":
            path.write_text("[1, 2")
        case "no key":
            path.write_text(text.replace("resolution", "revolution"))
        case "turned":
            path.write_text(text.replace(", 0.0]", ", 0.5]").replace("- 0.0\n", "- 0.5\n"))
        case "all wall":
            Image.new("L", (50, 50), GREY["wall"]).save(picture)
        case "all unknown":
            Image.new("L", (50, 50), GREY["unknown"]).save(picture)
        case "all free":
            Image.new("L", (50, 50), GREY["free"]).save(picture)
        case "one pixel":
            Image.new("L", (1, 1), GREY["free"]).save(picture)
    return path


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("no file", "no such file"),
        ("no image", "no such file"),
        ("cut image", "cannot read"),
        ("no yaml", "cannot be read as text"),
        ("other yaml", "not valid YAML"),
        ("no key", "key resolution: missing"),
        ("turned", "yaw must be 0"),
        ("all wall", "nothing in it is free"),
        ("all unknown", "nothing in it is free"),
        ("all free", "no way in it"),
        ("one pixel", "nothing in it is free"),
    ],
)
def test_what_is_no_map_gets_one_line_and_leaves_nothing(
    what: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["map", "import", str(broken(tmp_path, what)), "--out", str(out)]) == 2
    shown = capsys.readouterr()
    assert says in shown.err
    assert shown.err.count("\n") == 1
    assert not out.exists()
