"""The route server of Nav2 takes every map that a run saves."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given

from gvgbot.errors import UsageError
from gvgbot.geometry import Array
from gvgbot.maps import route_server
from gvgbot.maps.geojson import decode, encode
from gvgbot.maps.route_graph import RouteGraph
from tests.unit.maps.route_server import Malformed, load
from tests.unit.maps.small_run import write_run
from tests.unit.maps.test_geojson import CORNER, graphs


@given(graphs())
def test_every_graph_is_taken_with_all_its_edges_both_ways(graph: RouteGraph) -> None:
    if not graph.edges:
        with pytest.raises(Malformed, match="without"):
            load(encode(graph))
        return
    loaded = load(encode(graph))
    assert set(loaded.nodes) == {vertex.id for vertex in graph.vertices}
    for vertex in graph.vertices:
        assert loaded.nodes[vertex.id] == pytest.approx(vertex.position, abs=1e-6)
    there = sorted((edge.start, edge.end) for edge in graph.edges)
    back = [(end, start) for start, end in there]
    assert sorted((start, end) for start, end, _ in loaded.edges.values()) == sorted(there + back)


@given(graphs())
def test_the_straight_ways_of_an_export_run_where_the_edges_do(graph: RouteGraph) -> None:
    text = route_server.encode(graph)
    if graph.edges:
        load(text)
    features = json.loads(text)["features"]
    pieces = [f for f in features if f["geometry"]["type"] != "Point"]
    assert len(pieces) >= 2 * len(graph.edges)
    for piece in pieces:
        start, end = piece["properties"]["metadata"]["edge"]
        lines = [e.polyline for e in graph.edges if (e.start, e.end) == (start, end)]
        (a, b) = piece["geometry"]["coordinates"][0]
        assert piece["properties"]["cost"] == pytest.approx(math.dist(a, b), abs=1e-5)
        for share in np.linspace(0.0, 1.0, 5):
            point = (1.0 - share) * np.array(a) + share * np.array(b)
            assert min(away(point, line) for line in lines) < route_server.TOLERANCE_M + 1e-5


def away(point: Array, line: Array) -> float:
    """How far a point is from the nearest piece of a line (N, 2)."""
    found = []
    for a, b in pairwise(line):
        length = math.dist(a, b)
        along = 0.0 if length < 1e-9 else float((point - a) @ (b - a)) / length**2
        found.append(math.dist(point, a + min(max(along, 0.0), 1.0) * (b - a)))
    return min(found)


def test_a_way_round_a_corner_is_as_long_from_node_to_node() -> None:
    """As the route server drives it: 2 m ahead and 1 m to the left."""
    loaded = load(route_server.encode(CORNER))
    graph = nx.DiGraph()
    for start, end, _ in loaded.edges.values():
        graph.add_edge(start, end, metres=math.dist(loaded.nodes[start], loaded.nodes[end]))
    for way in ((3, 7), (7, 3)):
        assert nx.shortest_path_length(graph, *way, weight="metres") == pytest.approx(3.0)
    assert sorted(loaded.nodes.values()) == [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]


@pytest.mark.parametrize(("off", "nodes"), [(0.045, 2), (0.055, 3)])
def test_a_bend_is_straightened_if_it_is_no_wider_than_a_cell(off: float, nodes: int) -> None:
    """Of five centimetres, as those of the grid that is saved."""
    line = np.array([(0.0, 0.0), (1.0, off), (2.0, 1.0)])
    line[1] = np.array([1.0, 0.5]) + off * np.array([-1.0, 2.0]) / math.sqrt(5.0)  # off the chord
    bent = replace(CORNER, edges=(replace(CORNER.edges[0], polyline=line),))
    assert len(load(route_server.encode(bent)).nodes) == nodes


def test_a_straight_way_past_a_pillar_has_no_more_room_than_it_says() -> None:
    """The edge keeps half a metre from a pillar of half a metre, in an arc; chords come nearer."""
    angles = np.linspace(0.0, 2.0, 2001)
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bow = replace(CORNER.edges[0], polyline=arc, min_clearance=0.5)
    for feature in json.loads(route_server.encode(replace(CORNER, edges=(bow,))))["features"]:
        if feature["geometry"]["type"] == "Point":
            continue
        a, b = map(np.array, feature["geometry"]["coordinates"][0])
        nearest = np.hypot(*((a + b) / 2)) - 0.5  # a chord is nearest in its middle
        told = feature["properties"]["metadata"]["min_clearance"]
        assert told == pytest.approx(nearest, abs=1e-5)


def test_a_way_back_begins_where_the_way_there_ends_and_both_cost_metres_of_driving() -> None:
    """From node to node it is straight, so a bow that is left out costs nothing."""
    flat = np.array([(0.0, 0.0), (0.6, 0.8), (0.63, 0.78), (1.2, 1.6)])
    bow = replace(CORNER.edges[0], polyline=flat)
    text = route_server.encode(replace(CORNER, edges=(bow,)))
    there, back = (f for f in json.loads(text)["features"] if f["geometry"]["type"] != "Point")
    assert there["geometry"]["coordinates"] == [[[0.0, 0.0], [1.2, 1.6]]]
    assert back["geometry"]["coordinates"] == [[[1.2, 1.6], [0.0, 0.0]]]
    assert there["properties"]["cost"] == back["properties"]["cost"] == 2.0


def test_an_export_that_is_taken_for_the_map_of_a_run_is_told_to_be_one() -> None:
    with pytest.raises(UsageError, match="an export for Nav2's route server"):
        decode(route_server.encode(CORNER))


def test_a_saved_run_is_taken(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run")
    loaded = load((run / "map.geojson").read_text())
    assert loaded.edges
    assert all(np.isfinite(cost) for _, _, cost in loaded.edges.values())


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda node, edge: node["properties"].pop("id"), id="no id"),
        pytest.param(lambda node, edge: node["properties"].update(id=-1), id="negative id"),
        pytest.param(lambda node, edge: edge["properties"].update(endid=999), id="no such node"),
        pytest.param(lambda node, edge: edge["properties"].update(id=3), id="id twice"),
        pytest.param(lambda node, edge: edge["properties"].update(cost="much"), id="cost"),
        pytest.param(
            lambda node, edge: node["properties"]["metadata"].update(deep=[[1.0]]), id="nested"
        ),
        pytest.param(lambda node, edge: edge["properties"]["metadata"].update(x=None), id="null"),
        pytest.param(lambda node, edge: edge["geometry"].update(coordinates=[[[0, 0]]]), id="line"),
    ],
)
def test_what_is_wrong_would_be_seen(change: Any) -> None:
    collection = json.loads(encode(CORNER))
    load(json.dumps(collection))  # which is whole
    node, _, edge, _ = collection["features"]
    change(node, edge)
    with pytest.raises(Malformed):
        load(json.dumps(collection))
