"""Scores of maps and trajectories that are made so that the score is known."""

import json
import math
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

from benchmarks.reference_gvg import Reference
from benchmarks.score_run import Score, main, score_map, score_run
from gvgbot.drivers.world import save_world
from gvgbot.geometry import Pose
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode
from gvgbot.maps.trajectory import Trajectory, encode_tum
from gvgbot.worlds.canvas import Canvas

PLACES = {1: (0.0, 0.0), 2: (10.0, 0.0), 3: (10.0, 10.0), 4: (0.0, 10.0), 5: (20.0, 0.0)}
EDGES = [(1, 2), (2, 3), (3, 4), (4, 1), (1, 4), (2, 5)]  # two of them between 1 and 4
OPTIONAL = {5}
START = Pose(3.0, -2.0, 0.7)  # world_map


def reference() -> Reference:
    graph = nx.MultiGraph()
    for node, place in PLACES.items():
        graph.add_node(node, position=np.array(place), is_required=node not in OPTIONAL)
    graph.add_edges_from(EDGES)
    return Reference(graph)


def route(
    places: dict[int, tuple[float, float]], edges: list[tuple[int, int]], start: Pose = START
) -> RouteGraph:
    """A map, in the frame of the start, of vertices at places in the world."""
    return RouteGraph(
        tuple(
            RouteNode(
                id=node,
                kind="meetpoint",
                position=start.to(Pose(*place, 0.0)).position.tolist(),
                degree=3,
                bearings=(),
                clearance=1.0,
                covariance=(0.01, 0.0, 0.0, 0.01),
            )
            for node, place in places.items()
        ),
        tuple(
            RouteEdge(start=a, end=b, polyline=np.zeros((2, 2)), min_clearance=1.0)
            for a, b in edges
        ),
    )


def scored(**changes: Any) -> Score:
    return score_map(route(**({"places": PLACES, "edges": EDGES} | changes)), reference(), START)


def test_the_truth_as_a_map_is_perfect() -> None:
    score = scored()
    assert (score["recall"], score["precision"], score["edge_recall"]) == (1.0, 1.0, 1.0)
    assert score["vertex_rmse_m"] == pytest.approx(0.0, abs=1e-9)
    assert (score["vertices_ref"], score["edges_ref"]) == (4, 5)


def test_what_is_optional_may_be_missing() -> None:
    places = {node: place for node, place in PLACES.items() if node not in OPTIONAL}
    score = scored(places=places, edges=EDGES[:-1])
    assert (score["recall"], score["precision"], score["edge_recall"]) == (1.0, 1.0, 1.0)


def test_a_required_vertex_that_is_missing_costs_its_share_and_its_edges() -> None:
    places = {node: place for node, place in PLACES.items() if node != 3}
    score = scored(places=places, edges=[(1, 2), (4, 1), (1, 4), (2, 5)])
    assert (score["recall"], score["precision"], score["edge_recall"]) == (3 / 4, 1.0, 3 / 5)


def test_a_vertex_too_many_costs_precision_only() -> None:
    score = scored(places=PLACES | {6: (5.0, 5.0)})
    assert (score["recall"], score["precision"], score["edge_recall"]) == (1.0, 5 / 6, 1.0)


def test_of_two_parallel_edges_each_must_be_found() -> None:
    assert scored(edges=[e for e in EDGES if e != (4, 1)])["edge_recall"] == 4 / 5


def test_a_map_that_is_displaced_has_that_error() -> None:
    moved = {node: (x + 0.3, y - 0.4) for node, (x, y) in PLACES.items()}
    score = scored(places=moved)
    assert score["vertex_rmse_m"] == pytest.approx(0.5)
    assert score["recall"] == 1.0


def test_a_vertex_too_far_away_is_another_one() -> None:
    score = scored(places=PLACES | {3: (11.6, 10.0)})
    assert (score["recall"], score["precision"], score["edge_recall"]) == (3 / 4, 4 / 5, 3 / 5)


def test_no_map_and_no_reference_give_no_figures() -> None:
    score = scored(places={}, edges=[])
    assert (score["recall"], score["precision"], score["vertex_rmse_m"]) == (0.0, None, None)
    score = score_map(route({}, []), Reference(), START)
    assert (score["recall"], score["edge_recall"]) == (None, None)


@pytest.fixture
def corridor_run(tmp_path: Path) -> Path:
    """A run of 40 s, 8 m along a straight corridor from x = 3, and what it knows of that.

    The corridor's middle is y = 3, the robot drives at y = 2.7, 0.7 m from a wall; its estimate
    is 0.2 m ahead all the way. The map holds both ends of the corridor.
    """
    canvas = Canvas(20.0, 6.0)
    canvas.carve(1.0, 2.0, 19.0, 4.0)
    save_world(canvas.world("world"), tmp_path)
    start = Pose(3.0, 2.7, math.pi / 2)
    seconds = np.arange(41.0)
    truth = [Pose(3.0 + t / 5, 2.7, 0.0) for t in seconds]
    estimate = [start.to(Pose(pose.x + 0.2, pose.y, 0.0)) for pose in truth]
    graph = route({1: (2.0, 3.0), 2: (18.0, 3.0)}, [(1, 2)], start)
    twin = {"world": "elsewhere/world.yaml", "start": [start.x, start.y, start.theta]}
    summary = {"config": {"twin": twin, "robot": {"radius_m": 0.177}}}
    (tmp_path / "map.geojson").write_text(geojson.encode(graph))
    for name, poses in (("truth.tum", truth), ("estimate.tum", estimate)):
        rows = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
        (tmp_path / name).write_text(encode_tum(Trajectory(seconds, rows)))
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    return tmp_path


@pytest.mark.parametrize(("door", "expected"), [(0.4, 1.0), (0.5, 0.5)])
def test_what_lies_behind_a_door_without_room_to_spare_is_told_apart(
    door: float, expected: float, corridor_run: Path
) -> None:
    canvas = Canvas(20.0, 11.0)
    canvas.carve(1.0, 2.0, 19.0, 4.0)
    canvas.carve(10.0, 4.0, 10.0 + door, 4.3)  # the robot is 0.354 m wide
    canvas.carve(7.0, 4.3, 13.5, 9.3)
    save_world(canvas.world("world"), corridor_run)
    score = score_run(corridor_run)
    assert score["vertices_ref"] == 4  # both ends, before the door, and in the room
    assert (score["recall"], score["roomy_recall"]) == (0.5, expected)


def test_a_run_that_starts_where_there_is_no_room_to_spare_has_no_such_recall(
    corridor_run: Path,
) -> None:
    summary = json.loads((corridor_run / "summary.json").read_text())
    summary["config"]["twin"]["start"][1] = 2.19
    (corridor_run / "summary.json").write_text(json.dumps(summary))
    assert score_run(corridor_run)["roomy_recall"] is None


def test_a_run_is_scored_from_its_directory_alone(corridor_run: Path) -> None:
    score = score_run(corridor_run)
    assert (score["recall"], score["precision"], score["edge_recall"]) == (1.0, 1.0, 1.0)
    assert score["vertex_rmse_m"] == pytest.approx(0.0, abs=0.05)
    assert score["driven_m"] == pytest.approx(8.0)
    assert score["mean_speed_mps"] == pytest.approx(0.2)
    assert score["min_clearance_m"] == pytest.approx(0.7)
    assert score["ate_m"] == pytest.approx(0.2)
    # A metre back to the near end and then 16 m to the other one, from x = 3.
    assert score["tour_m"] == pytest.approx(1.0 + 16.0, abs=0.1)
    assert score["path_ratio"] == pytest.approx(8.0 / 17.0, rel=0.01)


def test_a_directory_that_is_no_run_gets_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith(f"{tmp_path}: ")
