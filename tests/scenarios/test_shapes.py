"""Shapes of free space that are easily taken for something else, explored to the end."""

import math
from typing import Literal

import numpy as np
import pytest

from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import EdgeJoined
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.config import TwinConfig
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.drivers.kobuki.twin_config import KobukiTwinConfig
from gvgbot.geometry import Pose
from gvgbot.report import route_graph
from gvgbot.worlds.canvas import Canvas
from tests.scenarios.rig import (
    assert_degrees,
    assert_explored,
    assert_found,
    graph_shape,
    play,
)
from tests.unit.autonomy.sights import Rectangle, carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]


SHORT_SIGHTED = TwinConfig(laser=HokuyoTwinConfig(model="URG-04LX"))  # sees 5.6 m


def test_a_field_without_a_wall_in_sight_ends_the_run_with_a_reason() -> None:
    field = Canvas(46.0, 46.0)
    field.carve(1.0, 1.0, 45.0, 45.0)
    run = play(field.world("field"), Pose(23.0, 23.0, 0.0), twin=SHORT_SIGHTED, limit=150.0)
    assert run.outcome == "failed"
    assert "no walls within range" in run.pipeline.mission.reason
    assert run.contacts == 0


def test_a_hall_whose_walls_are_out_of_sight_at_first_is_left_by_its_corridor() -> None:
    rooms = [(-6.0, -6.0, 6.0, 6.0), (-10.0, -0.8, -6.0, 0.8)]
    run = play(
        carved(rooms),
        Pose(),
        twin=SHORT_SIGHTED,
        limit=400.0,
        goes_on=lambda run: run.outcome is None and not run.vertices("endpoint"),
    )
    assert run.contacts == 0
    assert "go where there is more room" in run.recoveries()
    assert_found(run, "endpoint", [(-9.2, 0.0)])


@pytest.mark.parametrize(
    ("twin", "length", "width"),
    [(SHORT_SIGHTED, 16.0, 11.0), (TwinConfig(), 21.5, 16.5)],
    ids=["wider than sight", "wider than the local map"],
)
def test_a_bare_hall_is_driven_round_and_left_alone(
    twin: TwinConfig, length: float, width: float
) -> None:
    """With a look into its corners, at most; all of that is less than twice along its walls."""
    hall: Rectangle = (-length / 2, -width / 2, length / 2, width / 2)
    run = play(carved([hall]), Pose(0.0, -0.5, 0.5), twin=twin, limit=400.0)
    assert_explored(run)
    assert len(run.pipeline.mapper.graph.edges) == 1
    assert run.pipeline.past.travelled < 2 * 2 * (length + width)


def test_a_square_closet_is_explored_without_an_edge() -> None:
    """All corners are as far from its middle: there is nothing to drive along, and no way out."""
    run = play(
        carved([(-0.6, -0.6, 0.6, 0.6)]),
        Pose(-0.2, -0.1, 0.0),
        exploration=ExplorationConfig(look_around_s=0.5),
        limit=60.0,
    )
    assert_explored(run)
    assert graph_shape(run) == (0, 0, 0)


@pytest.mark.parametrize("offset", [0.0, 0.15], ids=["straight", "perturbed"])
def test_a_crossing_is_one_meetpoint_of_four(offset: float) -> None:
    """Arms that face each other, or are a little off: far less than half the robot apart."""
    free: list[Rectangle] = [
        (-2.6, -0.7, 2.6, 0.7),
        (-0.7, 0.0, 0.7, 2.6),
        (-0.7 + offset, -2.6, 0.7 + offset, 0.0),
    ]
    run = play(carved(free), Pose(-1.6, 0.1, 0.2))
    assert_explored(run)
    middle = (offset / 2, 0.0)
    assert_found(run, "meetpoint", [middle])
    assert_degrees(run, {middle: 4})
    assert_found(run, "endpoint", [(-1.9, 0.0), (1.9, 0.0), (0.0, 1.9), (offset, -1.9)])


def test_alcoves_less_deep_than_the_corridor_is_wide_are_no_vertices() -> None:
    niches: list[Rectangle] = [(-1.0, 0.5, 0.0, 1.1), (1.0, -0.9, 1.6, 0.0)]
    run = play(carved([(-3.5, -0.7, 3.5, 0.7), *niches]), Pose(-2.0, 0.0, 0.0))
    assert_explored(run)
    assert graph_shape(run) == (0, 2, 1)


def test_a_pillar_in_a_dead_end_makes_an_edge_from_a_vertex_to_itself() -> None:
    """The corridor comes into the room; around the pillar the robot comes back to the mouth."""
    run = play(
        carved([(-3.0, -0.6, 0.0, 0.6), (0.0, -1.8, 3.6, 1.8)], [(1.3, -0.5, 2.3, 0.5)]),
        Pose(-1.5, 0.0, 0.0),
    )
    assert_explored(run)
    graph = run.pipeline.mapper.graph
    loops = [edge for edge in graph.edges.values() if edge.a.vertex == edge.b.vertex]
    assert len(loops) == 1
    assert graph_shape(run) == (1, 1, 2)


def test_a_ring_is_closed_where_the_robot_came_onto_it() -> None:
    """A metre and more from where it was put down, beside the wall."""
    run = play(
        carved([(-3.5, -3.5, 3.5, 3.5)], [(-0.7, -0.7, 0.7, 0.7)]),
        Pose(-3.2, 0.0, math.pi / 2),
        limit=150.0,
    )
    assert_explored(run)
    assert graph_shape(run) == (1, 0, 1)
    (vertex,) = run.vertices("meetpoint")
    assert np.hypot(*run.pipeline.mapper.belief.map_vertex(vertex).position) > 1.0


def test_a_ring_without_a_vertex_is_driven_round_once() -> None:
    """A pillar alone in a room: an edge without an end gets one vertex, at the start."""
    run = play(
        carved([(-2.0, -2.0, 2.0, 2.0)], [(-0.7, -0.7, 0.7, 0.7)]),
        Pose(-1.3, 0.0, math.pi / 2),
        limit=60.0,
    )
    assert_explored(run)
    (edge,) = run.pipeline.mapper.graph.edges.values()
    assert edge.a.vertex == edge.b.vertex
    # Half way between the squares beside the pillar; around its corners as far from them as from
    # the walls, on the diagonal where 2 - t = sqrt(2) (t - 0.7).
    t = (2.0 + 0.7 * math.sqrt(2.0)) / (1.0 + math.sqrt(2.0))
    around = 4 * (1.4 + 2 * math.hypot(t - 0.7, 1.35 - t))
    assert edge.length == pytest.approx(around, rel=0.05)
    (vertex,) = run.vertices("meetpoint")
    assert np.hypot(*run.pipeline.mapper.belief.map_vertex(vertex).position) < 0.9
    assert run.pipeline.past.travelled < 1.2 * edge.length
    (joined,) = (event for event in run.events if isinstance(event, EdgeJoined))
    assert (joined.start, joined.end, joined.driven) == (vertex, vertex, True)


def test_a_ring_that_is_in_sight_as_a_whole_is_driven_round_without_a_halt() -> None:
    """After two sides of a corridor round a block nothing of it is new, and nowhere is its end."""
    corridor = carved([(-1.0, -1.0, 6.0, 6.0)], [(1.0, 1.0, 4.0, 4.0)])
    run = play(corridor, Pose(), twin=TwinConfig(seed=3), limit=150.0)
    assert_explored(run)
    assert graph_shape(run) == (1, 0, 1)
    assert run.recoveries() == []


def test_a_ring_is_closed_whose_beginning_was_taken_for_another_edge() -> None:
    """A pillar as wide as people: for twenty seconds it may be one, and the room has no ring."""
    canvas = Canvas(8.0, 8.0)
    canvas.carve(1.0, 1.0, 7.0, 7.0)
    canvas.build_disc(4.3, 3.6, 0.3)
    twin = TwinConfig(seed=1, laser=HokuyoTwinConfig(model="URG-04LX"))
    run = play(
        canvas.world("pillar"),
        Pose(2.0, 2.0, 0.0),
        twin=twin,
        limit=150.0,
        goes_on=lambda run: run.outcome is None and not run.pipeline.mapper.graph.edges,
    )
    assert run.contacts == 0
    assert graph_shape(run) == (1, 0, 1)


def test_two_ways_round_a_block_are_two_edges_between_the_same_vertices() -> None:
    """West and east of a block with a corridor on either side, and a dead end at each vertex."""
    free: list[Rectangle] = [
        (-4.5, -0.6, -1.0, 0.6),
        (1.0, -0.6, 4.5, 0.6),
        (-2.2, -1.9, 2.2, 1.9),
    ]
    run = play(carved(free, [(-1.0, -0.7, 1.0, 0.7)]), Pose(-3.5, 0.0, 0.1))
    assert_explored(run)
    graph = run.pipeline.mapper.graph
    parallel = [
        edge
        for edge in graph.edges.values()
        if {edge.a.vertex, edge.b.vertex} == set(run.vertices("meetpoint"))
    ]
    assert graph_shape(run) == (2, 2, 4)
    assert len(parallel) == 2


def test_a_side_corridor_that_lies_behind_the_laser_s_view_is_found() -> None:
    """With 240 degrees of sight, past an arm that leaves backwards at 45 degrees."""
    canvas = Canvas(10.0, 7.0)
    canvas.carve(1.0, 4.0, 9.0, 5.2)
    canvas.carve_turned(3.6, 3.2, 5.0, 1.2, math.radians(45))
    run = play(
        canvas.world("rear"),
        Pose(2.0, 4.6, 0.0),
        twin=TwinConfig(laser=HokuyoTwinConfig(model="URG-04LX")),
    )
    assert_explored(run)
    assert graph_shape(run) == (1, 3, 3)


@pytest.mark.parametrize("width", [0.3, 0.37, 0.4], ids=lambda w: f"{w:g} m")
def test_a_door_that_the_robot_does_not_fit_through_is_no_edge(width: float) -> None:
    """The robot is 0.354 m wide and wants three centimetres on either side."""
    free: list[Rectangle] = [(-2.5, -0.7, 2.5, 0.7), (-width / 2, 0.7, width / 2, 1.0)]
    free.append((-1.5, 0.9, 1.5, 3.0))
    run = play(carved(free), Pose(-1.5, 0.0, 0.0))
    assert_explored(run)
    assert graph_shape(run) == (0, 2, 1)


def test_a_door_that_the_robot_fits_through_is_an_edge() -> None:
    free: list[Rectangle] = [(-2.5, -0.7, 2.5, 0.7), (-0.25, 0.7, 0.25, 1.0), (-1.0, 0.9, 1.0, 3.0)]
    run = play(carved(free), Pose(-1.5, 0.0, 0.0))
    assert_explored(run)
    assert len(run.vertices("meetpoint")) >= 1
    assert max(pose.y for pose in run.truth) > 1.2  # it has been inside


@pytest.mark.parametrize(("model", "seed"), [("UTM-30LX", 2), ("URG-04LX", 1)])
def test_a_narrow_door_stays_open_for_a_noisy_laser(
    model: Literal["UTM-30LX", "URG-04LX"], seed: int
) -> None:
    """Two rooms with doors of 0.52 m; sigma is 3 cm, and 8 cm are to spare on either side."""
    rooms: list[Rectangle] = [(-3.2, 0.9, -0.2, 3.4), (0.2, -3.4, 3.2, -0.9)]
    doors: list[Rectangle] = [(-1.96, 0.7, -1.44, 1.0), (1.44, -1.0, 1.96, -0.7)]
    laser = HokuyoTwinConfig(model=model, range_sigma_m=0.03)
    run = play(
        carved([(-3.2, -0.8, 3.2, 0.8), *rooms, *doors]),
        Pose(-2.6, 0.0, 0.0),
        twin=TwinConfig(seed=seed, laser=laser),
    )
    assert_explored(run)
    assert max(pose.y for pose in run.truth) > 1.5  # it has been in both
    assert min(pose.y for pose in run.truth) < -1.5
    assert len(run.recoveries()) < 6
    assert run.contacts == 0


@pytest.mark.parametrize("width", [0.8, 2.0], ids=["narrow", "wide"])
def test_a_dead_end_is_half_its_width_before_the_wall(width: float) -> None:
    run = play(carved([(-3.0, -width / 2, 3.0, width / 2)]), Pose(-1.0, 0.05, 0.1))
    assert_explored(run)
    ends = [(-3.0 + width / 2, 0.0), (3.0 - width / 2, 0.0)]
    assert_found(run, "endpoint", ends, within=0.2)
    assert graph_shape(run) == (0, 2, 1)


@pytest.mark.parametrize("inner", [0.6, 1.1], ids=["equal", "wider"])
def test_a_bend_round_a_corner_is_no_vertex(inner: float) -> None:
    free: list[Rectangle] = [(-3.0, -0.6, 0.6, 0.6), (0.6 - 2 * inner, -0.6, 0.6, 4.0)]
    run = play(carved(free), Pose(-2.0, 0.0, 0.0))
    assert_explored(run)
    assert graph_shape(run) == (0, 2, 1)


def test_a_tree_of_corridors_is_explored_without_a_loop() -> None:
    """A comb with two teeth: everything but the tips is passed more than once."""
    free: list[Rectangle] = [
        (-4.0, -0.6, 4.0, 0.6),
        (-1.6, 0.0, -0.4, 3.5),
        (1.4, 0.0, 2.6, 3.5),
    ]
    run = play(carved(free), Pose(-3.0, 0.0, 0.0))
    assert_explored(run)
    assert graph_shape(run) == (2, 4, 5)


def test_equal_branches_are_not_taken_for_one_another() -> None:
    """Four equal side corridors with worn wheels: no vertex closes a loop with its neighbour."""
    free: list[Rectangle] = [(-1.0, -0.6, 11.0, 0.6)]
    free += [(x - 0.6, 0.0, x + 0.6, 2.4) for x in (1.0, 4.0, 7.0, 10.0 - 0.6)]
    twin = TwinConfig(seed=5, base=KobukiTwinConfig(odometry="worn"))
    run = play(carved(free), Pose(0.0, 0.0, 0.0), twin=twin)
    assert_explored(run)
    assert graph_shape(run) == (4, 6, 9)


def test_an_edge_through_a_door_leads_through_its_middle_wherever_its_end_was_seen_first() -> None:
    """Before the door came into sight the middle of the room was half a metre elsewhere."""
    rooms = carved([(0.5, 0.5, 5.9, 6.5), (5.9, 3.0, 6.1, 3.6), (6.1, 0.5, 11.5, 6.5)])
    start = Pose(1.0, 1.0, 0.0)
    run = play(rooms, start, twin=TwinConfig(seed=1))
    assert_explored(run)
    estimate = smoothed(run.pipeline)
    (edge,) = route_graph(run.pipeline, estimate.vertices, estimate.covariances).edges
    x, y = start.transform(edge.polyline).T
    in_door = np.abs(x - 6.0) < 0.15
    assert in_door.any()
    assert np.abs(y[in_door] - 3.3).max() < 0.05  # of 0.3 m to either jamb
    ends = [estimate.vertices[vertex].position for vertex in (edge.start, edge.end)]
    np.testing.assert_allclose(edge.polyline[[0, -1]], ends, atol=1e-9)


def test_with_a_view_of_190_degrees_a_round_of_rooms_is_driven_once() -> None:
    """Two corners of each are behind the robot as it comes in: ways may seem to lead there."""
    free: list[Rectangle] = [(x, y, x + 4.8, y + 4.8) for x in (0.0, 5.0) for y in (0.0, 5.0)]
    free += [(4.7, 2.0, 5.1, 2.8), (4.7, 7.0, 5.1, 7.8)]  # doors
    free += [(2.0, 4.7, 2.8, 5.1), (7.0, 4.7, 7.8, 5.1), (9.6, 2.0, 12.6, 2.8)]
    twin = TwinConfig(seed=1, laser=HokuyoTwinConfig(model="UXM-30LX-E"))
    run = play(carved(free), Pose(1.2, 2.4, 0.3), twin=twin, limit=300.0)
    assert_explored(run)
    assert graph_shape(run) == (1, 1, 2)
    lengths = [edge.length for edge in run.pipeline.mapper.graph.edges.values()]
    assert run.pipeline.past.travelled < 1.6 * sum(lengths)
