"""The route server of Nav2 takes every map that a run saves."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from gvgbot.maps.geojson import encode
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
