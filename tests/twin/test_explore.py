"""Whole explorations in virtual time, bytes and all, of worlds whose graph is known by geometry."""

import errno
import json
import math
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.stats import chi2

from benchmarks.score_run import score_run
from gvgbot.autonomy.localisation import LocalMaps
from gvgbot.cli import main
from gvgbot.drivers.world import World, save_world
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Contact, Odometry
from gvgbot.session import Session
from gvgbot.worlds.canvas import Canvas
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

ROBOT_RADIUS = 0.177  # m
WALL = 0.2  # m that a map may be off
FULL = 2.0  # s, when the disk is
RING_M = 2.7
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Case:
    """A world, where the robot starts, and its graph: points in the world frame and degrees.

    The robot's local map may be smaller than the default, so that a small world does not fit in.
    """

    world: World
    start: Pose
    meetpoints: dict[Point, int] = field(default_factory=dict)
    endpoints: list[Point] = field(default_factory=list)
    edges: list[tuple[Point, Point]] = field(default_factory=list)
    local_map_m: float = 10.0  # from the robot to its edge


def shift(width: float, wall: float) -> float:
    """How far towards its branch a T of corridors is off the centre line of the one that passes.

    The wall opposite is as far away as the two corners: (a/2 + s)^2 = (b/2)^2 + (a/2 - s)^2.
    """
    return width**2 / (8 * wall)


def tee() -> Case:
    world = carved([(-5.0, -1.0, 5.0, 1.0), (-0.7, -6.0, 0.7, 1.0)])
    middle = (0.0, -shift(1.4, 2.0))
    ends = [(-4.0, 0.0), (4.0, 0.0), (0.0, -5.3)]
    edges = [(middle, end) for end in ends]
    return Case(world, Pose(-3.0, 0.2, 0.4), {middle: 3}, ends, edges)


def lollipop() -> Case:
    """A dead end that leads to a ring of corridors: an edge from a vertex to itself."""
    free = [(-1, -1, 6, 1), (-1, -1, 1, 6), (-1, 4, 6, 6), (4, -1, 6, 6), (-6, -1, 0, 1)]
    middle, end = (0.0, shift(2.0, 2.0)), (-5.0, 0.0)
    edges = [(middle, end), (middle, middle)]
    world = carved([(float(a), float(b), float(c), float(d)) for a, b, c, d in free])
    return Case(world, Pose(-3.5, -0.1, 0.0), {middle: 3}, [end], edges)


def four_blocks() -> Case:
    """Streets of 1.6 m round two by two blocks: four Ts about a crossing, and corners between."""
    half, pitch, s = 0.8, 4.0, shift(1.6, 1.6)
    long = 2 * pitch
    free = [(-half, c - half, long + half, c + half) for c in (0.0, pitch, long)]
    free += [(c - half, -half, c + half, long + half) for c in (0.0, pitch, long)]
    centre = (pitch, pitch)
    tees = [(pitch, s), (long - s, pitch), (pitch, long - s), (s, pitch)]
    edges = [(t, centre) for t in tees] + [(tees[i - 1], tees[i]) for i in range(4)]
    meetpoints = {centre: 4} | dict.fromkeys(tees, 3)
    return Case(carved(free), Pose(2.0, 0.1, 0.3), meetpoints, [], edges, local_map_m=6.0)


def slit() -> Case:
    """A corridor that goes on behind a slit too narrow for the robot: two dead ends, no more.

    The second is as far from the slit's edges as from the side walls: 1 = (2 - x)^2 + 0.15^2.
    """
    walls = [(2.0, -1.0, 2.2, -0.15), (2.0, 0.15, 2.2, 1.0)]
    world = carved([(-4.0, -1.0, 6.0, 1.0)], walls)
    ends = [(-3.0, 0.0), (2.0 - math.sqrt(1.0 - 0.15**2), 0.0)]
    return Case(world, Pose(-1.0, 0.0, 1.0), {}, ends, [(ends[0], ends[1])])


CASES = {"tee": tee, "slit": slit, "lollipop": lollipop, "four blocks": four_blocks}
SEED = 3


@dataclass(frozen=True, eq=False)
class Run:
    """What an exploration left."""

    case: Case
    path: Path
    status: int

    @cached_property
    def summary(self) -> dict[str, Any]:
        return dict(json.loads((self.path / "summary.json").read_text()))

    @cached_property
    def features(self) -> list[dict[str, Any]]:
        return list(json.loads((self.path / "map.geojson").read_text())["features"])

    def vertices(self, kind: str) -> dict[int, dict[str, Any]]:
        """The vertices of a kind by id: their properties, and `xy` in the world frame."""
        found = {}
        for feature in self.features:
            properties = feature["properties"]
            if "startid" not in properties and properties["metadata"]["kind"] == kind:
                xy = self.case.start.transform(np.array(feature["geometry"]["coordinates"]))
                found[int(properties["id"])] = properties | {"xy": xy}
        return found

    @property
    def edges(self) -> list[dict[str, Any]]:
        return [f["properties"] for f in self.features if "startid" in f["properties"]]

    def trajectory(self, name: str) -> Array:
        """Rows (t, x, y, theta), in the world frame."""
        rows = np.loadtxt(self.path / f"{name}.tum")
        theta = 2 * np.arctan2(rows[:, 6], rows[:, 7])
        xy = rows[:, 1:3] if name == "truth" else self.case.start.transform(rows[:, 1:3])
        theta = theta if name == "truth" else theta + self.case.start.theta
        return np.column_stack([rows[:, 0], xy, theta])


def explore(case: Case, out: Path, *options: str) -> Run:
    world = save_world(replace(case.world, name="building"), out)
    start = [str(value) for value in (case.start.x, case.start.y, case.start.theta)]
    arguments = ["explore", "--world", str(world), "--start", *start, "--out", str(out / "run")]
    local_map = ["--set", f"autonomy.local_map.half_width_m={case.local_map_m}"]
    return Run(case, out / "run", main([*arguments, *local_map, *options]))


Explored = Callable[[str], Run]


@pytest.fixture(scope="module")
def explored(tmp_path_factory: pytest.TempPathFactory) -> Explored:
    """Each case, explored once."""

    @cache
    def run_of(name: str) -> Run:
        return explore(CASES[name](), tmp_path_factory.mktemp("explore"), "--seed", str(SEED))

    return run_of


@pytest.fixture(scope="module", params=CASES)
def run(request: pytest.FixtureRequest, explored: Explored) -> Run:
    return explored(request.param)


def matched(found: dict[int, dict[str, Any]], wanted: list[Point]) -> dict[int, Point]:
    """Each found vertex with the wanted point that it is near to."""
    pairs = {}
    for vertex, properties in found.items():
        near = min(wanted, key=lambda point: math.dist(point, properties["xy"]))
        assert math.dist(near, properties["xy"]) < WALL, f"false vertex at {properties['xy']}"
        pairs[vertex] = near
    return pairs


# -- the graph ---------------------------------------------------------------------------


def test_the_world_is_explored_without_touching_a_wall(run: Run) -> None:
    assert run.status == 0
    assert run.summary["outcome"] == "explored"
    assert run.summary["contacts"] == 0
    truth = run.trajectory("truth")
    gaps = [
        np.hypot(*run.case.world.wall_offsets(x, y, 1.0).T).min(initial=1.0) for _, x, y, _ in truth
    ]
    assert min(gaps) > ROBOT_RADIUS


def test_every_meetpoint_is_found_once_with_its_degree(run: Run) -> None:
    found = run.vertices("meetpoint")
    pairs = matched(found, [*run.case.meetpoints])
    assert Counter(pairs.values()) == Counter([*run.case.meetpoints])
    for vertex, point in pairs.items():
        metadata = found[vertex]["metadata"]
        assert metadata["degree"] == run.case.meetpoints[point]
        assert metadata["frontiers"] == []
        clearance = np.hypot(*run.case.world.wall_offsets(*point, 3.0).T).min()
        assert metadata["clearance"] == pytest.approx(clearance, abs=0.15)


def test_every_dead_end_is_found_once(run: Run) -> None:
    pairs = matched(run.vertices("endpoint"), run.case.endpoints)
    assert Counter(pairs.values()) == Counter(run.case.endpoints)


def test_the_edges_join_what_the_corridors_join(run: Run) -> None:
    places = matched(run.vertices("meetpoint"), [*run.case.meetpoints])
    places |= matched(run.vertices("endpoint"), run.case.endpoints)
    found = Counter((places[e["startid"]], places[e["endid"]]) for e in run.edges)
    wanted = Counter([*run.case.edges, *((b, a) for a, b in run.case.edges)])
    assert found == wanted  # each edge once in each direction


def test_an_edge_is_at_least_as_long_as_the_straight_line_between_its_ends(run: Run) -> None:
    places = {**run.vertices("meetpoint"), **run.vertices("endpoint")}
    for edge in run.edges:
        straight = math.dist(places[edge["startid"]]["xy"], places[edge["endid"]]["xy"])
        assert edge["cost"] > straight - 0.2
        assert edge["cost"] == pytest.approx(edge["metadata"]["length"], abs=0.2)


def test_vertices_are_as_far_off_as_their_covariances_allow(run: Run) -> None:
    """Generous bounds: the errors of one run are correlated, and the covariances are cautious."""
    total, count = 0.0, 0
    start = run.case.start
    c, s = math.cos(start.theta), math.sin(start.theta)
    turn = np.array([[c, -s], [s, c]])
    for kind, wanted in (("meetpoint", [*run.case.meetpoints]), ("endpoint", run.case.endpoints)):
        found = run.vertices(kind)
        for vertex, point in matched(found, wanted).items():
            covariance = np.array(found[vertex]["metadata"]["covariance"]).reshape(2, 2)
            error = turn.T @ (found[vertex]["xy"] - point)
            total, count = total + float(error @ np.linalg.solve(covariance, error)), count + 2
    assert total < chi2.ppf(0.9999, count)


# -- the trajectories --------------------------------------------------------------------


@pytest.mark.parametrize(("name", "limit"), [("estimate", 0.1), ("online", 0.15)])
def test_the_robot_knows_where_it_was(run: Run, name: str, limit: float) -> None:
    believed, truth = run.trajectory(name), run.trajectory("truth")
    assert np.array_equal(believed[:, 0], truth[:, 0])
    assert np.hypot(*(believed[:, 1:3] - truth[:, 1:3]).T).max() < limit
    assert np.cos(believed[:, 3] - truth[:, 3]).min() > math.cos(math.radians(3))


@pytest.mark.parametrize("name", ["estimate", "online", "odometry", "truth"])
def test_trajectories_have_ten_rows_a_second(run: Run, name: str) -> None:
    rows = run.trajectory(name)
    assert np.diff(rows[:, 0]).max() < 0.13
    assert rows[-1, 0] - rows[0, 0] == pytest.approx(run.summary["duration_s"], abs=0.3)


def test_the_distance_driven_is_the_length_of_the_way_that_was_driven(run: Run) -> None:
    steps = np.diff(run.trajectory("truth")[:, 1:3], axis=0)
    assert np.hypot(*steps.T).sum() == pytest.approx(run.summary["distance_m"], rel=0.05)


# -- the other files ---------------------------------------------------------------------


def test_the_grid_shows_walls_where_there_are_walls_and_floor_where_there_is_floor(
    run: Run,
) -> None:
    entries = yaml.safe_load((run.path / "map.yaml").read_text())
    grey = np.flipud(np.asarray(Image.open(run.path / entries["image"]), dtype=float))
    rows, columns = np.nonzero(grey < 255 * (1 - entries["occupied_thresh"]))
    cells = (np.stack([columns, rows], axis=1) + 0.5) * entries["resolution"] + entries["origin"][
        :2
    ]
    near = run.case.start.transform(cells)
    world = run.case.world
    gaps = [np.hypot(*world.wall_offsets(x, y, 1.0).T).min(initial=1.0) for x, y in near]
    assert len(gaps) > 200
    assert np.mean(np.array(gaps) < 0.1) > 0.95
    for _, x, y, _ in run.trajectory("estimate")[::20]:
        px, py = run.case.start.inverse().transform(np.array([x, y]))
        column, row = (np.array([px, py]) - entries["origin"][:2]) // entries["resolution"]
        assert grey[int(row), int(column)] > 255 * (1 - entries["free_thresh"])


def test_the_picture_is_one(run: Run) -> None:
    with Image.open(run.path / "map.png") as picture:
        picture.load()
        assert min(picture.size) > 100
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 3


def test_the_summary_counts_what_the_map_holds(run: Run) -> None:
    vertices = len(run.case.meetpoints) + len(run.case.endpoints)
    assert run.summary["vertices"] == vertices
    assert run.summary["edges"] == len(run.case.edges)
    assert run.summary["seed"] == SEED
    for key in ("reason", "wall_s", "recoveries", "version", "config"):
        assert key in run.summary


def test_events_tell_the_story_in_order(run: Run) -> None:
    events = [json.loads(line) for line in (run.path / "events.jsonl").read_text().splitlines()]
    stamps = [event["stamp"] for event in events]
    assert stamps == sorted(stamps)
    kinds = Counter(event["event"] for event in events)
    assert kinds["vertex_added"] - kinds["vertex_removed"] == run.summary["vertices"]
    assert kinds["loop_closed"] == run.summary["loop_closures"]
    assert events[-1]["event"] == "finished"
    assert all(event["reason"] for event in events if event["event"] == "decision")


# -- the same again ----------------------------------------------------------------------

REPEATED = ("map.geojson", "events.jsonl", "map.pgm", "map.png", "estimate.tum", "truth.tum")


def test_the_same_seed_leaves_the_same_bytes_and_another_one_does_not(
    explored: Explored, tmp_path: Path
) -> None:
    one = explored("slit")
    again = explore(slit(), tmp_path / "again", "--seed", str(SEED))
    other = explore(slit(), tmp_path / "other", "--seed", str(SEED + 1))
    for name in REPEATED:
        assert (one.path / name).read_bytes() == (again.path / name).read_bytes()
    assert (one.path / "map.geojson").read_bytes() != (other.path / "map.geojson").read_bytes()


def test_another_process_with_other_hashes_leaves_the_same_bytes(
    explored: Explored, tmp_path: Path
) -> None:
    one = explored("tee")
    world, at = one.path.parent / "building.yaml", one.case.start
    start = [str(value) for value in (at.x, at.y, at.theta)]
    command = [sys.executable, "-m", "gvgbot", "explore", "--world", str(world)]
    there = tmp_path / "there"
    subprocess.run(
        [*command, "--seed", str(SEED), "--start", *start, "--out", str(there)],
        env=os.environ | {"PYTHONHASHSEED": "12345"},
        check=True,
        capture_output=True,
        timeout=60,
    )
    for name in REPEATED:
        assert (one.path / name).read_bytes() == (there / name).read_bytes()


def ring() -> Case:
    """A round corridor of RING_M mean radius, with an alcove in the north.

    The robot starts in the south, from where the alcove is out of sight.
    """
    canvas = Canvas(8.0, 9.5)
    canvas.carve_disc(4.0, 4.0, RING_M + 0.6)
    canvas.carve_path([(4.0, 4.0 + RING_M), (4.0, 8.7)], 1.2)
    canvas.build_disc(4.0, 4.0, RING_M - 0.6)
    return Case(canvas.world("ring"), Pose(4.0, 4.0 - RING_M, 0.1), local_map_m=4.0)


def test_the_edge_of_the_start_is_not_driven_twice(tmp_path: Path) -> None:
    """Around the ring, into no more than the mouth of its alcove."""
    run = explore(ring(), tmp_path, "--seed", "2")
    assert run.status == 0
    assert run.summary["distance_m"] < math.tau * RING_M * 1.2


def two_rooms() -> Case:
    """A corridor of 12 m, and two rooms of 6 by 6 m with doors to it and to each other."""
    rooms = [(0.5, 2.55, 6.3, 8.5), (6.55, 2.55, 12.5, 8.5)]
    doors = [(2.6, 2.3, 3.6, 2.55), (9.0, 2.3, 10.0, 2.55), (6.3, 6.4, 6.55, 7.4)]
    world = carved([(0.5, 0.5, 12.5, 2.3), *rooms, *doors])
    return Case(world, Pose(6.5, 1.4, -0.7))


def test_a_laser_that_sees_no_farther_than_a_room_finds_all_of_a_building(tmp_path: Path) -> None:
    """A URG-04LX, 5.6 m: where none of its beams comes back, there may be a wall all the same.

    Who took all of that for floor would find it all, too, after driving to and fro.
    """
    laser = ["--set", "twin.laser.model=URG-04LX"]
    run = explore(two_rooms(), tmp_path, "--seed", "1", *laser)
    assert run.status == 0
    score = score_run(run.path)
    assert score["recall"] == score["precision"] == score["edge_recall"] == 1.0
    assert score["path_ratio"] is not None
    assert score["path_ratio"] < 1.5


@pytest.mark.parametrize("robots", ["1", "2"])
def test_an_exploration_that_the_disk_ends_says_so_and_leaves_a_map(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    robots: str,
) -> None:
    fill = Session.on_cycle

    def on_cycle(session: Session, odometry: Odometry, contact: Contact | None) -> None:
        if odometry.stamp > FULL:
            raise OSError(errno.ENOSPC, "No space left on device", "truth.tum")
        fill(session, odometry, contact)

    monkeypatch.setattr(Session, "on_cycle", on_cycle)
    run = explore(tee(), tmp_path, "--robots", robots)
    assert run.status == 1
    assert capsys.readouterr().err.splitlines()[-1].endswith("no space left: make room")
    summary = json.loads((run.path / "summary.json").read_text())
    assert summary["outcome"] == "failed"
    assert "No space left on device" in summary["reason"]
    assert (run.path / "map.geojson").exists()


@pytest.mark.parametrize("robots", ["1", "2"])
def test_who_may_be_anywhere_after_a_lift_has_failed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    robots: str,
) -> None:
    """Nobody is there who could ask it to resume."""
    monkeypatch.setattr(LocalMaps, "may_fit", lambda *_: False)
    drops = "twin.base.mishaps.wheel_drops_per_h=3600"
    arguments = ["explore", "--set", drops, "--robots", robots, "--out", str(tmp_path / "run")]
    assert main(arguments) == 1
    assert "failed: no walls that it knows are around it" in "".join(capsys.readouterr())
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"] == "failed"
    assert summary["duration_s"] < 120.0
