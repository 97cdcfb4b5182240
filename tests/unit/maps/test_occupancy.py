"""Grids of rooms whose walls are known exactly: ranges come from ray-box geometry."""

import math
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from PIL import Image

from gvgbot.atomic_files import write_files
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.maps.map_server import encode_map_server, read_map_server
from gvgbot.maps.occupancy import GrowingGrid, OccupancyGrid, occupancy_grid

CELL = 0.05
# walls in the middle of cells: left, bottom, right, top
ROOM = (-2.025, -1.025, 4.025, 3.025)


def room_ranges(map_laser: Pose, bearings: Array) -> Array:
    """Distance from inside the room to its walls."""
    left, bottom, right, top = ROOM
    c, s = np.cos(bearings + map_laser.theta), np.sin(bearings + map_laser.theta)
    with np.errstate(divide="ignore"):
        across = np.abs(np.where(c > 0, right - map_laser.x, left - map_laser.x) / c)
        along = np.abs(np.where(s > 0, top - map_laser.y, bottom - map_laser.y) / s)
    nearest: Array = np.minimum(across, along)
    return nearest


def a_scan(
    map_base: Pose, *, beams: int = 1440, fov: float = math.tau, base_laser: Pose | None = None
) -> Scan:
    mount = Pose() if base_laser is None else base_laser
    step = fov / beams
    bearings = np.linspace(-fov / 2, fov / 2, beams, endpoint=False)
    ranges = room_ranges(map_base.compose(mount), bearings)
    return Scan(0.0, ranges, -fov / 2, step, 0.02, 30.0, base_laser=mount)


def open_hall(ranges: Array, range_max: float = 5.6) -> Scan:
    step = math.tau / len(ranges)
    return Scan(0.0, ranges, -math.pi, step, 0.02, range_max)


def centres(grid: OccupancyGrid) -> tuple[Array, Array]:
    """x (columns,) and y (rows,) of the cells."""
    rows, columns = grid.cells.shape
    x = (np.arange(columns, dtype=np.float64) + 0.5) * grid.resolution_m
    y = (np.arange(rows, dtype=np.float64) + 0.5) * grid.resolution_m
    return grid.origin[0] + x, grid.origin[1] + y


def outside_by(grid: OccupancyGrid) -> Array:
    """How far each cell's centre is outside the walls, the larger of both axes; < 0 inside."""
    left, bottom, right, top = ROOM
    x, y = centres(grid)
    over_x = np.maximum(left - x, x - right)
    over_y = np.maximum(bottom - y, y - top)
    return np.maximum(over_x[None, :], over_y[:, None])


POSES = [
    Pose(0.0, 0.0, 0.0),
    Pose(1.013, 0.77, 2.0),
    Pose(3.1, 2.2, -3.0),
    Pose(-1.5, 2.46, 0.7),
    Pose(2.2, -0.41, -1.2),
]


def check_room(grid: OccupancyGrid) -> None:
    outside = outside_by(grid)
    on_wall = np.abs(outside) < 1e-6
    assert (grid.cells[on_wall] > 65).mean() > 0.99
    assert (grid.cells[outside < -1.5 * CELL] < 5).all()
    assert (grid.cells[outside < -1.5 * CELL] >= 0).all()
    assert (grid.cells[outside > 0.5 * CELL] == -1).all()


def test_a_room_has_walls_where_geometry_says_free_inside_and_unknown_outside() -> None:
    check_room(occupancy_grid([(pose, a_scan(pose)) for pose in POSES], CELL))


def test_scans_that_come_one_by_one_draw_the_same_grid_as_all_at_once() -> None:
    rng = np.random.default_rng(5)
    poses = [Pose(x, y, 0.3) for x, y in rng.uniform(-40.0, 40.0, (12, 2))]  # mostly out of reach
    scan = replace(open_hall(np.full(90, 3.0)), base_laser=Pose(0.9, -0.7, 1.0))
    scans = [(pose, replace(scan, stamp=float(i))) for i, pose in enumerate(poses)]
    growing = GrowingGrid(0.2, 8.0)
    for pose, scan in scans:
        growing.add(pose, scan)
    grid, expected = growing.grid(), occupancy_grid(scans, 0.2, 8.0)
    assert grid.origin == expected.origin
    assert (grid.cells == expected.cells).all()
    assert grid.seen_s is None


def test_a_growing_grid_keeps_a_byte_for_each_cell() -> None:
    growing, scan = GrowingGrid(0.2, 8.0), open_hall(np.full(90, 3.0))
    growing.add(Pose(), scan)
    tracemalloc.start()
    growing.add(Pose(100.0, 0.0), scan)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    reach = scan.range_max
    cells = 2.0 * reach * (100.0 + 2.0 * reach) / 0.2**2
    assert cells < kept < 1.5 * cells


def test_squares_of_a_growing_grid_are_cut_out_of_it_and_all_changes_lie_around_the_scan() -> None:
    growing, pose, mount = GrowingGrid(CELL, 0.5), Pose(1.0, 1.0, 0.3), Pose(0.9, -0.7, 1.0)
    scan = a_scan(pose, base_laser=mount)
    growing.add(pose, scan)
    low, high = growing.around(pose, scan)
    grid = growing.grid()
    left, bottom = (round(x / CELL) for x in grid.origin)
    rows, columns = np.nonzero(grid.cells >= 0)
    known = {
        (row + bottom, column + left): grid.cells[row, column]
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    }
    assert known
    found, side = {}, 37
    for row in range(bottom - 50, bottom + grid.cells.shape[0] + 50, side):
        for column in range(left - 50, left + grid.cells.shape[1] + 50, side):
            square = growing.square(row, column, side)
            for y, x in np.argwhere(square >= 0).tolist():
                found[row + y, column + x] = square[y, x]
    assert found == known
    assert all(low[0] <= row < high[0] and low[1] <= column < high[1] for row, column in known)


def test_a_way_that_no_memory_holds_a_grid_of_is_refused() -> None:
    scan = a_scan(Pose())
    with pytest.raises(GvgbotError, match="too large: is the odometry damaged"):
        occupancy_grid([(Pose(), scan), (Pose(1e7, 1e7), scan)])


def test_a_grid_that_has_not_begun_to_grow_is_unknown() -> None:
    assert GrowingGrid().grid().cells.tolist() == [[-1]]
    assert (GrowingGrid().square(3, -5, 4) == -1).all()


def test_a_mounted_laser_draws_the_same_room() -> None:
    mount = Pose(0.21, -0.13, 2.5)
    scans = [(pose, a_scan(pose, base_laser=mount)) for pose in POSES]
    check_room(occupancy_grid(scans, CELL))


def test_half_a_turn_of_view_sees_only_its_half() -> None:
    pose = Pose(1.0, 1.0, math.pi / 2)
    grid = occupancy_grid([(pose, a_scan(pose, fov=math.pi))], CELL)
    _, y = centres(grid)
    assert (grid.cells[y < 1.0 - 2 * CELL] == -1).all()
    inside = outside_by(grid) < -1.5 * CELL
    assert (grid.cells[inside & (y > 1.0 + 2 * CELL)[:, None]] >= 0).mean() > 0.99


def test_one_look_is_enough_for_map_server() -> None:
    grid = occupancy_grid([(POSES[0], a_scan(POSES[0], beams=7200))], CELL)
    outside = outside_by(grid)
    assert (grid.cells[outside < -1.5 * CELL] < 19.6).all()
    assert (grid.cells[np.abs(outside) < 1e-6] > 65).mean() > 0.99


def test_nothing_in_range_is_free_to_the_range_of_the_laser() -> None:
    grid = occupancy_grid([(Pose(1.0, 2.0, 0.3), open_hall(np.full(720, np.inf)))], CELL)
    free = (grid.cells >= 0).sum() * CELL**2
    assert free == pytest.approx(math.pi * 5.6**2, rel=0.01)
    assert grid.cells.max() < 50


def test_beyond_the_carving_range_nothing_is_marked() -> None:
    ranges = np.full(720, 8.0)
    grid = occupancy_grid([(Pose(), open_hall(ranges, 30.0))], CELL, max_range_m=3.0)
    assert (grid.cells >= 0).sum() * CELL**2 == pytest.approx(math.pi * 3.0**2, rel=0.02)
    assert grid.cells.max() < 50


def test_untrusted_beams_say_nothing() -> None:
    ranges = np.full(720, 4.0)
    ranges[:360] = np.nan  # bearings below zero
    grid = occupancy_grid([(Pose(), open_hall(ranges))], CELL)
    x, y = centres(grid)
    below = np.broadcast_to((y < -CELL)[:, None], grid.cells.shape)
    assert (grid.cells[below] == -1).all()
    half_disc = (np.hypot(x[None, :], y[:, None]) < 3.9) & (y > 2 * CELL)[:, None]
    assert (grid.cells[half_disc] >= 0).mean() > 0.98


def test_a_single_untrusted_beam_says_nothing_though_its_neighbours_do() -> None:
    ranges = np.full(36, 4.0)  # ten degrees apart
    ranges[18] = np.nan  # straight ahead
    grid = occupancy_grid([(Pose(), open_hall(ranges))], CELL)
    x, y = centres(grid)
    ahead = (x > 2.0)[None, :] & (np.abs(y) < 2 * CELL)[:, None]
    assert (grid.cells[ahead] == -1).all()


def test_single_untrusted_beams_leave_no_spokes_and_single_misses_no_holes() -> None:
    poses = [Pose(0.1 * k, 0.0, 0.05 * k) for k in range(10)]
    rng = np.random.default_rng(1)
    scans = []
    for pose in poses:
        scan = a_scan(pose)
        ranges = scan.ranges.copy()
        ranges[rng.random(len(ranges)) < 0.01] = np.nan
        ranges[rng.random(len(ranges)) < 0.01] = np.inf
        fields = (scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max)
        scans.append((pose, Scan(0.0, ranges, *fields)))
    grid = occupancy_grid(scans, CELL)
    outside = outside_by(grid)
    assert (grid.cells[outside < -1.5 * CELL] < 19.6).mean() > 0.999
    assert (grid.cells[outside > 1.5 * CELL] == -1).mean() > 0.99


def test_somebody_who_went_away_is_forgotten() -> None:
    person = np.full(720, np.inf)
    person[350:370] = 2.0
    with_person = [(Pose(), open_hall(person.copy()))] * 20
    without = [(Pose(), open_hall(np.full(720, np.inf)))] * 10
    at_person = occupancy_grid(with_person, CELL)
    assert percent_at(at_person, 2.0, 0.0) > 95
    assert percent_at(occupancy_grid(with_person + without, CELL), 2.0, 0.0) < 19


def test_a_cell_that_a_beam_ends_in_is_a_wall_though_others_pass_it() -> None:
    """The lower right corner of a cell three metres ahead; its middle is some beams to the left."""
    ranges = np.full(2880, 5.0)
    x, y = 3.02, -0.024  # from the laser, which is in the middle of its own cell
    ranges[1440] = math.hypot(x, y)
    scan = replace(open_hall(ranges), angle_min=-math.pi + math.atan2(y, x))
    middle = Pose(CELL / 2, CELL / 2)
    assert percent_at(occupancy_grid([(middle, scan)], CELL), middle.x + x, middle.y + y) > 65


def percent_at(grid: OccupancyGrid, x: float, y: float) -> int:
    column = math.floor((x - grid.origin[0]) / grid.resolution_m)
    row = math.floor((y - grid.origin[1]) / grid.resolution_m)
    return int(grid.cells[row, column])


def test_a_thousand_scans_of_one_place_do_not_overflow() -> None:
    scans = [(POSES[0], a_scan(POSES[0], beams=360))] * 1000
    grid = occupancy_grid(scans, CELL)
    assert percent_at(grid, 0.0, 0.0) == 0
    assert percent_at(grid, ROOM[2], 0.0) == 100


def test_a_clockwise_laser_draws_the_same_room() -> None:
    scans = []
    for pose in POSES:
        scan = a_scan(pose)
        mirrored = scan.ranges[::-1].copy()
        last = scan.angle_min + scan.angle_increment * (len(mirrored) - 1)
        scans.append((pose, Scan(0.0, mirrored, last, -scan.angle_increment, 0.02, 30.0)))
    check_room(occupancy_grid(scans, CELL))


@pytest.mark.parametrize("ranges", [[], [np.full(360, np.nan)]])
def test_without_a_trusted_beam_all_is_unknown(ranges: list[Array]) -> None:
    grid = occupancy_grid([(Pose(), open_hall(values)) for values in ranges], CELL)
    assert (grid.cells == -1).all()
    assert grid.cells.dtype == np.int8
    assert grid.seen_s is not None  # or the record of an earlier run would stay beside the map
    assert np.isinf(grid.seen_s).all()


def trinary(directory: Path) -> tuple[NDArray[np.int_], tuple[float, ...], float]:
    """What map_server makes of the files: -1, 0, 100 (row 0 at the bottom), origin, resolution."""
    meta = yaml.safe_load((directory / "map.yaml").read_text())
    with Image.open(directory / meta["image"]) as image:
        assert image.mode == "L"
        levels = np.asarray(image)
    assert set(np.unique(levels)) <= {0, 205, 254}
    assert meta["negate"] == 0
    occupied = (255 - levels.astype(float)) / 255
    cells = np.full(levels.shape, -1)
    cells[occupied > meta["occupied_thresh"]] = 100
    cells[occupied < meta["free_thresh"]] = 0
    return cells[::-1], tuple(meta["origin"]), meta["resolution"]


def test_map_server_loads_what_was_written(tmp_path: Path) -> None:
    percent = np.array([[-1, 0, 19], [50, 66, 100]], np.int8)
    write_files(tmp_path, encode_map_server(OccupancyGrid(percent, 0.05, (-1.25, 2.5))))
    cells, origin, resolution = trinary(tmp_path)
    assert cells.tolist() == [[-1, 0, 0], [-1, 100, 100]]
    assert origin == (-1.25, 2.5, 0.0)
    assert resolution == 0.05


def test_the_first_row_of_the_image_is_the_top() -> None:
    grid = OccupancyGrid(np.array([[0, 0], [100, -1]], np.int8), 0.1, (0.0, 0.0))
    image = encode_map_server(grid)["map.pgm"]
    assert image == b"P5\n2 2\n255\n" + bytes([0, 205, 254, 254])


def test_every_cell_knows_which_scan_saw_it_first() -> None:
    places = [Pose(0.0, 0.0, 0.0), Pose(2.0, 0.0, 0.0), Pose(0.5, 0.0, 0.0)]
    stamps = [100.0, 104.0, 109.0]
    ranges = np.full(720, 3.0)
    scans = [
        (pose, Scan(stamp, ranges, -math.pi, math.tau / 720, 0.02, 5.6))
        for pose, stamp in zip(places, stamps, strict=True)
    ]
    grid = occupancy_grid(scans, CELL)
    assert grid.seen_s is not None
    x, y = centres(grid)
    first = np.hypot(x[None, :], y[:, None])
    second = np.hypot(x[None, :] - 2.0, y[:, None])
    third = np.hypot(x[None, :] - 0.5, y[:, None])
    assert (grid.seen_s[first < 2.85] == 0.0).all()
    assert (grid.seen_s[(second < 2.85) & (first > 3.15)] == 4.0).all()
    assert (grid.seen_s[(third < 2.85) & (first > 3.15) & (second > 3.15)] == 9.0).all()
    nowhere = np.minimum(np.minimum(first, second), third) > 3.15
    assert nowhere.any()
    assert np.isinf(grid.seen_s[nowhere]).all()
    later = occupancy_grid(scans, CELL, began=105.0).seen_s  # with a map that was lent
    assert later is not None
    assert np.unique(later).tolist() == [0.0, 4.0, math.inf]


def test_a_grid_that_was_written_can_be_read(tmp_path: Path) -> None:
    percent = np.array([[0, 50, 100], [-1, 0, 100]], np.int8)
    seen_s = np.array([[0.0, 3.7, 90000.0], [np.inf, 65534.0, 12.2]], np.float32)
    write_files(tmp_path, encode_map_server(OccupancyGrid(percent, 0.05, (-1.25, 2.5), seen_s)))
    grid = read_map_server(tmp_path)
    assert grid.cells.tolist() == [[0, -1, 100], [-1, 0, 100]]
    assert (grid.resolution_m, grid.origin) == (0.05, (-1.25, 2.5))
    assert grid.seen_s is not None
    assert grid.seen_s.tolist() == [[0.0, 3.0, 65534.0], [math.inf, 65534.0, 12.0]]


def test_greys_drawn_by_hand_count_as_map_server_takes_them(tmp_path: Path) -> None:
    write_files(
        tmp_path, encode_map_server(OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, (0.0, 0.0)))
    )
    (tmp_path / "map.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([255, 206, 205, 90, 89, 20]))
    assert read_map_server(tmp_path).cells.tolist() == [[-1, 100, 100], [0, 0, -1]]


def test_a_grid_without_a_record_of_what_was_seen_can_be_read(tmp_path: Path) -> None:
    write_files(
        tmp_path, encode_map_server(OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, (0.0, 0.0)))
    )
    assert read_map_server(tmp_path).seen_s is None


def test_a_grid_as_large_as_pil_warns_of_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen_s = np.zeros((2, 3), np.float32)
    grid = OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, (0.0, 0.0), seen_s)
    write_files(tmp_path, encode_map_server(grid))
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 4)
    assert read_map_server(tmp_path).cells.shape == (2, 3)


def test_powers_of_ten_without_a_point_are_numbers(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, (0.0, 0.0))
    write_files(tmp_path, encode_map_server(grid))
    (tmp_path / "map.yaml").write_text("resolution: 5e-2\norigin: [-1e-05, 2E0, 0]\n")
    read = read_map_server(tmp_path)
    assert (read.resolution_m, read.origin) == (0.05, (-1e-05, 2.0))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("map.yaml", b"resolution: 0.05"),
        ("map.yaml", b"resolution: 2001-99-99\norigin: [0, 0, 0]"),
        ("map.yaml", b"resolution: .inf\norigin: [0, 0, 0]"),
        ("map.yaml", b"resolution: 0.05\norigin: [.nan, 0, 0]"),
        ("map.yaml", b"resolution: " + b"[" * 1000),
        ("map.yaml", b"resolution: -1\norigin: [0, 0, 0]"),
        ("map.yaml", b"resolution: 1e-300\norigin: [0, 0, 0]"),
        ("map.yaml", b"resolution: 1e300\norigin: [0, 0, 0]"),
        ("map.yaml", b"resolution: 0.05\norigin: [0, -1e300, 0]"),
        ("map.yaml", b"[}"),
        ("map.yaml", b"\xff\xfe\x00"),
        ("map.pgm", b"P5\n3 2\n255\n"),
        ("map.pgm", b""),
        ("map.pgm", b"P6\n1 1\n255\nabc"),
        ("seen.png", b"no image"),
    ],
)
def test_a_damaged_grid_is_a_usage_error_in_one_line(
    tmp_path: Path, name: str, content: bytes
) -> None:
    seen_s = np.zeros((2, 3), np.float32)
    write_files(
        tmp_path,
        encode_map_server(OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, (0.0, 0.0), seen_s)),
    )
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UsageError, match=name) as caught:
        read_map_server(tmp_path)
    assert "\n" not in str(caught.value)


def test_an_image_of_when_that_is_of_another_map_is_a_usage_error(tmp_path: Path) -> None:
    cells, seen_s = np.zeros((2, 3), np.int8), np.zeros((2, 3), np.float32)
    other = OccupancyGrid(cells.T.copy(), 0.05, (0.0, 0.0), seen_s.T.copy())
    write_files(tmp_path, encode_map_server(OccupancyGrid(cells, 0.05, (0.0, 0.0), seen_s)))
    write_files(tmp_path, {"seen.png": encode_map_server(other)["seen.png"]})
    with pytest.raises(UsageError, match=r"seen.png is not as large as map.pgm"):
        read_map_server(tmp_path)


def test_the_middle_of_a_cell_is_half_a_cell_from_its_corner() -> None:
    grid = OccupancyGrid(np.array([[0, 0, 100], [0, -1, 0]], np.int8), 0.5, (-1.0, 2.0))
    np.testing.assert_allclose(grid.middles(grid.cells > 0), [[0.25, 2.25]])
    np.testing.assert_allclose(grid.middles(grid.cells < 0), [[-0.25, 2.75]])
