"""Films are judged by their pixels, in a corridor along which the robot drives to the right."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from gvgbot.maps import geojson
from gvgbot.maps.canvas import Canvas, Ink
from gvgbot.maps.drawing import Drawing, Stroke
from gvgbot.maps.film import clock, draw_strip, gif
from gvgbot.maps.growth import Growth
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.maps.saved_run import SavedRun
from tests.unit.maps.small_run import GRAPH, UP, write_run

BLACK, BLUE, SKY, ORANGE = (20, 20, 20), (0, 90, 150), (86, 180, 233), (230, 159, 0)
GREEN = (0, 120, 85)
UNKNOWN, GREY = (238, 238, 238), (120, 120, 120)

Pixels = NDArray[np.uint8]


@pytest.fixture
def growth(tmp_path: Path) -> Growth:
    return Growth.of(SavedRun.read(write_run(tmp_path / "run")))


def frames(film: bytes) -> tuple[list[Pixels], list[int]]:
    """The parts of all frames that show the map, and how long (ms) each is shown."""
    pictures, pauses = [], []
    with Image.open(io.BytesIO(film)) as image:
        assert image.format == "GIF"
        assert image.info["loop"] == 0
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            pauses.append(int(image.info["duration"]))
            pictures.append(map_part(np.asarray(image.convert("RGB"))))
    return pictures, pauses


def map_part(picture: Pixels) -> Pixels:
    """What is inside the frame, whose lines are the longest grey ones."""
    grey = (picture == GREY).all(axis=2)
    rows = np.flatnonzero(grey.sum(axis=1) > 0.5 * picture.shape[1])
    columns = np.flatnonzero(grey.sum(axis=0) > 0.5 * (rows[-1] - rows[0]))
    return picture[rows[0] + 1 : rows[-1], columns[0] + 1 : columns[-1]]


def columns_of(picture: Pixels, colour: tuple[int, int, int]) -> NDArray[np.intp]:
    return np.nonzero((picture == colour).all(axis=2))[1]


def test_the_robot_drives_and_the_map_grows_before_it(growth: Growth) -> None:
    pictures, pauses = frames(gif(growth, 6))
    assert len(pictures) == 6
    assert pauses[-1] > 5 * pauses[0]
    width = pictures[0].shape[1]
    robots = [np.median(columns_of(p, BLACK)) for p in pictures]
    metres = np.diff(robots) / (width / (12.0 * 1.04))  # a border of 2 % on each side
    assert metres == pytest.approx([2.0] * 5, abs=0.1)
    unknown = [len(columns_of(p, UNKNOWN)) for p in pictures]
    assert unknown == sorted(unknown, reverse=True)
    assert unknown[0] > 0.6 * pictures[0].shape[0] * width


def test_no_path_leads_to_where_the_robot_was_carried(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    lines = (directory / "estimate.tum").read_text().splitlines(keepends=True)
    (directory / "estimate.tum").write_text("".join(lines[:31] + lines[71:]))  # of four metres
    end = frames(gif(Growth.of(SavedRun.read(directory)), 2))[0][-1]
    columns = np.unique(columns_of(end, GREEN))
    assert np.diff(columns).max() == pytest.approx(end.shape[1] * 4.0 / 12.5, rel=0.1)


def test_graph_and_frontiers_appear_when_they_were_found(growth: Growth) -> None:
    start, _, before, _, end = frames(gif(growth, 5))[0]  # after 0, 5 and 10 s
    assert len(columns_of(start, SKY)) == len(columns_of(before, SKY)) == 0
    assert np.ptp(columns_of(end, SKY)) > 0.75 * end.shape[1]
    assert np.ptp(columns_of(start, ORANGE)) < 0.1 * end.shape[1]  # about the first vertex
    assert np.ptp(columns_of(before, BLUE)) > 0.8 * end.shape[1]  # the first and the last
    assert len(columns_of(before, ORANGE)) > len(columns_of(end, ORANGE)) > 0


def test_a_dead_end_that_was_only_seen_has_its_frontier_as_on_the_map(tmp_path: Path) -> None:
    """Nobody has driven from the last meetpoint to the dead end."""
    directory = write_run(tmp_path / "run")
    others, last, end = GRAPH.vertices[:2], *GRAPH.vertices[2:]
    last, end = replace(last, frontiers=(UP, -UP)), replace(end, frontiers=(-UP,))
    graph = RouteGraph((*others, last, end), GRAPH.edges[:2])
    (directory / "map.geojson").write_text(geojson.encode(graph))
    sheet = draw_strip(Drawing, Growth.of(SavedRun.read(directory)), 2)
    shapes = [one for one in sheet.windows[-1].shapes if isinstance(one, Stroke)]
    arrows = [one for one in shapes if one.is_closed and one.fill == Ink.ORANGE]
    assert len(arrows) == sum(len(vertex.frontiers) for vertex in graph.vertices) == 6


def test_the_last_frame_says_what_the_summary_says(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    summary = json.loads((directory / "summary.json").read_text())
    (directory / "summary.json").write_text(json.dumps(summary | {"distance_m": 13.2}))
    sheet = draw_strip(Drawing, Growth.of(SavedRun.read(directory)), 2)
    caption = next(words.words for words in sheet.words if "driven" in words.words)
    assert caption.endswith(", 13 m driven")


@pytest.mark.parametrize("moments", [2, 5, 7])
def test_a_strip_has_a_frame_for_each_moment(growth: Growth, moments: int) -> None:
    with Image.open(io.BytesIO(draw_strip(Canvas, growth, moments).png())) as image:
        assert image.format == "PNG"
        picture = np.asarray(image.convert("RGB"))
    assert 560 <= picture.shape[1] <= 1400
    things, _ = ndimage.label((picture < 250).all(axis=2), np.ones((3, 3)))
    sizes = [
        (rows.stop - rows.start, columns.stop - columns.start)
        for rows, columns in ndimage.find_objects(things)
    ]
    assert sum(height > 60 and width > 120 for height, width in sizes) == moments


def test_the_same_run_gives_the_same_bytes(growth: Growth) -> None:
    assert gif(growth, 4) == gif(growth, 4)
    strips = [draw_strip(Canvas, growth, 4).png() for _ in range(2)]
    assert strips[0] == strips[1]


@pytest.mark.parametrize(
    ("time", "words"),
    [(0.0, "0:00"), (9.6, "0:10"), (725.2, "12:05"), (3599.9, "1:00:00"), (7384.0, "2:03:04")],
)
def test_a_clock_shows_minutes_and_seconds(time: float, words: str) -> None:
    assert clock(time) == words
