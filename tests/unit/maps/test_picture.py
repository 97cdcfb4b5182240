"""Pictures are judged by their pixels: where the colours are, and how far apart."""

import io
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from gvgbot.geometry import Array
from gvgbot.maps.canvas import Ink
from gvgbot.maps.drawing import Drawing, Stroke
from gvgbot.maps.legend import round_length
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.picture import counts, draw_map, draw_map_on, draw_vertex, widest_gap
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.maps.trajectory import Trajectory
from gvgbot.maps.view import View, box_around

Pixels = NDArray[np.uint8]
Mask = NDArray[np.bool_]

BLUE, SKY, GREEN = (0, 90, 150), (86, 180, 233), (0, 120, 85)
RED, PURPLE, ORANGE = (213, 94, 0), (170, 51, 119), (230, 159, 0)
UNKNOWN, WALL = (238, 238, 238), (35, 35, 35)

NONE = (0.0, 0.0, 0.0, 0.0)


def vertex(number: int, x: float, y: float, **changes: Any) -> RouteNode:
    fields: dict[str, Any] = {
        "kind": "meetpoint",
        "degree": 3,
        "bearings": (0.0, 2.0, 4.0),
        "clearance": 1.0,
        "covariance": NONE,
    }
    return RouteNode(id=number, position=(x, y), **(fields | changes))


TRIANGLE = RouteGraph((vertex(1, 0.0, 0.0), vertex(2, 20.0, 0.0), vertex(3, 0.0, 10.0)))


def pixels(png: bytes) -> Pixels:
    with Image.open(io.BytesIO(png)) as image:
        assert image.format == "PNG"
        assert image.mode == "RGB"
        return np.asarray(image)


def map_part(picture: Pixels) -> Pixels:
    """What is inside the frame: the frame's lines are the longest grey ones."""
    frame = (picture == (120, 120, 120)).all(axis=2)
    rows = np.flatnonzero(frame.sum(axis=1) > 0.5 * picture.shape[1])
    columns = np.flatnonzero(frame.sum(axis=0) > 0.5 * (rows[-1] - rows[0]))
    return picture[rows[0] + 1 : rows[-1], columns[0] + 1 : columns[-1]]


def of_colour(picture: Pixels, colour: tuple[int, int, int]) -> Mask:
    same: Mask = np.abs(picture.astype(int) - colour).max(axis=2) <= 12
    return same


def extent(mask: Mask) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of what is set."""
    rows, columns = np.nonzero(mask)
    return float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max())


def discs(picture: Pixels) -> list[tuple[int, int]]:
    """Middles (x right, y down) of the blue discs, from left to right, then from the top."""
    ys, xs = np.nonzero(of_colour(map_part(picture), BLUE))
    groups: list[list[tuple[float, float]]] = []
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        near = [g for g in groups if math.hypot(g[0][0] - x, g[0][1] - y) < 40]
        near[0].append((x, y)) if near else groups.append([(x, y)])
    middles = [np.rint(np.mean(group, axis=0)).astype(int).tolist() for group in groups]
    return sorted((x, y) for x, y in middles)


def test_vertices_stand_to_scale_with_y_upwards() -> None:
    (x3, y3), (x1, y1), (x2, y2) = discs(pixels(draw_map(TRIANGLE)))
    assert x3 == pytest.approx(x1, abs=1)
    assert y2 == pytest.approx(y1, abs=1)
    assert y3 < y1
    assert (x2 - x1) == pytest.approx(2 * (y1 - y3), abs=2)


def test_a_wide_map_is_1400_pixels_wide_and_a_tall_one_stays_printable() -> None:
    tall = RouteGraph((vertex(1, 0.0, 0.0), vertex(2, 1.0, 80.0)))
    assert pixels(draw_map(TRIANGLE)).shape[1] == 1400
    height, width, _ = pixels(draw_map(tall)).shape
    assert 600 < width < height < 2000


def test_endpoints_are_hollow_and_meetpoints_filled() -> None:
    graph = RouteGraph((vertex(1, 0.0, 0.0, kind="endpoint"), vertex(2, 20.0, 0.0)))
    picture = pixels(draw_map(graph))
    part = map_part(picture)
    (x1, y1), (x2, y2) = discs(picture)
    assert part[y1, x1].tolist() == [255, 255, 255]
    assert part[y2, x2].tolist() == list(BLUE)


def test_an_ellipse_reaches_three_sigma_along_its_axes() -> None:
    tilt, long, short = 0.6, 1.0, 0.25  # sigmas in m along and across the tilted axis
    c, s = math.cos(tilt), math.sin(tilt)
    turn = np.array([[c, -s], [s, c]])
    covariance = turn @ np.diag([long**2, short**2]) @ turn.T
    graph = RouteGraph(
        (
            vertex(1, 0.0, 0.0, covariance=tuple(covariance.ravel().tolist())),
            vertex(2, 20.0, 0.0),
            vertex(3, -10.0, -8.0),
        )
    )
    picture = pixels(draw_map(graph))
    _, (x1, y1), (x2, _) = discs(picture)
    scale = (x2 - x1) / 20.0
    rows, columns = np.nonzero(of_colour(map_part(picture), PURPLE))
    points = np.column_stack([columns - x1, y1 - rows]) / scale
    points = points[np.hypot(points[:, 0], points[:, 1]) < 5.0]
    along, across = (points @ turn).T
    assert along.max() == pytest.approx(3.0 * long, abs=0.06)
    assert across.max() == pytest.approx(3.0 * short, abs=0.06)


def test_walls_lie_where_the_graph_says() -> None:
    cells = np.zeros((100, 200), np.int8)
    cells[:, :4] = 100
    cells[80:, 150:] = -1  # the upper right corner
    grid = OccupancyGrid(cells, 0.1, (0.0, 0.0))
    picture = pixels(draw_map(TRIANGLE, grid=grid))
    part = map_part(picture)
    (_, y3), (x1, y1), (x2, _) = discs(picture)
    scale = (x2 - x1) / 20.0
    dark = of_colour(part, WALL)
    dark[:, dark.sum(axis=0) < 100] = False  # letters are not walls
    dark[dark.sum(axis=1) < 15] = False
    left, top, right, bottom = extent(dark)
    assert (left, right) == pytest.approx((x1, x1 + 0.4 * scale), abs=2)
    assert (top, bottom) == pytest.approx((y3, y1), abs=2)
    x, y = round(x1 + 17.0 * scale), round(y1 - 9.0 * scale)
    assert part[y, x].tolist() == list(UNKNOWN)
    assert part[round(y1 - 5.0 * scale), x].tolist() == [255, 255, 255]


def test_a_grid_is_not_upside_down() -> None:
    cells = np.zeros((100, 200), np.int8)
    cells[:20] = 100  # the lowest two metres
    picture = pixels(draw_map(TRIANGLE, grid=OccupancyGrid(cells, 0.1, (0.0, 0.0))))
    part = map_part(picture)
    _, (x1, y1), (x2, _) = discs(picture)
    scale = (x2 - x1) / 20.0
    x = round(x1 + 10.0 * scale)
    shades = [part[round(y1 - y * scale), x].tolist() for y in (1.0, 5.0, 9.0)]
    assert shades == [list(WALL), [255, 255, 255], [255, 255, 255]]


def test_the_scale_bar_is_as_long_as_it_says() -> None:
    """Four fields between the map and the signs, the first one black; its length is before it."""
    drawing = draw_map_on(
        Drawing,
        TRIANGLE,
        grid=None,
        estimate=None,
        odometry=None,
        virtual_walls=np.empty((0, 2)),
        title="",
    )
    boxes = [one for one in drawing.shapes if isinstance(one, Stroke) and one.ink == Ink.BLACK]
    ends = np.concatenate([box.points for box in boxes if len(box.points) == 4])
    (metres,) = [float(w.words[:-2]) for w in drawing.words if w.words in ("1 m", "2 m", "5 m")]
    (one, two) = (w.at[0] for w in drawing.words if w.words in ("1", "2"))
    assert len(boxes) == 4
    assert np.ptp(ends[:, 0]) == pytest.approx(metres / 20.0 * (two - one), rel=0.02)


def test_the_name_of_a_vertex_stands_beside_it_where_no_edge_leaves() -> None:
    """Its edges leave downwards and to the sides."""
    below = (0.0, math.pi, -math.pi / 2, -math.pi / 4, -3 * math.pi / 4)
    drawing = Drawing(100, 100)
    draw_vertex(drawing, vertex(7, 0.0, 0.0, bearings=below), (50.0, 50.0))
    (name,) = drawing.words
    assert name.words == "7"
    assert name.at[0] == pytest.approx(50.0)
    assert 30.0 < name.at[1] < 44.0  # over the disc


def test_of_a_huge_map_no_thin_wall_is_lost() -> None:
    """Walls of one cell stand across a corridor 300 m long, whatever cells a pixel shows."""
    walls = np.arange(30, 5970, 97)
    cells = np.zeros((400, 6000), np.int8)
    cells[:, walls], cells[:, :10] = 100, -1
    part = map_part(pixels(draw_map(TRIANGLE, grid=OccupancyGrid(cells, 0.05, (-150.0, -8.0)))))
    row = part[len(part) // 2 - 20].mean(axis=1)
    dark = np.flatnonzero(row < 200.0)
    (firsts,) = np.nonzero(np.diff(dark, prepend=-9) > 2)
    assert len(firsts) == len(walls)
    scale = 0.05 * 1344 / (299.5 * 1.04)  # pixels per cell; a fiftieth is left on each side
    assert np.diff(dark[firsts]) == pytest.approx(97 * scale, abs=2)


def test_edges_paths_and_frontiers_are_drawn_in_their_colours() -> None:
    edge = RouteEdge(
        start=1, end=2, polyline=np.array([[0.0, 0.0], [20.0, 0.0]]), min_clearance=1.0
    )
    graph = RouteGraph(
        (vertex(1, 0.0, 0.0, frontiers=(math.pi / 2,)), vertex(2, 20.0, 0.0)), (edge,)
    )
    picture = pixels(
        draw_map(graph, estimate=path([0, 5], [20, 5]), odometry=path([0, 5], [20, 0]))
    )
    part = map_part(picture)
    (x1, y1), (x2, _) = discs(picture)
    middle = (x1 + x2) // 2
    assert of_colour(part, SKY)[y1, middle]
    left, top, right, bottom = extent(of_colour(part, GREEN))
    assert bottom - top < 4
    assert right - left > 0.9 * (x2 - x1)
    assert top < y1
    left, top, right, bottom = extent(of_colour(part, ORANGE))
    assert top < y1 - 20  # the frontier points up
    assert right - left < 20
    _, top, _, bottom = extent(np.abs(part.astype(int) - RED).sum(axis=2) < 60)
    assert bottom - top == pytest.approx((x2 - x1) / 4, rel=0.1)


def path(*corners: list[float]) -> Trajectory:
    share = np.linspace(0.0, 1.0, 500)[:, None]
    start, end = np.array(corners, np.float64)
    poses = np.column_stack([start + share * (end - start), np.zeros(500)])
    return Trajectory(np.linspace(0.0, 50.0, 500), poses)


def test_no_path_leads_to_where_the_robot_was_carried() -> None:
    before, after = path([0, 5], [5, 5]), path([15, 5], [20, 5])
    carried = Trajectory(
        np.concatenate([before.stamps, after.stamps + 60.0]),  # ten seconds later
        np.concatenate([before.poses, after.poses]),
    )
    part = map_part(pixels(draw_map(TRIANGLE, estimate=carried, odometry=carried)))
    drawn = of_colour(part, GREEN).any(axis=0) | of_colour(part, RED).any(axis=0)
    columns = np.flatnonzero(drawn)
    gaps = np.diff(columns)
    assert gaps.max() == pytest.approx(0.5 * np.ptp(columns), rel=0.05)
    assert (np.sort(gaps)[:-1] < 3).all()


def test_odometry_that_went_astray_does_not_shrink_the_map() -> None:
    lost = path([0, 0], [4000, 4000])
    (x3, _), (_, _), (x2, _) = discs(pixels(draw_map(TRIANGLE, odometry=lost)))
    assert x2 - x3 > 0.6 * 1600


def test_nothing_is_drawn_outside_the_frame_but_the_legend() -> None:
    picture = pixels(draw_map(TRIANGLE, odometry=path([0, 0], [4000, -4000])))
    border = np.concatenate([picture[:, :20].reshape(-1, 3), picture[:, -20:].reshape(-1, 3)])
    assert (border == 255).all()


@pytest.mark.parametrize(
    "grid", [None, OccupancyGrid(np.full((4, 4), -1, np.int8), 0.05, (0.0, 0.0))]
)
def test_a_map_of_nothing_is_a_picture_too(grid: OccupancyGrid | None) -> None:
    assert pixels(draw_map(RouteGraph(), grid=grid)).shape[1] == 1400


def test_the_same_map_gives_the_same_bytes() -> None:
    assert draw_map(TRIANGLE, title="twice") == draw_map(TRIANGLE, title="twice")


@pytest.mark.parametrize(
    ("bearings", "middle"),
    [
        ((), math.pi / 2),
        ((0.0,), math.pi),
        ((0.0, math.pi / 2), -3 * math.pi / 4),
        ((-3.0, 3.0, 0.0), 1.5),
        ((0.0, math.pi / 2, -math.pi / 2), math.pi),
    ],
)
def test_an_id_stands_where_no_edge_leaves(bearings: tuple[float, ...], middle: float) -> None:
    assert widest_gap(bearings) == pytest.approx(middle)


def test_one_is_not_many() -> None:
    assert counts([1], []) == "1 vertex, 0 edges"
    assert counts([], [1]) == "0 vertices, 1 edge"


@pytest.mark.parametrize(
    ("longest", "length"),
    [(1.0, 1.0), (1.99, 1.0), (4.9, 2.0), (5.0, 5.0), (99.0, 50.0), (0.3, 0.2), (1234.0, 1000.0)],
)
def test_a_scale_bar_has_a_round_length(longest: float, length: float) -> None:
    assert round_length(longest) == pytest.approx(length)


def test_a_view_keeps_all_of_its_box_inside_and_both_axes_alike() -> None:
    points: Array = np.array([[-3.0, 4.0], [17.0, 9.0]])
    view = View.fitted(box_around(points), (10.0, 20.0), width=800.0, height=600.0)
    shown = view.pixels(points)
    low, high = view.corner, view.corner + view.size
    assert (shown > low).all()
    assert (shown < high).all()
    step = view.pixels(points + np.array([1.0, 1.0])) - shown
    assert step == pytest.approx(np.array([[1.0, -1.0], [1.0, -1.0]]) * view.scale)
    assert view.size.max() == pytest.approx(800.0)


@pytest.mark.parametrize("far", [(1e5, 0.0), (0.0, 1e5)])
def test_a_grid_that_is_less_than_a_pixel_beside_a_vertex_far_away_is_no_error(
    far: tuple[float, float],
) -> None:
    grid = OccupancyGrid(np.zeros((200, 150), np.int8), 0.05, (0.0, 0.0))
    assert pixels(draw_map(RouteGraph((vertex(1, *far),)), grid=grid)).size
