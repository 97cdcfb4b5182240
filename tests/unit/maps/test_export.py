"""`gvgbot map export`, read by programs that are not ours."""

import io
import json
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import networkx as nx
import numpy as np
import pypdfium2
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from gvgbot.cli import main
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteEdge
from tests.unit.maps.route_server import load
from tests.unit.maps.small_run import GRAPH, write_run
from tests.unit.maps.test_picture import BLUE, of_colour

Captured = pytest.CaptureFixture[str]
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "corridor (1) \\ é")


def export(run: Path, suffix: str) -> bytes:
    out = run.parent / f"map{suffix}"
    assert main(["map", "export", str(run), str(out)]) == 0
    return out.read_bytes()


def meetpoints(tree: ET.Element) -> list[tuple[float, float]]:
    """Where the map has the blue dots of a meetpoint, from left to right, px."""
    dots = [
        [tuple(map(float, point.split(","))) for point in line.attrib["points"].split()]
        for line in tree.findall(f"{SVG}g/{SVG}polyline")
        if line.attrib["stroke"] == "#005a96" and line.attrib["stroke-width"] == "12"
    ]
    return sorted({(x, y) for ((x, y), *_) in dots})


def test_an_svg_has_lines_at_their_places_and_words_as_text(run: Path) -> None:
    tree = ET.fromstring(export(run, ".svg"))
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = meetpoints(tree)
    assert x2 - x1 == pytest.approx(x3 - x2, abs=0.02)  # they stand at x = 0, 5 and 10 m
    assert y1 == pytest.approx(y2, abs=0.02) == pytest.approx(y4, abs=0.02)
    assert x3 == pytest.approx(x4, abs=0.02)  # the dead end is one metre above
    assert y4 - y3 == pytest.approx((x2 - x1) / 5, abs=0.02)
    words = [text.text for text in tree.iter(f"{SVG}text")]
    assert {"1", "2", "3", "4", "GVG edge", "frontier left"} <= set(words)
    assert any(word and word.startswith(f"{run.name}: 4 vertices") for word in words)


def test_virtual_walls_of_the_run_are_at_their_places(run: Path) -> None:
    """One across the corridor at x = 7.5 m, which begins and ends outside."""
    assert "virtual wall" not in export(run, ".svg").decode()
    summary = json.loads((run / "summary.json").read_text())
    walls = {"autonomy": {"virtual_walls": [[[7.5, -50.0], [7.5, 50.0]]]}}
    (run / "summary.json").write_text(json.dumps(summary | {"config": walls}))
    tree = ET.fromstring(export(run, ".svg"))
    (_, (x2, _), (x3, _), _) = meetpoints(tree)  # the others at 5 and 10 m
    dots = [
        tuple(map(float, line.attrib["points"].split()[0].split(",")))
        for line in tree.findall(f"{SVG}g/{SVG}polyline")
        if (line.attrib["stroke"], line.attrib["stroke-width"]) == ("#d55e00", "5")
    ]
    assert {round(x, 1) for x, _ in dots} == {round((x2 + x3) / 2, 1)}
    assert len(dots) == pytest.approx(10 * 4.0, abs=3)  # the grid is 4 m high
    assert "virtual wall" in {text.text for text in tree.iter(f"{SVG}text")}


def test_what_odometry_leaves_the_map_by_is_cut_off(run: Path) -> None:
    rows = [f"{1000 + t} {1000 * t} 0 0 0 0 0 1\n" for t in range(3)]
    (run / "odometry.tum").write_text("".join(rows))
    tree = ET.fromstring(export(run, ".svg"))
    (group,) = tree.findall(f"{SVG}g")
    (clip,) = tree.findall(f"{SVG}clipPath")
    assert group.attrib["clip-path"] == f"url(#{clip.attrib['id']})"
    assert any(line.attrib["stroke"] == "#d55e00" for line in group.iter(f"{SVG}polyline"))
    assert 0 < float(clip[0].attrib["x"]) + float(clip[0].attrib["width"]) < 1400


def rendered(page: pypdfium2.PdfPage) -> Image.Image:
    picture: Image.Image = page.render(scale=2.5).to_pil().convert("RGB")
    return picture


def discs(picture: Image.Image) -> NDArray[np.bool_]:
    """What is blue to the depth of some pixels: discs, but no thin lines."""
    blue = Image.fromarray(of_colour(np.asarray(picture), BLUE).astype(np.uint8) * 255)
    return np.asarray(blue.filter(ImageFilter.MinFilter(7))) > 0


def test_a_pdf_shows_what_the_png_shows_on_a_page_no_wider_than_a4(run: Path) -> None:
    document = pypdfium2.PdfDocument(export(run, ".pdf"))
    (page,) = document
    assert page.get_width() < 595
    ours = rendered(page)
    with Image.open(io.BytesIO(export(run, ".png"))) as png:
        assert abs(ours.height - png.height) <= 1
        theirs = png.convert("RGB").crop((0, 0, *ours.size))
    rough = [np.asarray(image.reduce(4), np.float64) for image in (ours, theirs)]
    assert np.abs(rough[0] - rough[1]).mean() < 3.0
    one, other = (np.argwhere(discs(image)) for image in (ours, theirs))
    assert len(one) == pytest.approx(len(other), rel=0.3)
    assert one.min(axis=0) == pytest.approx(other.min(axis=0), abs=2.0)
    assert one.max(axis=0) == pytest.approx(other.max(axis=0), abs=2.0)


def test_the_words_of_a_pdf_can_be_found(run: Path) -> None:
    (page,) = pypdfium2.PdfDocument(export(run, ".pdf"))
    text = page.get_textpage().get_text_bounded()
    assert f"{run.name}: 4 vertices, 3 edges of 11 m" in text
    assert "meetpoint" in text


def test_graphml_is_the_graph_to_networkx(run: Path) -> None:
    graph = nx.read_graphml(io.BytesIO(export(run, ".graphml")), node_type=int)
    assert not graph.is_directed()
    assert {n: (v["x"], v["y"], v["kind"], v["frontiers"]) for n, v in graph.nodes.items()} == {
        1: (0.0, 0.0, "meetpoint", 2),
        2: (5.0, 0.0, "meetpoint", 1),
        3: (10.0, 0.0, "meetpoint", 1),
        4: (10.0, 1.0, "endpoint", 0),
    }
    spread = [graph.nodes[3][f"covariance_{name}"] for name in ("xx", "xy", "yy")]
    assert spread == pytest.approx([0.0036, 0.0, 0.0001])
    assert nx.shortest_path_length(graph, 1, 4, weight="length") == pytest.approx(11.0)
    assert graph.edges[3, 4]["line"] == "LINESTRING (10.000000 0.000000, 10.000000 1.000000)"


def test_parallel_edges_and_loops_stay_what_they_are(run: Path) -> None:
    edges = (*GRAPH.edges, GRAPH.edges[0], _loop())
    text = geojson.encode(type(GRAPH)(GRAPH.vertices, edges))
    (run / "map.geojson").write_text(text)
    graph = nx.read_graphml(io.BytesIO(export(run, ".graphml")), node_type=int)
    assert graph.number_of_edges(1, 2) == 2
    assert graph.number_of_edges(2, 2) == 1


def _loop() -> RouteEdge:
    line = np.array([[5.0, 0.0], [6.0, 1.0], [5.0, 0.0]])
    return RouteEdge(start=2, end=2, polyline=line, min_clearance=0.5)


def test_geojson_is_for_the_route_server(run: Path) -> None:
    loaded = load(export(run, ".GeoJSON").decode())
    assert loaded.nodes == {vertex.id: vertex.position for vertex in GRAPH.vertices}
    assert len(loaded.edges) == 2 * len(GRAPH.edges)  # all are straight


def test_a_graph_that_the_route_server_refuses_is_said_to_be_one(
    run: Path, capsys: Captured
) -> None:
    (run / "map.geojson").write_text(geojson.encode(type(GRAPH)(GRAPH.vertices, ())))
    export(run, ".geojson")
    assert "but:     there is no edge in it" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["map.jpg", "map", "nowhere/map.svg"])
def test_an_unfit_name_is_one_line(
    run: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(run)
    assert main(["map", "export", str(run), name]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert name.removesuffix("/map.svg") in line


@pytest.mark.parametrize(
    ("name", "encoding", "shown"),
    [
        ("plan \u00fc.svg", "ascii", "plan \\xfc.svg"),
        ("plan \udcff.svg", "utf-8", "plan \\udcff.svg"),
    ],
    ids=["of another alphabet", "in another encoding"],
)
def test_a_name_that_the_terminal_cannot_show_is_spelt_out(
    run: Path, name: str, encoding: str, shown: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(terminal, encoding=encoding))
    monkeypatch.chdir(run)
    assert main(["map", "export", ".", name]) == 0
    assert terminal.getvalue().decode() == f"written: {shown}\n"
    assert (run / name).exists()


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".graphml", ".geojson"])
def test_a_damaged_run_is_one_line_and_no_file(run: Path, suffix: str, capsys: Captured) -> None:
    (run / "map.geojson").write_text("{")
    out = run.parent / f"map{suffix}"
    assert main(["map", "export", str(run), str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "map.geojson" in line
    assert not out.exists()
