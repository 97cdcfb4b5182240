"""Gaps in what a robot has seen of buildings of known walls."""

import asyncio
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.ending import Surveyed
from gvgbot.autonomy.localisation import Localisation
from gvgbot.autonomy.newcomers import Newcomers, NewcomersConfig
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph
from gvgbot.autonomy.virtual_walls import points_of
from gvgbot.beside_loop import BesideLoop
from gvgbot.config import load_config
from gvgbot.drivers.world import World
from gvgbot.geometry import STANDSTILL, Array, Pose
from gvgbot.hal.messages import Odometry
from gvgbot.hal.packed_scan import PackedScan
from gvgbot.survey import survey
from gvgbot.worlds.canvas import Canvas
from tests.unit.autonomy.graphs import STREET, streets
from tests.unit.autonomy.sights import CELL, LASER_270, carved, sweep
from tests.unit.autonomy.test_mission import Last

START = Pose(-3.0, 0.0, 0.0)  # in the world; the map begins there
CORRIDOR, SIDE = (-4.0, -1.0, 4.0, 1.0), (2.0, -1.0, 4.0, 4.0)


def driven(
    world: World,
    metres: float,
    localisation: Localisation = "full",
    every_s: float = 0.1,
    newcomers: NewcomersConfig | None = None,
) -> Pipeline:
    """A robot after so long a drive straight on, with a look every 0.25 m."""
    config = load_config()
    pipeline = Pipeline(
        config.autonomy, config.exploration, config.robot.radius_m, localisation=localisation
    )
    if newcomers is not None:
        pipeline.traffic.newcomers = Newcomers(newcomers)
    for step, x in enumerate(np.arange(0.0, metres + 0.01, 0.25)):
        odom_base = Pose(float(x), 0.0, 0.0)
        pipeline.control(Odometry(every_s * step, odom_base, STANDSTILL))
        pipeline.perceive(replace(sweep(world, START.compose(odom_base)), stamp=every_s * step))
    return pipeline


def places_after(world: World, metres: float) -> Array:
    """What a survey finds (N, 2), world frame, after so long a drive straight on."""
    return START.transform(survey(driven(world, metres)).places)


def test_nothing_is_missing_of_what_can_be_seen_from_one_end() -> None:
    assert len(places_after(carved([CORRIDOR]), 1.0)) == 0


@pytest.mark.parametrize(("metres", "is_walled"), [(3.0, True), (31.0, False)])
def test_whether_a_wall_is_in_sight_is_told_of_where_no_edge_is(
    metres: float, *, is_walled: bool
) -> None:
    surveyed = survey(driven(carved([(-metres, -metres, metres, metres)]), 0.0))
    assert surveyed.is_walled == is_walled
    assert len(surveyed.places) == 0


def test_what_lies_in_the_shadow_of_a_corner_is_a_gap_until_the_robot_looks_round_it() -> None:
    """Seen from the origin, the shadow begins between (2, 1) and (4, 2): halfway at (3, 1.5)."""
    building = carved([CORRIDOR, SIDE])
    surveyed = survey(driven(building, 3.0))
    (place,) = START.transform(surveyed.places)
    assert place == pytest.approx([3.0, 1.5], abs=0.3)
    assert not surveyed.is_whole
    surveyed = survey(driven(building, 7.0))
    assert len(surveyed.places) == 0
    assert surveyed.is_whole


@pytest.mark.parametrize(("x", "is_left"), [(3.0, False), (30.0, True)])
def test_a_gap_is_left_to_who_drives_by_it(x: float, *, is_left: bool) -> None:
    """Another robot of a team has come down the side corridor at x = 3, or is somewhere else."""
    pipeline = driven(carved([CORRIDOR, SIDE]), 3.0)
    pipeline.mission.choice.sharing = others = Last()
    others.known_to_others = [START.inverse().transform(np.array([(x, 6.0), (x, 1.0)]))]
    assert len(survey(pipeline).places) == int(is_left)


def test_the_blurred_grid_of_who_drives_by_odometry_alone_lacks_nothing() -> None:
    """A map that has edges is taken as it is; before that, floor that is unseen counts."""
    pipeline = driven(carved([CORRIDOR, SIDE]), 3.0, "paper")
    assert len(survey(pipeline).places) > 0
    pipeline.mapper.graph = streets(2, 1)[0]
    pipeline.mapper.belief = Belief(np.zeros(9), np.zeros((9, 9)), (1, 2))
    assert len(survey(pipeline).places) == 0


def test_a_door_that_the_robot_leaves_alone_is_told_of() -> None:
    """42 cm wide, in the northern wall at x = 1.5; the robot wants 46."""
    door, room = (1.29, 0.9, 1.71, 1.6), (-1.0, 1.5, 4.0, 4.0)
    found = survey(driven(carved([CORRIDOR, door, room]), 6.0))
    assert START.transform(found.narrows) == pytest.approx(np.array([[1.5, 1.25]]), abs=0.2)
    assert START.transform(found.doorsteps) == pytest.approx(np.array([[1.5, 0.75]]), abs=0.2)
    closed = survey(driven(carved([CORRIDOR, room]), 6.0))
    assert len(closed.narrows) == len(closed.doorsteps) == 0


@pytest.mark.parametrize(("came_after_s", "count"), [(2.0, 0), (60.0, 1)])
def test_who_makes_the_end_of_an_edge_is_awaited_until_he_was_in_sight_for_long(
    came_after_s: float, count: int
) -> None:
    """In a corridor of 1.1 m, which goes on behind him: 0.3 m beside him are too narrow."""
    canvas = Canvas(10.0, 3.0, CELL)
    canvas.carve(0.5, 0.95, 9.5, 2.05)
    canvas.build_disc(7.0, 1.5, 0.25)
    world = replace(canvas.world("corridor"), origin=(-5.0, -1.5))
    patience = NewcomersConfig(found_after_s=2.0, came_after_s=came_after_s)
    pipeline = driven(world, 3.5, every_s=1.0, newcomers=patience)
    (body,) = START.transform(np.array(pipeline.traffic.lasting))
    assert body == pytest.approx([2.0, 0.0], abs=0.1)
    found = survey(pipeline)
    assert START.transform(found.awaited) == pytest.approx(np.array([body] * count).reshape(-1, 2))
    before = np.array([[1.4, 0.0]] * count).reshape(-1, 2)
    assert START.transform(found.doorsteps) == pytest.approx(before, abs=0.4)


def with_ring(pipeline: Pipeline, side: float = 1.0) -> GvgGraph:
    """The robot's graph, from now on a square of edges about (1.5, 0), so many metres wide.

    Their lines end before the vertices.
    """
    graph, ids = streets(2, 2)
    for edge in graph.edges.values():
        edge.polyline = side * edge.polyline[-1] / STREET * np.array([[0.1], [0.9]])
    x = np.array([(1.5 + side * (i - 0.5), side * (j - 0.5), 0.0) for i, j in ids]).ravel()
    pipeline.mapper.graph, pipeline.mapper.observations = graph, []
    pipeline.mapper.belief = Belief(np.append(np.zeros(3), x), 1e-6 * np.eye(15), (*ids.values(),))
    return graph


def test_an_edge_leads_to_its_vertices_however_odometry_has_bent_its_line() -> None:
    """Along the middle of the corridor, which is two metres wide."""
    pipeline = driven(carved([CORRIDOR]), 6.0)
    graph, ids = streets(2, 1)
    (edge,) = graph.edges.values()
    edge.length, edge.polyline = 7.0, np.array([(0.0, 0.0), (7.0, 2.5)])
    pipeline.mapper.graph, pipeline.mapper.observations = graph, []
    x = np.array([0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 6.5, 0.0, 0.0])
    pipeline.mapper.belief = Belief(x, 1e-6 * np.eye(9), tuple(ids.values()))
    assert survey(pipeline).is_whole
    pipeline.sight.virtual_walls = points_of([((90.0, 0.0), (90.0, 1.0))])
    assert not survey(pipeline).is_whole  # what is beyond is a part of the building, too


def test_edges_round_nothing_are_looked_at_again() -> None:
    """Round somebody who has gone. What the robot has felt may be out of sight."""
    pipeline = driven(carved([CORRIDOR]), 3.0)
    graph = with_ring(pipeline)
    places = set(map(tuple, survey(pipeline).places.tolist()))
    felt_at = pipeline.mapper.map_in_local(Pose(3.0, 0.0)).transform(np.array([1.3, 0.0]))
    pipeline.sight.hazards.add(Pose(*felt_at.tolist()), (0.0,), 0.18, 0.0, lasting=True)
    (place,) = places - set(map(tuple, survey(pipeline).places.tolist()))
    assert place == pytest.approx([1.5, 0.0], abs=0.3)
    graph.unjoin(next(iter(graph.edges.values())))
    (place,) = places - set(map(tuple, survey(pipeline).places.tolist()))
    assert place == pytest.approx([1.5, 0.0], abs=0.3)


def test_what_a_ring_goes_round_is_looked_at_from_there() -> None:
    hall, post = (-4.0, -3.0, 4.0, 3.0), (-1.62, -0.12, -1.38, 0.12)
    pipeline = driven(carved([hall], [post]), 0.5)
    with_ring(pipeline, 2.0)
    (place,) = survey(pipeline).doorsteps
    assert np.abs(place - [1.5, 0.0]).max() == pytest.approx(1.0, abs=0.3)


def test_floor_in_sight_from_a_slot_is_missing_though_no_edge_leads_there() -> None:
    """All that is known is an edge in the slot, where the robot has less room than it wants."""
    pipeline = driven(carved([(-3.4, -0.23, -2.0, 0.23), (-2.0, -3.0, 3.0, 3.0)]), 0.0)
    graph, _ = streets(2, 1)
    (edge,) = graph.edges.values()
    edge.length, edge.polyline = 0.2, 0.02 * edge.polyline
    pipeline.mapper.graph = graph
    pipeline.mapper.belief = Belief(np.zeros(9), np.zeros((9, 9)), (1, 2))
    found = survey(pipeline)
    assert found.is_beside_floor
    assert (START.transform(found.places)[:, 0] > -2.0).all()


def test_nothing_is_missing_beyond_a_virtual_wall() -> None:
    """One before the shadow of the corner, from wall to wall."""
    pipeline = driven(carved([CORRIDOR, SIDE]), 3.0)
    before = START.inverse().transform(np.array([(1.8, 1.0), (4.2, 1.0)]))
    pipeline.sight.virtual_walls = points_of([tuple((x, y) for x, y in before.tolist())])
    assert len(survey(pipeline).places) == 0


def driven_past_a_post(seconds: float) -> Pipeline:
    """A robot whose drive past a post at (-1.5, 0.6) took so long; now that is out of sight.

    The post is round: edges would tell it from somebody.
    """
    canvas = Canvas(10.0, 6.0, CELL)
    canvas.carve(1.0, 3.0, 9.0, 5.0)
    canvas.carve(5.0, 1.0, 6.5, 4.0)
    canvas.build_disc(3.5, 4.6, 0.12)
    world = replace(canvas.world("post"), origin=(-5.0, -4.0))
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    way = np.arange(0.0, 5.6, 0.25)
    for stamp, x in zip(np.linspace(0.0, seconds, len(way)).tolist(), way.tolist(), strict=True):
        odom_base = Pose(x, 0.0, 0.0)
        pipeline.control(Odometry(stamp, odom_base, STANDSTILL))
        scan = sweep(world, START.compose(odom_base), field_of_view=LASER_270)
        pipeline.perceive(replace(scan, stamp=stamp))
    return pipeline


def test_a_post_that_was_passed_before_anybody_knew_that_it_is_one_is_looked_at_again() -> None:
    """It was in sight for a quarter of the way."""
    assert not driven_past_a_post(300.0).traffic.passed
    pipeline = driven_past_a_post(15.0)
    places = set(map(tuple, survey(pipeline).places.tolist()))
    assert len(pipeline.traffic.passed) == 1
    pipeline.traffic.passed = []
    (place,) = places - set(map(tuple, survey(pipeline).places.tolist()))
    assert START.transform(np.array(place)) == pytest.approx([-1.5, 0.6], abs=2.0)


@pytest.mark.parametrize(("came_after_s", "count"), [(15.0, 0), (25.0, 1)])
def test_what_a_ring_goes_round_is_nobody_once_it_was_in_sight_for_long(
    came_after_s: float, count: int
) -> None:
    """A box of 0.4 m beside the way, in sight for 20 s; what stands for longer is a wall."""
    world = carved([CORRIDOR], [(-1.2, 0.3, -0.8, 0.7)])
    patience = NewcomersConfig(came_after_s=came_after_s, found_after_s=5.0)
    pipeline = driven(world, 3.0, every_s=1.6)
    pipeline.traffic.newcomers = Newcomers(patience)
    graph, ids = streets(2, 1)
    (edge,) = graph.edges.values()
    edge.polyline = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.8), (0.0, 0.8), (0.0, 0.0)])
    pipeline.mapper.graph, pipeline.mapper.observations = graph, []
    x = np.array([0.0, 0.0, 0.0, 1.5, 0.1, 0.0, 1.5, 0.1, 0.0])
    pipeline.mapper.belief = Belief(x, 1e-6 * np.eye(9), tuple(ids.values()))
    assert len(survey(pipeline).doorsteps) == count


@pytest.mark.parametrize(
    ("seen_later", "street", "start", "end"),
    [
        # ten metres north from the middle of the corridor; from the east seen through glass
        (carved([CORRIDOR, (-2.5, 0.9, -0.5, 4.0)]), (1, 2), (1.5, 0.0), (1.5, 10.0)),
        # along the corridor, close to what is seen from the east only, as if across the way
        (carved([CORRIDOR], [(0.98, 0.48, 1.02, 0.52)]), (2, 1), (1.0, 0.0), (11.0, 0.0)),
    ],
)
def test_an_edge_through_what_may_be_glass_or_past_it_is_told_of_unless_it_was_driven(
    seen_later: World,
    street: tuple[int, int],
    start: tuple[float, float],
    end: tuple[float, float],
) -> None:
    pipeline = driven(carved([CORRIDOR]), 6.0)
    keyframes = pipeline.past.keyframes
    for at, keyframe in enumerate(keyframes):
        if keyframe.scan is not None and at > 9:
            scan = sweep(seen_later, START.compose(keyframe.odom_base))
            packed = PackedScan(replace(scan, stamp=keyframe.stamp))
            keyframes[at] = replace(keyframe, scan=packed)
    graph, ids = streets(*street)
    (edge,) = graph.edges.values()
    pipeline.mapper.graph, pipeline.mapper.observations = graph, []
    x = np.array([0.0, 0.0, 0.0, *start, 0.0, *end, 0.0])
    pipeline.mapper.belief = Belief(x, 1e-6 * np.eye(9), tuple(ids.values()))
    assert survey(pipeline).barred == ()
    edge.driven, edge.traversals = False, 0
    assert survey(pipeline).barred == (edge.id,)


def test_a_daemon_makes_its_survey_off_the_loop_and_forgets_it_when_the_robot_drives_on() -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    in_background = BesideLoop(pipeline, survey)
    done: list[float] = []

    async def off_loop(function: Callable[[], None]) -> None:
        await asyncio.sleep(0.0)
        function()
        done.append(pipeline.past.travelled)

    async def until_there_is_something() -> Surveyed | None:
        for _ in range(10):
            await asyncio.sleep(0.0)
        return in_background.newest()

    async def story() -> None:
        async with asyncio.TaskGroup() as tasks:
            making = tasks.create_task(in_background.work(off_loop))
            assert in_background.newest() is None
            found = await until_there_is_something()
            assert found is not None
            assert len(found.places) == 0
            assert in_background.newest() is None
            pipeline.past.travelled = 5.0
            assert await until_there_is_something() is None  # it was made elsewhere
            assert await until_there_is_something() is not None
            making.cancel()

    asyncio.run(story())
    assert done == [0.0, 5.0, 5.0]
