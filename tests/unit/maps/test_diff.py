"""Two maps laid on each other: one is the other, turned, shaken and cut by hand."""

import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from gvgbot.atomic_files import write_files
from gvgbot.cli import main
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.maps import geojson
from gvgbot.maps.alignment import compare
from gvgbot.maps.map_server import encode_map_server, read_map_server
from gvgbot.maps.moved import moved_graph, moved_grid
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from tests.unit.maps.small_run import vertex, write_run
from tests.unit.maps.test_picture import RED, of_colour

Captured = pytest.CaptureFixture[str]

PLACES = {  # m; no turn lays the town on itself
    1: (0.0, 0.0),
    2: (6.0, 0.5),
    3: (13.0, 0.0),
    4: (0.5, 5.0),
    5: (6.0, 6.0),
    6: (13.5, 7.0),
    7: (2.0, 11.0),
    8: (17.0, 3.0),
}
STREETS = [(1, 2), (2, 3), (1, 4), (2, 5), (3, 6), (4, 5), (5, 6), (4, 7), (3, 8)]


def town(
    angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), shake: float = 0.0
) -> RouteGraph:
    """The town in a frame in which it is turned, then moved; every place is off by so much (m)."""
    rng = np.random.default_rng(5)
    turn = np.exp(1j * angle)

    def seen(point: Array) -> Array:
        moved = complex(*point) * turn + complex(*shift)
        return np.array([moved.real, moved.imag])

    at = {}
    for number, place in PLACES.items():
        way = rng.uniform(0.0, math.tau)
        at[number] = seen(np.array(place) + shake * np.array([math.cos(way), math.sin(way)]))
    vertices = tuple(
        vertex(n, float(x), float(y), (0.0,) if n in (7, 8) else (0.0, 2.0, 4.0))
        for n, (x, y) in at.items()
    )
    return RouteGraph(vertices, tuple(street(i, j, [at[i], at[j]]) for i, j in STREETS))


def street(start: int, end: int, points: list[Array]) -> RouteEdge:
    line = np.array(points)
    return RouteEdge(start=start, end=end, polyline=line, min_clearance=1.0)


def without(graph: RouteGraph, *numbers: int) -> RouteGraph:
    return RouteGraph(
        tuple(v for v in graph.vertices if v.id not in numbers),
        tuple(e for e in graph.edges if e.start not in numbers and e.end not in numbers),
    )


def renamed(graph: RouteGraph, by: int) -> RouteGraph:
    def name(v: RouteNode) -> RouteNode:
        fields = {field: getattr(v, field) for field in RouteNode.__slots__}
        return RouteNode(**fields | {"id": v.id + by})

    return RouteGraph(
        tuple(name(v) for v in graph.vertices),
        tuple(street(e.end + by, e.start + by, list(e.polyline[::-1])) for e in graph.edges),
    )


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.8, math.pi, -2.5])
def test_a_map_is_found_in_itself_however_it_is_turned_and_named(angle: float) -> None:
    found = compare(renamed(town(angle, (30.0, -7.0)), 100), town(), 0.3)
    assert found.is_equal
    assert (found.a_b.x, found.a_b.y) == pytest.approx((30.0, -7.0), abs=1e-6)
    assert wrap_angle(found.a_b.theta - angle) == pytest.approx(0.0, abs=1e-6)
    named = {
        found.graphs[0].vertices[i].id: found.graphs[1].vertices[j].id for i, j, _ in found.vertices
    }
    assert named == {number + 100: number for number in PLACES}
    assert len(found.edges) == len(STREETS)
    assert max(d for _, _, d in (*found.vertices, *found.edges)) < 1e-6


def test_what_only_one_map_has_is_named() -> None:
    found = compare(without(town(), 8), without(town(1.0, (3.0, 4.0), 0.1), 7, 6), 0.4)
    assert not found.is_equal
    assert [v.id for v in found.lone_vertices(0)] == [6, 7]
    assert [v.id for v in found.lone_vertices(1)] == [8]
    assert {(e.start, e.end) for e in found.lone_edges(0)} == {(3, 6), (5, 6), (4, 7)}
    assert {(e.start, e.end) for e in found.lone_edges(1)} == {(3, 8)}
    distances = [distance for _, _, distance in found.vertices]
    assert len(distances) == 5
    assert 0.0 < np.median(distances) <= 0.2  # all are off by 0.1 m, in any direction


def test_an_edge_that_goes_another_way_is_another_edge() -> None:
    other = town()
    around = street(1, 2, [np.array(PLACES[1]), np.array([3.0, -2.0]), np.array(PLACES[2])])
    found = compare(town(), RouteGraph(other.vertices, (around, *other.edges[1:])), 0.5)
    assert len(found.vertices) == len(PLACES)
    assert [[(e.start, e.end) for e in found.lone_edges(k)] for k in (0, 1)] == [[(1, 2)]] * 2


@pytest.mark.parametrize("is_first", [True, False])
def test_edges_are_as_far_apart_as_their_farthest_points(*, is_first: bool) -> None:
    points = [np.array(p) for p in (PLACES[1], (2.4, 0.2), (3.0, 0.55), (3.6, 0.3), PLACES[2])]
    bent = RouteGraph(town().vertices, (street(1, 2, points),))
    straight = RouteGraph(town().vertices, town().edges[:1])
    (found,) = compare(*((bent, straight) if is_first else (straight, bent)), 0.5).edges
    slope = math.hypot(6.0, 0.5)  # the other one is straight, and passes (3, 0.25)
    assert found[2] == pytest.approx(0.3 * 6.0 / slope, abs=0.015)


def test_parallel_edges_pair_one_by_one() -> None:
    around = street(1, 2, [np.array(PLACES[1]), np.array([3.0, -2.0]), np.array(PLACES[2])])
    both = RouteGraph(town().vertices, (*town().edges, around))
    assert len(compare(both, RouteGraph(both.vertices, both.edges[::-1]), 0.5).edges) == 10
    assert len(compare(both, town(), 0.5).lone_edges(0)) == 1


def test_where_turns_do_equally_well_the_frames_are_the_same() -> None:
    square = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 5.0)]
    vertices = tuple(vertex(n, x, y, (0.0, 1.0, 2.0)) for n, (x, y) in enumerate(square))
    corners = [np.array(place) for place in square]
    ring = RouteGraph(
        vertices, tuple(street(k, (k + 1) % 4, [corners[k], corners[k - 3]]) for k in range(4))
    )
    for edges in (ring.edges, ring.edges[::-1]):
        assert compare(ring, RouteGraph(vertices, edges), 0.3).a_b == Pose()


def test_a_meetpoint_is_no_endpoint_though_it_is_at_its_place() -> None:
    other = town()
    ends = tuple(replace(v, kind="meetpoint") if v.id == 8 else v for v in other.vertices)
    found = compare(town(), replace(other, vertices=ends), 0.5)
    assert [[v.id for v in found.lone_vertices(k)] for k in (0, 1)] == [[8], [8]]


@pytest.mark.parametrize("empty", [RouteGraph(), RouteGraph((vertex(1, 2.0, 3.0, (0.0,)),))])
def test_maps_of_next_to_nothing_are_compared_too(empty: RouteGraph) -> None:
    assert compare(empty, empty, 0.3).is_equal
    assert len(compare(empty, town(), 0.3).lone_edges(1)) == len(STREETS)
    assert compare(RouteGraph(), town(), 0.3).vertices == ()


def test_a_moved_map_has_turned_bearings_and_ellipses() -> None:
    one = RouteGraph((vertex(2, 1.0, 0.0, (0.0,), (3.0,)),))  # sigma 4 cm along x, 1 cm along y
    (moved,) = moved_graph(one, Pose(5.0, 6.0, math.pi / 2)).vertices
    assert moved.position == pytest.approx((5.0, 7.0))
    assert moved.bearings == pytest.approx((math.pi / 2,))
    assert moved.frontiers == pytest.approx((3.0 - 1.5 * math.pi,))
    assert moved.covariance == pytest.approx((0.0001, 0.0, 0.0, 0.0016))
    tilted = moved_graph(one, Pose(0.0, 0.0, math.pi / 4)).vertices[0].covariance
    assert tilted == pytest.approx((0.00085, 0.00075, 0.00075, 0.00085))


def test_a_moved_grid_has_its_walls_where_they_belong() -> None:
    cells = np.zeros((20, 40), np.int8)
    cells[:, 30:] = 100
    moved = moved_grid(OccupancyGrid(cells, 0.1, (0.0, 0.0)), Pose(1.0, 2.0, math.pi / 2))
    rows, columns = np.nonzero(moved.cells == 100)
    x = moved.origin[0] + 0.1 * (columns + 0.5)
    y = moved.origin[1] + 0.1 * (rows + 0.5)
    assert (x.min(), x.max()) == pytest.approx((-1.0, 1.0), abs=0.11)
    assert (y.min(), y.max()) == pytest.approx((5.0, 6.0), abs=0.11)
    assert np.count_nonzero(moved.cells == 0) == pytest.approx(600, rel=0.03)


# -- the command ---------------------------------------------------------------------------------


def a_run(directory: Path, graph: RouteGraph) -> Path:
    write_run(directory)
    (directory / "map.geojson").write_text(geojson.encode(graph))
    return directory


def test_equal_maps_exit_with_0(tmp_path: Path, capsys: Captured) -> None:
    one, other = a_run(tmp_path / "a", town()), a_run(tmp_path / "b", town(0.5, (1.0, 0.0), 0.05))
    assert main(["map", "diff", str(one), str(other)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "equal within 0.5 m"
    assert lines[1].startswith("vertices   8 in both")
    assert main(["map", "diff", str(one), str(other), "--tolerance", "0.01"]) == 1


def test_maps_that_share_nothing_are_not_said_to_be_laid_on_each_other(
    tmp_path: Path, capsys: Captured
) -> None:
    one, other = a_run(tmp_path / "a", town()), a_run(tmp_path / "b", RouteGraph())
    assert main(["map", "diff", str(one), str(other)]) == 1
    assert capsys.readouterr().out.splitlines()[0] == (
        "aligned    not at all: they have nothing in common"
    )


def test_of_two_empty_maps_it_is_not_said_that_they_are_equal(
    tmp_path: Path, capsys: Captured
) -> None:
    one, other = a_run(tmp_path / "a", RouteGraph()), a_run(tmp_path / "b", RouteGraph())
    assert main(["map", "diff", str(one), str(other)]) == 2
    assert "nothing to compare" in capsys.readouterr().err


@pytest.mark.parametrize("turn", [1e-4, -1e-4])
def test_next_to_no_turn_has_no_sign(turn: float, tmp_path: Path, capsys: Captured) -> None:
    one, other = a_run(tmp_path / "a", town()), a_run(tmp_path / "b", town(turn))
    assert main(["map", "diff", str(one), str(other)]) == 0
    assert "was turned by 0.0 deg" in capsys.readouterr().out


def test_different_maps_exit_with_1_and_a_picture_shows_where(
    tmp_path: Path, capsys: Captured
) -> None:
    one, other = a_run(tmp_path / "a", town()), a_run(tmp_path / "b", without(town(0.5), 8))
    out = tmp_path / "both.png"
    assert main(["map", "diff", str(one), str(other), "--out", str(out)]) == 1
    *_, first, second, last = capsys.readouterr().out.splitlines()
    assert first == f"only in {one}: endpoint 8 at 17.00 3.00 m"
    assert second == f"only in {one}: edge from 3 to 8 of 5.00 m"
    assert last == "different within 0.5 m"
    with Image.open(out) as image:
        red = of_colour(np.asarray(image.convert("RGB")), RED)
        upper = red[: round(0.85 * image.height)]  # without the legend
        assert upper[:, : image.width // 2].sum() > 500
        assert not upper[:, image.width // 2 :].any()


def test_each_half_of_a_picture_has_the_walls_where_they_are_beside_its_graph(
    tmp_path: Path,
) -> None:
    """Both have seen the same corridor; it lies otherwise in the frame of the second one."""
    turn = Pose(3.0, -2.0, math.pi / 2)
    one, other = a_run(tmp_path / "a", town()), tmp_path / "b"
    a_run(other, moved_graph(town(), turn))
    (other / "seen.png").unlink()
    write_files(other, encode_map_server(moved_grid(read_map_server(one), turn)))
    out = tmp_path / "both.png"
    assert main(["map", "diff", str(one), str(other), "--out", str(out)]) == 0
    with Image.open(out) as image:
        sheet = np.asarray(image.convert("L"))[60 : round(0.85 * image.height)]
    left, right = np.split(sheet, 2, axis=1)  # but for the names over them and the legend
    assert ((left < 60) == (right < 60)).mean() > 0.995
    assert (left < 60).sum() > 1000


def test_long_paths_over_a_picture_stay_apart_and_whole_at_both_ends(tmp_path: Path) -> None:
    deep = tmp_path / "/".join(["a-folder-with-a-long-name"] * 5)
    deep.mkdir(parents=True)
    one, other = a_run(deep / "monday", town()), a_run(deep / "friday", town())
    out = tmp_path / "both.svg"
    assert main(["map", "diff", str(one), str(other), "--out", str(out)]) == 0
    sheet = ET.parse(out).getroot()
    texts = [text for text in sheet.iter("{http://www.w3.org/2000/svg}text") if text.text]
    edges = [0.0]
    for name in ("monday", "friday"):
        (words,) = [text for text in texts if (text.text or "").endswith(name)]
        assert (words.text or "").startswith(str(tmp_path)[:12])
        half = float(words.attrib["textLength"]) / 2
        edges += [float(words.attrib["x"]) - half, float(words.attrib["x"]) + half]
    assert edges == sorted(edges)
    assert edges[-1] < float(sheet.attrib["width"])


@pytest.mark.parametrize(
    "arguments",
    [
        ["a", "missing"],
        ["missing", "a"],
        ["a", "a", "--out", "both.gif"],
        ["a", "a", "--out", "missing/both.png"],
    ],
)
def test_what_cannot_be_compared_or_written_is_one_line(
    tmp_path: Path, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    a_run(tmp_path / "a", town())
    monkeypatch.chdir(tmp_path)
    assert main(["map", "diff", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "missing" in line or "both.gif" in line


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "far"])
def test_a_tolerance_is_a_length(tolerance: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["map", "diff", "a", "b", f"--tolerance={tolerance}"])
    assert caught.value.code == 2
    assert "--tolerance" in capsys.readouterr().err
