"""Whatever `gvgbot map` draws is the same in every format, as other programs read it."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pypdfium2
import pytest
from PIL import Image

from gvgbot.cli import main
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteGraph
from tests.unit.maps.small_run import GRAPH, write_run

SVG = "{http://www.w3.org/2000/svg}"
COMMANDS = {
    "map": ["show", "a"],
    "strip": ["show", "a", "--frames", "5"],
    "both": ["diff", "a", "b"],
}
pytestmark = pytest.mark.parametrize("arguments", COMMANDS.values(), ids=COMMANDS)


@pytest.fixture(autouse=True)
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs, of which the second has not found the dead end."""
    monkeypatch.chdir(tmp_path)
    write_run(Path("a"))
    lacking = RouteGraph(GRAPH.vertices[:-1], GRAPH.edges[:-1])
    (write_run(Path("b")) / "map.geojson").write_text(geojson.encode(lacking))


def drawn(arguments: list[str], suffix: str) -> Path:
    path = Path(f"picture{suffix}")
    assert main(["map", *arguments, "--out", str(path)]) == (arguments[0] == "diff")
    return path


def test_a_pdf_is_rendered_to_what_the_png_shows(arguments: list[str]) -> None:
    (page,) = pypdfium2.PdfDocument(drawn(arguments, ".pdf"))
    ours = page.render(scale=2.5).to_pil()
    with Image.open(drawn(arguments, ".png")) as png:
        assert np.abs(np.subtract(ours.size, png.size)).max() <= 1
        size = np.minimum(ours.size, png.size)
        both = [image.convert("RGB").crop((0, 0, *size)) for image in (ours, png)]
    rough = [np.asarray(image.reduce(4), np.float64) for image in both]
    assert np.abs(rough[0] - rough[1]).mean() < 3.0
    assert rough[1].std() > 10.0  # not an empty page


def test_a_pdf_has_its_objects_where_its_table_says(arguments: list[str]) -> None:
    """Viewers find them all the same, and then say that the file was damaged (ISO 32000-1, 7.5)."""
    file = drawn(arguments, ".pdf").read_bytes()
    (start,) = re.findall(rb"startxref\n(\d+)\n%%EOF\n$", file)
    head, count, *entries = file[int(start) :].partition(b"trailer")[0].splitlines()
    assert (head, count) == (b"xref", b"0 %d" % len(entries))
    assert all(len(entry) == 19 for entry in entries)  # and a line's end of two bytes, with a blank
    for number, entry in enumerate(entries[1:], start=1):
        assert file[int(entry[:10]) :].startswith(b"%d 0 obj\n" % number)
    assert f"/Size {len(entries)} ".encode() in file


def test_an_svg_has_the_words_of_the_pdf_at_their_places(arguments: list[str]) -> None:
    tree = ET.parse(drawn(arguments, ".svg")).getroot()
    (page,) = pypdfium2.PdfDocument(drawn(arguments, ".pdf"))
    text = page.get_textpage()
    assert float(tree.attrib["width"]) == pytest.approx(2.5 * page.get_width(), abs=1.0)
    placed = list(tree.iter(f"{SVG}text"))
    assert len(placed) > 10
    for words in placed:
        x, y = (float(words.attrib[key]) / 2.5 for key in ("x", "y"))
        near = text.get_text_bounded(
            x - 200.0, page.get_height() - y - 4.0, x + 200.0, page.get_height() - y + 8.0
        )
        assert words.text is not None
        assert words.text in near


def test_a_name_that_is_too_long_leaves_room_for_the_scale(arguments: list[str]) -> None:
    """Nothing is written over anything else in the caption's row, nor over the edge."""
    name = "a-run-" + "of-which-much-can-be-said-" * 8
    for run in ("a", "b"):
        Path(run).rename(f"{run}-{name}")
    named = [f"{word}-{name}" if word in ("a", "b") else word for word in arguments]
    tree = ET.parse(drawn(named, ".svg")).getroot()
    texts = list(tree.iter(f"{SVG}text"))
    (scale,) = [text for text in texts if re.fullmatch(r"[\d.]+ m", text.text or "")]
    row = [text for text in texts if text.attrib["y"] == scale.attrib["y"]]
    assert len(row) == 2
    caption = next(text for text in row if text is not scale)
    end = float(caption.attrib["x"]) + float(caption.attrib["textLength"])
    assert end < float(scale.attrib["x"]) - float(scale.attrib["textLength"])
    facts = {"show": ("m", "driven"), "diff": ("different within 0.5 m",)}[arguments[0]]
    assert (caption.text or "").endswith(facts)


def test_a_name_that_xml_cannot_say_spoils_no_picture(arguments: list[str]) -> None:
    """A bell, and a byte of another encoding than that of the file system."""
    for run in ("a", "b"):
        Path(run).rename(f"{run}\x07\udce9")
    named = [f"{word}\x07\udce9" if word in ("a", "b") else word for word in arguments]
    tree = ET.parse(drawn(named, ".svg")).getroot()
    words = [text.text or "" for text in tree.iter(f"{SVG}text")]
    assert any(text == "a" or text.startswith("a: ") for text in words)
