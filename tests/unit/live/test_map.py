"""Grid and trajectory as they grow on the network, held against the maps that they are parts of."""

import math
import zlib
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.geometry import Pose, anchored
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import PackedScan
from gvgbot.live.grid import LiveGrid
from gvgbot.live.map import Stretch, Trail, bent
from gvgbot.maps.occupancy import occupancy_grid
from gvgbot.tiles import Grid, Raster
from gvgbot.topics import TRAJECTORY_POSES


def keyframe(x: float, y: float, reach: float = 3.0) -> Keyframe:
    """A look around in a round room."""
    angles = np.linspace(-math.pi, math.pi, 721)[:-1]
    here = Pose(x, y, 0.3)
    scan = Scan(x, np.full(angles.shape, reach), angles[0], angles[1] - angles[0], 0.1, 30.0)
    return Keyframe(x, here, here, here, PackedScan(scan))


DRIVE = [keyframe(0.5 * i, -0.3 * i) for i in range(20)]


def sent(drive: list[Keyframe]) -> Iterator[tuple[Grid, Grid]]:
    """What changes with each keyframe, and the whole."""
    live = LiveGrid(began=7.0)
    for one in drive:
        live.add([one])
        while (changed := live.changes(one.stamp)) is not None:
            yield changed, live.whole(one.stamp)


def merged(grids: list[Grid]) -> Grid:
    tiles = {(tile.row, tile.column): tile for grid in grids for tile in grid.tiles}
    return msgspec.structs.replace(grids[-1], tiles=tuple(tiles.values()))


def percent_at(raster: Raster, points: NDArray[np.float64]) -> list[int]:
    at = np.floor((points - raster.origin) / raster.resolution).astype(int)
    found: list[int] = raster.cells[at[:, 1], at[:, 0]].tolist()
    return found


@pytest.mark.parametrize("reach", [3.0, 7.9])
def test_what_has_changed_adds_up_to_the_grid_of_all_scans(reach: float) -> None:
    drive = [keyframe(0.5 * i, -0.3 * i, reach) for i in range(20)]
    changes, wholes = zip(*sent(drive), strict=True)
    scans = [(one.map_base, one.scan) for one in drive if one.scan is not None]
    made = occupancy_grid(scans, 0.05, 8.0)
    rows, columns = np.nonzero(made.cells >= 0)
    points = np.column_stack([columns + 0.5, rows + 0.5]) * 0.05 + made.origin
    expected = made.cells[rows, columns].tolist()
    assert percent_at(merged(list(changes)).raster(), points) == expected
    assert percent_at(wholes[-1].raster(), points) == expected
    assert np.count_nonzero(wholes[-1].raster().cells >= 0) == len(rows)
    assert [grid.number for grid in changes] == list(range(1, len(changes) + 1))
    assert {grid.began for grid in changes} == {7.0}


def test_only_what_has_changed_is_sent() -> None:
    live = LiveGrid(began=0.0)
    live.add(DRIVE)
    everything = live.changes(1.0)
    assert live.changes(2.0) is None
    live.add([keyframe(9.5, -5.7, reach=0.4)])  # sees no farther than the tiles around it
    changed = live.changes(3.0)
    assert everything is not None
    assert changed is not None
    assert 1 <= len(changed.tiles) <= 4
    assert len(everything.tiles) > 8


def test_a_large_map_is_sent_in_messages_of_bounded_size() -> None:
    far = [keyframe(40.0 * i, 40.0 * j) for i in range(5) for j in range(5)]
    live = LiveGrid(began=0.0)
    live.add(far)
    first = live.changes(1.0)
    assert first is not None
    assert len(first.tiles) == 128
    assert live.has_more
    rest = list(iter(lambda: live.changes(1.0), None))
    assert live.changes(1.0) is None
    assert len(merged([first, *rest]).tiles) == len(live.whole(1.0).tiles) > 128


def test_after_a_correction_the_tiles_add_up_to_the_grid_of_the_corrected_scans() -> None:
    astray = [keyframe(-3.0 - 0.5 * i, 2.0) for i in range(20)]
    live = LiveGrid(began=0.0)
    live.add(astray)
    first = live.changes(1.0)
    live.redraw(DRIVE)
    rest = list(iter(lambda: live.changes(2.0), None))
    assert first is not None
    right = LiveGrid(began=0.0)
    right.add(DRIVE)
    expected = right.changes(1.0)
    assert expected is not None
    for shown in (merged([first, *rest]), live.whole(2.0)):
        known = {(t.row, t.column): t.cells for t in shown.tiles}
        for tile in expected.tiles:
            assert known.pop((tile.row, tile.column)) == tile.cells
        assert all(set(zlib.decompress(cells)) == {255} for cells in known.values())  # unknown
        assert len(known) > 5


def test_a_trajectory_keeps_its_ends_and_its_shape_however_long_it_gets() -> None:
    trail, here = Trail(), Pose()
    for i in range(30_000):  # 7.5 km around a circle of 50 m
        angle = i * 0.25 / 50.0
        here = Pose(50.0 * math.cos(angle), 50.0 * math.sin(angle), angle)
        trail.add([Keyframe(float(i), here, here, here, None)])
    told = trail.told(30_000.0)
    assert len(told.times) == len(told.map_base) <= TRAJECTORY_POSES
    assert len(told.times) > TRAJECTORY_POSES / 3
    assert told.times[0] == 0.0
    assert (np.diff(told.times) > 0.0).all()
    x, y, theta = told.map_base.T.astype(float)
    assert np.hypot(x, y) == pytest.approx(50.0, abs=1e-3)
    assert theta == pytest.approx(told.times * 0.25 / 50.0, abs=1e-3)
    steps = np.hypot(np.diff(x), np.diff(y))
    assert steps.max() < 2.2 * steps.min()
    assert math.dist((x[-1], y[-1]), (here.x, here.y)) < 2 * steps.max()


def test_where_the_robot_was_carried_the_way_is_broken_however_long_it_gets() -> None:
    trail, row = Trail(), [Pose(0.25 * i) for i in range(6000)]
    for there in (Pose(), Pose(0.0, 5.0), Pose(0.0, 10.0)):
        poses = [there.compose(pose) for pose in row]
        trail.add([Keyframe(0.0, p, p, p, None) for p in poses], {0} if there.y else ())
    told = trail.told(0.0)
    assert len(told.map_base) <= TRAJECTORY_POSES
    assert [set(line[:, 1].tolist()) for line in told.stretches] == [{0.0}, {5.0}, {10.0}]
    assert [line[0, 0] for line in told.stretches] == [0.0, 0.0, 0.0]


def test_standing_makes_a_trajectory_no_longer() -> None:
    trail, here = Trail(), Pose(1.0, 2.0, 0.5)
    still = Keyframe(1.0, here, here, here, None)
    assert trail.add([still])
    assert not trail.add([still])
    assert trail.told(2.0).map_base.tolist() == [[1.0, 2.0, 0.5]]


def test_edges_are_turned_with_their_vertex_and_bent_to_end_on_the_other() -> None:
    poses = {1: Pose(1.0, 2.0, math.pi / 2), 2: Pose(1.0, 6.0, 0.3), 3: Pose(1.0, 2.5, 0.0)}
    line = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0], [4.0, 0.0]])
    fits = Stretch(1, 2, line)  # four metres ahead of 1, which looks north: there is 2
    short = Stretch(3, 2, np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]))  # from 3.5 to 5.5
    edges = bent([fits, short], poses)
    assert [(edge.start, edge.end) for edge in edges] == [(1, 2), (3, 2)]
    assert [edge.length for edge in edges] == pytest.approx([2.0 + 2.0 * math.hypot(0.5, 1.0), 3.5])
    expected = [[1.0, 2.0], [0.5, 3.0], [1.0, 4.0], [1.0, 6.0]]
    assert edges[0].polyline == pytest.approx(np.array(expected), abs=1e-6)
    moved = [[1.0, 2.5], [1.0, 4.25], [1.0, 6.0]]  # by -1 at the start, +0.5 at the end
    assert edges[1].polyline == pytest.approx(np.array(moved), abs=1e-6)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_edges_are_bent_at_once_as_they_would_be_one_by_one(seed: int, counts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    poses = {number: Pose(*rng.uniform(-9.0, 9.0, 3).tolist()) for number in range(4)}
    edges = [
        Stretch(int(start), int(end), rng.uniform(-5.0, 5.0, (count, 2)))
        for (start, end), count in zip(rng.integers(0, 4, (len(counts), 2)), counts, strict=True)
    ]
    for edge, told in zip(edges, bent(edges, poses), strict=True):
        line = poses[edge.start].transform(edge.points)
        expected = anchored(line, poses[edge.start].position, poses[edge.end].position)
        assert told.polyline == pytest.approx(expected, abs=1e-5)


def test_a_map_without_edges_has_none() -> None:
    assert bent([], {}) == ()
