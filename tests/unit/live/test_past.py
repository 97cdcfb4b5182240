"""What is drawn of the past, after a drive around a circle that odometry turned into a spiral."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gvgbot.autonomy.keyframes import Keyframe, Past, Step
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.views import Observation
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.live.map import LiveMap
from gvgbot.live.past import TOLERANCE_M, LivePast
from gvgbot.tiles import Grid
from gvgbot.topics import Map, Trajectory

COUNT, RADIUS_M = 101, 8.0
WRONG_TURN = 0.004  # rad at each step
TURN = math.tau / (COUNT - 1)
TRUE = [
    Pose(RADIUS_M * math.sin(a), RADIUS_M * (1.0 - math.cos(a)), a)
    for a in (TURN * np.arange(COUNT)).tolist()
]
VERTEX = Pose(1.0, 0.0)


FORBIDDEN = np.array([[1.0, 2.0], [1.0, 2.5]])  # points of a virtual wall


def drive(*, closes: bool = True, led: bool = False) -> Any:
    """A pipeline after one turn; it saw a vertex at the start, and again at the end if it closes.

    What it believes is odometry alone.
    """
    wrong = Pose(theta=WRONG_TURN)
    motions = [a.to(b).compose(wrong) for a, b in pairwise(TRUE)]
    poses = [Pose()]
    for motion in motions:
        poses.append(poses[-1].compose(motion))
    seen = [Observation(0, 1, VERTEX, 1e-4 * np.eye(3))]
    if closes:
        at = COUNT - 1
        seen.append(Observation(at, 1, TRUE[at].to(VERTEX), 1e-4 * np.eye(3)))
    belief = Belief(np.array([0.0, 0.0, 0.0, VERTEX.x, VERTEX.y, 0.0]), np.eye(6), (1,))
    noise = np.diag([1e-6, 1e-6, (10 * WRONG_TURN) ** 2])
    past = Past()
    past.keyframes = [Keyframe(float(i), p, p, p, None) for i, p in enumerate(poses)]
    past.steps = [Step(motion, noise) for motion in motions]
    return SimpleNamespace(
        past=past,
        mapper=SimpleNamespace(graph=GvgGraph(), belief=belief, observations=seen),
        led=led,
        matches_walls=False,
        sight=SimpleNamespace(virtual_walls=FORBIDDEN),
    )


def error(poses: list[Pose]) -> float:
    """How far (m) the worst pose is from the truth."""
    return max(a.distance(b) for a, b in zip(poses, TRUE, strict=True))


def taken(past: LivePast, pipeline: Any, stamp: float) -> tuple[list[Pose], bool] | None:
    find = past.update(pipeline, stamp)
    if find is None:
        return None
    keyframes, is_all, *_ = find()
    return [keyframe.map_base for keyframe in keyframes], is_all


def after_the_drive(pipeline: Any) -> LivePast:
    """All has been drawn as it was believed."""
    past, keyframes = LivePast(), pipeline.past.keyframes
    pipeline.past.keyframes = keyframes[:1]
    assert taken(past, pipeline, 0.0) == ([Pose()], False)
    pipeline.past.keyframes = keyframes
    believed = [keyframe.map_base for keyframe in keyframes]
    assert taken(past, pipeline, 1.0) == (believed[1:], False)
    assert error(believed) > 2.0
    return past


def test_each_keyframe_is_drawn_once_as_long_as_nothing_speaks_against_it() -> None:
    pipeline = drive(closes=False)
    past = after_the_drive(pipeline)
    assert taken(past, pipeline, 2.0) is None
    past.doubt()
    assert taken(past, pipeline, 3.0) == ([], False)
    assert taken(past, pipeline, 4.0) is None


def test_all_are_drawn_again_where_they_were_when_a_loop_has_closed() -> None:
    pipeline = drive()
    past = after_the_drive(pipeline)
    past.doubt()
    drawn = taken(past, pipeline, 2.0)
    assert drawn is not None
    poses, is_all = drawn
    assert is_all
    assert error(poses) < 0.1
    past.doubt()
    assert taken(past, pipeline, 1000.0) == ([], False)


def test_what_an_earlier_life_has_left_is_drawn_where_it_was() -> None:
    drawn = taken(LivePast(), drive(), 0.0)
    assert drawn is not None
    assert error(drawn[0]) < 0.1


@pytest.mark.parametrize(("at_last", "stamp"), [(False, 60.0), (True, 2.1)])
def test_there_is_a_rest_after_drawing_all(at_last: bool, stamp: float) -> None:
    """Not when there is no later."""
    pipeline = drive()
    past = after_the_drive(pipeline)
    past.doubt()
    taken(past, pipeline, 2.0)
    pipeline.mapper.observations[-1] = Observation(COUNT - 1, 1, Pose(2.0, 0.0), 1e-4 * np.eye(3))
    past.doubt()
    assert taken(past, pipeline, 2.1) is None
    past.doubt(at_last=at_last)
    later = taken(past, pipeline, stamp)
    assert later is not None
    assert later[1]


def test_of_a_way_that_is_not_kept_only_what_is_new_is_drawn() -> None:
    pipeline = drive(closes=False)
    past, last = after_the_drive(pipeline), pipeline.past.keyframes[-1]
    pipeline.past.keyframes[50:] = [last]
    pipeline.past.steps[49:] = [
        Step(pipeline.past.keyframes[49].map_base.to(last.map_base), np.eye(3))
    ]
    assert taken(past, pipeline, 2.0) is None
    pipeline.past.keyframes.append(replace(last, map_base=last.map_base.compose(Pose(0.3))))
    pipeline.past.steps.append(Step(Pose(0.3), np.eye(3)))
    past.doubt()
    assert taken(past, pipeline, 3.0) == ([pipeline.past.keyframes[-1].map_base], False)


def test_where_somebody_else_drives_only_what_is_new_is_drawn() -> None:
    pipeline = drive(led=True)
    assert taken(LivePast(), pipeline, 0.0) == (
        [k.map_base for k in pipeline.past.keyframes],
        False,
    )


def shown(live: LiveMap, pipeline: Any, stamp: float) -> Array:
    """The positions (N, 2) of the trajectory that is sent."""
    draw = live.update(pipeline, stamp)
    assert draw is not None
    (way,) = [one.value for one in draw() if isinstance(one.value, Trajectory)]
    return np.asarray(way.map_base[:, :2], np.float64)


def test_virtual_walls_are_told_with_the_map() -> None:
    draw = LiveMap(began=0.0).update(drive(), 0.0)
    assert draw is not None
    (told,) = [one.value for one in draw() if isinstance(one.value, Map)]
    assert told.forbidden.tolist() == FORBIDDEN.tolist()


def test_the_graph_is_told_with_kinds_and_frontiers_where_they_are_in_the_map() -> None:
    """A vertex of two ways, of which one was followed to a dead end; it is turned by 1 rad."""
    pipeline, ends = drive(), []
    for number, bearings in ((1, (0.25, -2.0)), (2, (3.0,))):
        vertex = Vertex(number, 0.8, Pose(), 0.0, 0.0)
        ends.append([HalfEdgeId(number, vertex.add_half_edge(one)) for one in bearings])
        pipeline.mapper.graph.vertices[number] = vertex
    line = np.array([(0.0, 0.0), (5.0, 0.0)])
    pipeline.mapper.graph.join(ends[0][0], ends[1][0], line, 0.6, driven=True)
    x = np.array([0.0, 0.0, 0.0, 4.0, -2.0, 1.0, 6.7, 2.2, 0.0])
    pipeline.mapper.belief = Belief(x, np.diag(np.arange(9.0)), (1, 2))
    draw = LiveMap(began=0.0).update(pipeline, 0.0)
    assert draw is not None
    (told,) = [one.value for one in draw() if isinstance(one.value, Map)]
    assert [(v.id, v.kind) for v in told.vertices] == [(1, "meetpoint"), (2, "endpoint")]
    assert [v.frontiers for v in told.vertices] == [(pytest.approx(-1.0),), ()]
    assert told.vertices[0].position == (4.0, -2.0)
    assert told.vertices[0].covariance == (3.0, 0.0, 0.0, 4.0)
    assert [(e.start, e.end) for e in told.edges] == [(1, 2)]


def test_of_a_grid_that_is_too_large_for_one_message_the_rest_follows_without_news() -> None:
    """And whoever asks gets all of it, not what has changed last."""
    pipeline, around = drive(led=True), np.full(360, 7.5)
    pipeline.past.keyframes = [
        replace(
            one,
            map_base=Pose(40.0 * i, 0.0),
            scan=Scan(one.stamp, around, -math.pi, math.tau / 360, 0.1, 30.0),
        )
        for i, one in enumerate(pipeline.past.keyframes[:10])
    ]
    live, stamp = LiveMap(began=0.0), 0.0
    told: list[Grid] = []
    asked: Any = None
    while (draw := live.update(pipeline, stamp)) is not None:
        stamp += 1.0
        for update in draw():
            if isinstance(update.value, Grid):
                told.append(update.value)
                asked = update.latest
    assert isinstance(asked, Grid)
    assert len(told) > 1
    tiles = {(tile.row, tile.column) for grid in told for tile in grid.tiles}
    assert {(tile.row, tile.column) for tile in asked.tiles} == tiles
    cells = asked.raster().cells
    assert (cells >= 0).sum() * 0.05**2 == pytest.approx(10 * math.pi * 7.5**2, rel=0.02)


def from_centre(way: Array) -> Array:
    return np.hypot(way[:, 0], way[:, 1] - RADIUS_M)


def test_the_trajectory_that_is_shown_closes_with_the_loop() -> None:
    pipeline, live = drive(), LiveMap(began=0.0)
    keyframes = pipeline.past.keyframes
    pipeline.past.keyframes = keyframes[:1]
    shown(live, pipeline, 0.0)
    pipeline.past.keyframes = keyframes
    assert np.abs(from_centre(shown(live, pipeline, 1.0)) - RADIUS_M).max() > 0.8
    live.doubt()
    way = from_centre(shown(live, pipeline, 2.0))
    assert len(way) > 90
    assert way == pytest.approx(RADIUS_M, abs=2 * TOLERANCE_M)


def test_no_floor_is_shown_any_more_where_it_was_before_the_loop_closed() -> None:
    pipeline, live, reach_m = drive(), LiveMap(began=0.0), 2.0
    ranges = np.full(180, reach_m)
    keyframes = [
        replace(one, scan=Scan(one.stamp, ranges, -math.pi, math.tau / 180, 0.1, 30.0))
        for one in pipeline.past.keyframes
    ]
    farthest = []
    for stamp, known in enumerate((keyframes[:1], keyframes, keyframes)):
        pipeline.past.keyframes = known
        if stamp == 2:
            live.doubt()
        draw = live.update(pipeline, float(stamp))
        assert draw is not None
        (floor,) = [one.latest for one in draw() if isinstance(one.value, Grid)]
        assert isinstance(floor, Grid)
        raster = floor.raster()
        rows, columns = np.nonzero(raster.cells >= 0)
        cells = np.column_stack([columns, rows]).astype(np.float64)
        at: Array = raster.origin + raster.resolution * (cells + 0.5)
        farthest.append(float(np.abs(from_centre(at) - RADIUS_M).max()))
    assert farthest[1] > reach_m + 0.8
    assert farthest[2] < reach_m + 3 * TOLERANCE_M


@pytest.mark.parametrize("at", [0, 30, 60])
@pytest.mark.parametrize("is_corrected", [False, True])
def test_where_another_has_been_that_made_the_map_is_no_way_driven(
    at: int, *, is_corrected: bool
) -> None:
    pipeline, live = drive(), LiveMap(began=0.0)
    keyframes, pipeline.past.lent = pipeline.past.keyframes, 50
    pipeline.past.keyframes = keyframes[:at]
    if at:
        live.update(pipeline, 0.0)()  # type: ignore[misc]  # there is something to do
    pipeline.past.keyframes = keyframes
    if is_corrected:
        live.doubt()
    draw = live.update(pipeline, 200.0)
    assert draw is not None
    (way,) = [one.value for one in draw() if isinstance(one.value, Trajectory)]
    assert way.times.tolist() == list(range(50, COUNT))
    assert len(way.stretches) == 1


@pytest.mark.parametrize("at", [0, 30])
@pytest.mark.parametrize("is_corrected", [False, True])
def test_no_way_leads_to_where_the_robot_was_carried(at: int, *, is_corrected: bool) -> None:
    """It is put down at the far side of the circle, and drives on from there."""
    pipeline, live = drive(), LiveMap(began=0.0)
    keyframes, there = pipeline.past.keyframes, Pose(20.0, 0.0)
    pipeline.past.keyframes = keyframes[:at]
    if at:
        live.update(pipeline, 0.0)()  # type: ignore[misc]  # there is something to do
    for i in range(50, COUNT):
        keyframes[i] = replace(keyframes[i], map_base=there.compose(keyframes[i].map_base))
    motion = keyframes[49].map_base.to(keyframes[50].map_base)
    pipeline.past.steps[49] = Step(motion, np.diag([1.0, 1.0, 0.1]))
    pipeline.past.keyframes, pipeline.mapper.observations = keyframes, []
    if is_corrected:
        live.doubt()
    draw = live.update(pipeline, 200.0)
    assert draw is not None
    (way,) = [one.value for one in draw() if isinstance(one.value, Trajectory)]
    assert len(way.breaks) == 1
    before, after = way.stretches
    assert before[-1] == pytest.approx(keyframes[49].map_base.position, abs=0.01)
    assert after[0] == pytest.approx(keyframes[50].map_base.position, abs=0.01)


def test_where_another_map_begins_nothing_is_left_of_the_one_before() -> None:
    pipeline, live = drive(), LiveMap(began=0.0)
    shown(live, pipeline, 0.0)
    here = TRUE[7]
    pipeline.past.keyframes = [Keyframe(200.0, here, here, here, None)]
    pipeline.past.steps, pipeline.mapper.observations = [], []
    assert shown(live, pipeline, 200.0) == pytest.approx(np.array([[here.x, here.y]]))


def test_before_the_first_keyframe_there_is_nothing_to_draw() -> None:
    pipeline = drive()
    pipeline.past.keyframes = []
    assert LivePast().update(pipeline, 0.0) is None
