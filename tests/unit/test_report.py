"""What is saved: the trajectory of a drive whose odometry is wrong by a known rate; the graph."""

import math
from array import array

import numpy as np
import pytest

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.config import Config
from gvgbot.geometry import Pose, Poses, Twist, length_of
from gvgbot.hal.messages import Odometry
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.report import Journey, _corrected, map_files, route_graph, with_room_of


def pipeline(keyframes: list[Keyframe]) -> Pipeline:
    config = Config()
    mind = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    mind.past.keyframes = keyframes
    return mind


@pytest.mark.parametrize(
    ("simulated", "truths"),
    [([True, True, True], 3), ([True, True, False], 0), ([False, True, True], 0)],
    ids=["simulated", "real since", "simulated since"],
)
def test_the_truth_is_told_of_the_whole_way_or_not_at_all(
    simulated: list[bool], truths: int
) -> None:
    """Whoever tries a configuration with the twins goes on in the same directory without them."""
    journey, mind = Journey(), pipeline([Keyframe(0.0, Pose(), Pose(), Pose(), None)])
    for row, is_simulated in enumerate(simulated):
        odometry = Odometry(float(row), Pose(), Twist(0.0, 0.0))
        journey.record(odometry, mind, Pose() if is_simulated else None)
    files = map_files(mind, journey, "try")
    assert len(journey.stamps) == len(simulated)
    assert str(files.get("truth.tum", "")).count("\n") == truths


def test_what_odometry_is_wrong_by_is_spread_over_the_time_between_keyframes() -> None:
    """A metre a second along x, of which odometry sees nine tenths; a keyframe each second."""
    stamps = [0.1 * k for k in range(31)]
    felt = [Pose(0.9 * t, 0.0, 0.0) for t in stamps]
    frames = [Keyframe(float(k), felt[10 * k], Pose(), Pose(), None) for k in range(3)]
    journey = Journey(stamps=array("d", stamps), odom_base=Poses(felt))
    true = [Pose(float(k), 0.0, 0.0) for k in range(3)]
    for late in (0, 1):  # by how many keyframes what is known then may be behind
        journey.keyframes = array("q", [max(0, min(2, int(t + 1e-9)) - late) for t in stamps])
        x = _corrected(journey, pipeline(frames), true)[:, 0].tolist()
        assert x[:21] == pytest.approx(stamps[:21])
        # then nothing tells what is wrong
        assert x[21:] == pytest.approx([2.0 + 0.9 * (t - 2.0) for t in stamps[21:]])


def test_a_row_at_the_stamp_of_a_keyframe_that_came_later_is_that_keyframe() -> None:
    frames = [Keyframe(float(k), Pose(1.3 * k, 0.1, 0.2), Pose(), Pose(), None) for k in range(2)]
    true = [Pose(), Pose(1.0, 0.5, 0.1)]
    journey = Journey(stamps=array("d", [1.0]), keyframes=array("q", [0]))
    journey.odom_base.append(frames[1].odom_base)
    (pose,) = _corrected(journey, pipeline(frames), true).tolist()
    assert pose == pytest.approx([true[1].x, true[1].y, true[1].theta])


def test_of_a_way_that_is_forgotten_no_row_is_left_and_the_next_ones_go_on_behind_it() -> None:
    poses = [Pose(float(k), 0.5 * k, 0.1 * k) for k in range(6)]
    journey = Journey(
        stamps=array("d", range(6)),
        keyframes=array("q", [0, 0, 1, 2, 2, 3]),
        odom_base=Poses(poses),
        map_base=Poses(poses[::-1]),
        world_base=Poses(poses),
    )
    journey.forget(2)
    assert list(journey.stamps) == [0.0, 1.0, 2.0]
    assert list(journey.keyframes) == [0, 0, 1]
    assert journey.odom_base.rows().tolist() == [[p.x, p.y, p.theta] for p in poses[:3]]
    assert journey.map_base.rows().tolist() == [[p.x, p.y, p.theta] for p in poses[:2:-1]]
    assert journey.world_base.rows().tolist() == journey.odom_base.rows().tolist()


def test_directions_in_the_map_are_within_half_a_turn_of_straight_on() -> None:
    """A vertex that is turned by 3 rad, whose way ahead is known, and one half right is not."""
    mind = pipeline([])
    vertex = Vertex(1, 1.0, Pose(), 0.0, 0.0)
    mind.mapper.graph.vertices[1] = vertex
    ends = (HalfEdgeId(1, vertex.add_half_edge(0.0)), HalfEdgeId(1, vertex.add_half_edge(1.0)))
    vertex.add_half_edge(-0.5)
    vertex.add_half_edge(2.0)
    mind.mapper.graph.join(*ends, np.array([[0.0, 0.0], [1.0, 0.0]]), 1.0, driven=True)
    (told,) = route_graph(mind, {1: Pose(0.0, 0.0, 3.0)}, {1: np.eye(2)}).vertices
    assert told.bearings == pytest.approx((3.0, 4.0 - math.tau, 2.5, 5.0 - math.tau))
    assert told.frontiers == pytest.approx((2.5, 5.0 - math.tau))


def told_edge(line: list[tuple[float, float]], end: Pose) -> RouteEdge:
    """What is told of an edge that was driven from 0 to 4 m, when its far vertex is at `end`."""
    mind = pipeline([])
    ends = []
    for number, x in ((1, 0.0), (2, 4.0)):
        vertex = mind.mapper.graph.vertices[number] = Vertex(number, 1.0, Pose(x), 0.0, 0.0)
        ends.append(HalfEdgeId(number, vertex.add_half_edge(0.0)))
    mind.mapper.graph.join(ends[0], ends[1], np.array(line), 1.0, driven=True)
    (told,) = route_graph(mind, {1: Pose(), 2: end}, {1: np.eye(2), 2: np.eye(2)}).edges
    return told


def test_an_edge_that_was_put_together_of_two_does_not_turn_back() -> None:
    """Of a vertex that was none, seen a little beside the way that both its edges now are."""
    spike = [(2.0, 0.0), (2.05, 0.3), (2.1, 0.0)]
    line = [(0.0, 0.0), (1.0, 0.0), *spike, (3.0, 0.0), (4.0, 0.0)]
    assert length_of(told_edge(line, Pose(4.0)).polyline) == pytest.approx(4.0)


def test_an_edge_is_as_long_as_its_line_whatever_was_measured_when_it_was_seen() -> None:
    after_a_closure = Pose(3.0, 4.0)
    told = told_edge([(0.0, 0.0), (2.0, 0.0), (4.0, 0.0)], after_a_closure)
    assert told.polyline[-1].tolist() == [3.0, 4.0]
    assert told.length == pytest.approx(5.0)


def street(claimed: float, start: tuple[float, float], end: tuple[float, float]) -> RouteGraph:
    """A straight edge that claims so much room."""
    vertices = tuple(
        RouteNode(
            id=vertex,
            kind="endpoint",
            position=place,
            degree=1,
            bearings=(0.0,),
            clearance=1.0,
            covariance=(0.0, 0.0, 0.0, 0.0),
        )
        for vertex, place in ((1, start), (2, end))
    )
    edge = RouteEdge(start=1, end=2, polyline=np.array([start, end]), min_clearance=claimed)
    return RouteGraph(vertices, (edge,))


@pytest.mark.parametrize(("claimed", "told"), [(0.9, 0.5), (0.3, 0.3)])
def test_no_edge_claims_more_room_than_the_saved_grid_has_along_it(
    claimed: float, told: float
) -> None:
    """A post half a metre beside it, out of sight when the edge was joined; the rest is unseen."""
    cells = np.full((40, 80), UNKNOWN, np.int8)
    cells[30, 40] = 100
    post = -2.0 + 40.5 * 0.05, -1.0 + 30.5 * 0.05
    grid = OccupancyGrid(cells, 0.05, (-2.0, -1.0))
    graph = street(claimed, (post[0] - 1.0, post[1] - 0.5), (post[0] + 1.0, post[1] - 0.5))
    (edge,) = with_room_of(graph, grid).edges
    assert edge.min_clearance == pytest.approx(told, abs=0.01)
    (part,) = with_room_of(graph, grid, {0}).edges
    assert part.min_clearance == edge.min_clearance  # nobody knows what is in the unseen
    empty = OccupancyGrid(np.full((4, 4), UNKNOWN, np.int8), 0.05, (0.0, 0.0))
    assert with_room_of(graph, empty).edges[0].min_clearance == claimed


@pytest.mark.parametrize(("away", "told"), [(0.5, 0.5), (0.95, 1.0), (3.0, 1.0)])
def test_no_vertex_claims_far_more_room_than_the_saved_grid_has_around_it(
    away: float, told: float
) -> None:
    """A metre is claimed; a column was out of the map then, for somebody might have stood there."""
    cells = np.zeros((40, 160), np.int8)
    cells[20, 100] = 100
    column = 100.5 * 0.05, 20.5 * 0.05
    graph = street(0.3, (column[0] - away, column[1]), (column[0] - away - 1.5, column[1]))
    near, far = with_room_of(graph, OccupancyGrid(cells, 0.05, (0.0, 0.0))).vertices
    assert near.clearance == pytest.approx(told, abs=0.01)
    assert far.clearance == 1.0


@pytest.mark.parametrize(("beside", "told"), [(100, 0.8), (UNKNOWN, 0.8), (0, 1.5)])
def test_part_of_an_edge_that_was_narrow_elsewhere_claims_the_room_that_is_known(
    beside: int, told: float
) -> None:
    """In a hall 3 m wide; 0.8 m beside the edge a recess of it is filled, unseen, or free."""
    cells = np.full((120, 200), UNKNOWN, np.int8)
    cells[29:91] = 100
    cells[30:90] = 0
    cells[30:44, 90:110] = beside
    grid = OccupancyGrid(cells, 0.05, (0.0, 0.0))
    graph = street(0.3, (2.0, 3.0), (8.0, 3.0))
    assert with_room_of(graph, grid).edges[0].min_clearance == 0.3
    (edge,) = with_room_of(graph, grid, {0}).edges
    assert edge.min_clearance == pytest.approx(told, abs=0.04)
    beyond = street(0.3, (2.0, 3.0), (30.0, 3.0))
    assert with_room_of(beyond, grid, {0}).edges[0].min_clearance == 0.3
