import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.errors import UsageError
from gvgbot.maps.geojson import decode, encode
from gvgbot.maps.route_graph import RouteEdge, RouteGraph, RouteNode


def a_vertex(number: int, x: float = 0.0, y: float = 0.0, **changes: Any) -> RouteNode:
    fields: dict[str, Any] = {
        "id": number,
        "kind": "meetpoint",
        "position": (x, y),
        "degree": 3,
        "bearings": (0.0, 2.0, -2.0),
        "clearance": 1.25,
        "covariance": (0.01, 0.001, 0.001, 0.02),
        "frontiers": (2.0,),
        "visits": 4,
    }
    return RouteNode(**(fields | changes))


def an_edge(start: int, end: int, *points: tuple[float, float]) -> RouteEdge:
    return RouteEdge(
        start=start,
        end=end,
        polyline=np.array(points),
        min_clearance=0.4,
        traversals=2,
    )


CORNER = RouteGraph(
    (a_vertex(3), a_vertex(7, 2.0, 1.0, kind="endpoint", degree=1)),
    (an_edge(3, 7, (0.0, 0.0), (2.0, 0.0), (2.0, 1.0)),),
)
MULTIGRAPH = RouteGraph(
    (a_vertex(0), a_vertex(1, 4.0, 0.0)),
    (
        an_edge(0, 1, (0.0, 0.0), (2.0, 1.0), (4.0, 0.0)),
        an_edge(0, 1, (0.0, 0.0), (2.0, -1.0), (4.0, 0.0)),
        an_edge(1, 0, (4.0, 0.0), (2.0, 1.0), (0.0, 0.0)),
        an_edge(1, 1, (4.0, 0.0), (6.0, 1.0), (6.0, -1.0), (4.0, 0.0)),
        an_edge(0, 0, (0.0, 0.0), (-1.0, 0.0), (0.0, 0.0)),
    ),
)


def features(graph: RouteGraph, geometry: str) -> list[dict[str, Any]]:
    collection = json.loads(encode(graph))
    assert collection["type"] == "FeatureCollection"
    assert all(feature["type"] == "Feature" for feature in collection["features"])
    return [f for f in collection["features"] if f["geometry"]["type"] == geometry]


def test_a_vertex_is_a_point_with_all_its_properties() -> None:
    assert features(CORNER, "Point")[0] == {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [0.0, 0.0]},
        "properties": {
            "id": 3,
            "frame": "map",
            "metadata": {
                "kind": "meetpoint",
                "degree": 3,
                "bearings": [0.0, 2.0, -2.0],
                "clearance": 1.25,
                "covariance": [0.01, 0.001, 0.001, 0.02],
                "frontiers": [2.0],
                "visits": 4,
            },
        },
    }


def test_an_edge_is_two_opposite_lines_with_ids_of_their_own() -> None:
    metadata = {"length": 3.0, "min_clearance": 0.4, "traversals": 2}
    there, back = features(CORNER, "MultiLineString")
    line = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]
    assert there["geometry"]["coordinates"] == [line]
    assert back["geometry"]["coordinates"] == [line[::-1]]
    assert there["properties"] == {
        "id": 8,
        "startid": 3,
        "endid": 7,
        "cost": 3.0,
        "metadata": metadata,
    }
    assert back["properties"] == {
        "id": 9,
        "startid": 7,
        "endid": 3,
        "cost": 3.0,
        "metadata": metadata,
    }


def test_ids_are_unique_over_vertices_and_edges() -> None:
    both = features(MULTIGRAPH, "Point") + features(MULTIGRAPH, "MultiLineString")
    assert len({feature["properties"]["id"] for feature in both}) == len(both) == 2 + 2 * 5


def test_metadata_is_flat_and_without_null() -> None:
    for feature in features(CORNER, "Point") + features(CORNER, "MultiLineString"):
        for value in feature["properties"]["metadata"].values():
            items = value if isinstance(value, list) else [value]
            assert all(isinstance(item, (int, float, str)) for item in items)


def test_the_order_in_the_graph_does_not_matter() -> None:
    shuffled = RouteGraph(MULTIGRAPH.vertices[::-1], MULTIGRAPH.edges[::-1])
    assert encode(shuffled) == encode(MULTIGRAPH)


def test_numbers_are_rounded_to_micrometres_and_zero_has_no_sign() -> None:
    point = features(RouteGraph((a_vertex(0, 1.23456789, -1e-9),)), "Point")[0]
    assert json.dumps(point["geometry"]["coordinates"]) == "[1.234568, 0.0]"


def test_loops_and_parallel_edges_come_back() -> None:
    edges = sorted((e.start, e.end, e.polyline.tolist()) for e in decode(encode(MULTIGRAPH)).edges)
    assert edges == sorted((e.start, e.end, e.polyline.tolist()) for e in MULTIGRAPH.edges)


lengths = st.floats(-1e3, 1e3)
points = st.tuples(lengths, lengths)


@st.composite
def graphs(draw: st.DrawFn) -> RouteGraph:
    ids = draw(st.lists(st.integers(0, 10**6), min_size=1, max_size=5, unique=True))
    vertices = [
        RouteNode(
            id=number,
            kind=draw(st.sampled_from(["meetpoint", "endpoint"])),
            position=draw(points),
            degree=draw(st.integers(0, 9)),
            bearings=tuple(draw(st.lists(st.floats(-math.pi, math.pi), max_size=3))),
            clearance=draw(st.floats(0, 30)),
            covariance=draw(st.tuples(lengths, lengths, lengths, lengths)),
            frontiers=tuple(draw(st.lists(st.floats(-math.pi, math.pi), max_size=3))),
            visits=draw(st.integers(0, 99)),
        )
        for number in ids
    ]
    edges = [
        RouteEdge(
            start=draw(st.sampled_from(ids)),
            end=draw(st.sampled_from(ids)),
            polyline=np.array(draw(st.lists(points, min_size=2, max_size=4))),
            min_clearance=draw(st.floats(0, 30)),
            traversals=draw(st.integers(0, 99)),
        )
        for _ in range(draw(st.integers(0, 5)))
    ]
    return RouteGraph(tuple(vertices), tuple(edges))


@given(graphs())
def test_every_vertex_and_edge_survives_saving(graph: RouteGraph) -> None:
    loaded = decode(encode(graph))
    for before, after in zip(
        sorted(graph.vertices, key=lambda v: v.id), loaded.vertices, strict=True
    ):
        assert (after.id, after.kind, after.degree) == (before.id, before.kind, before.degree)
        assert after.visits == before.visits
        assert after.position == pytest.approx(before.position, abs=1e-6)
        assert after.bearings == pytest.approx(before.bearings, abs=1e-6)
        assert after.frontiers == pytest.approx(before.frontiers, abs=1e-6)
        assert after.clearance == pytest.approx(before.clearance, abs=1e-6)
        assert after.covariance == pytest.approx(before.covariance, abs=1e-9)
    unmatched = list(graph.edges)
    for edge in loaded.edges:
        unmatched.remove(next(other for other in unmatched if same(edge, other)))
    assert not unmatched


def same(edge: RouteEdge, other: RouteEdge) -> bool:
    return (
        (edge.start, edge.end, edge.traversals) == (other.start, other.end, other.traversals)
        and math.isclose(edge.length, other.length, abs_tol=1e-6)
        and math.isclose(edge.min_clearance, other.min_clearance, abs_tol=1e-6)
        and edge.polyline.shape == other.polyline.shape
        and np.allclose(edge.polyline, other.polyline, rtol=0, atol=1e-6)
    )


def test_a_small_covariance_stays_positive_definite() -> None:
    millimetre = a_vertex(0, covariance=(1e-6, 0.99e-6, 0.99e-6, 1e-6))
    (vertex,) = decode(encode(RouteGraph((millimetre,)))).vertices
    assert np.linalg.eigvalsh(np.reshape(vertex.covariance, (2, 2))).min() > 0


def test_a_number_that_is_not_finite_is_not_saved() -> None:
    with pytest.raises(ValueError, match="nan"):
        encode(RouteGraph((a_vertex(0, math.nan),)))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("]}\n", "", "not a route graph"),
        ("FeatureCollection", "Topology", "not a route graph"),
        ('"Point"', '"Polygon"', "feature 0"),
        ('"meetpoint"', '"meeting"', "feature 0.*kind"),
        ('"startid":3', '"startid":"3"', "feature 2.*startid"),
        ('"id":7', '"id":3', "id 3"),
        ('"id":3,', '"id":-3,', "-3"),
        ('"endid":7', '"endid":4', "edge 8"),
        ("[2.0,0.0],", "[2.0,0.5],", "no way back"),
        ("[0.0,0.0],[2.0,0.0],", "[0.0],[2.0,0.0],", "feature 2"),
        ('"frame":"map"', '"frame":"odom"', "feature 0.*frame"),
        ("[2.0,1.0]", "[2.0,1e6]", r"feature 1.*<= 100000.*coordinates\[1\]"),
        ("[2.0,0.0],", "[-1e308,0.0],", r"feature 2.*>= -100000.*coordinates"),
        ("[0.01,", "[1e308,", r"feature 0.*covariance\[0\]"),
        ('"clearance":1.25', '"clearance":1000000', "feature 0.*clearance"),
        ('"length":3.0', '"length":1e300', "feature 2.*length"),
        ('"clearance":1.25', '"clearance":-1.25', "feature 0.*clearance"),
        ('"visits":', '"visits":-', "feature 0.*visits"),
        ('"degree":', '"degree":-', "feature 0.*degree"),
        ('"min_clearance":', '"min_clearance":-', "feature 2.*min_clearance"),
    ],
)
def test_damage_is_named_in_one_line(old: str, new: str, complaint: str) -> None:
    text = encode(CORNER)
    assert old in text
    with pytest.raises(UsageError, match=complaint) as refusal:
        decode(text.replace(old, new, 1))
    assert "\n" not in str(refusal.value)


def test_the_largest_map_there_can_be_is_read() -> None:
    far = RouteGraph(
        (a_vertex(0, 1e5, -1e5, covariance=(1e10, -1e10, -1e10, 1e10)), a_vertex(1, 1e5)),
        (an_edge(0, 1, (1e5, -1e5), (1e5, 0.0)),),
    )
    assert decode(encode(far)).vertices == far.vertices


@pytest.mark.parametrize(
    "text", ["", "null", "[1, 2]", "not json", '{"features": 3}', "\0", 5000 * "["]
)
def test_what_is_no_graph_at_all_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="not a route graph"):
        decode(text)


def test_an_edge_of_a_single_point_is_refused_as_damage() -> None:
    text = encode(CORNER).replace("[0.0,0.0],[2.0,0.0],[2.0,1.0]", "[0.0,0.0]")
    text = text.replace("[2.0,1.0],[2.0,0.0],[0.0,0.0]", "[0.0,0.0]")
    with pytest.raises(UsageError, match="two points"):
        decode(text)


def test_an_edge_needs_vertices_that_exist() -> None:
    with pytest.raises(ValueError, match="not in the map"):
        RouteGraph((a_vertex(1),), (an_edge(1, 2, (0.0, 0.0), (1.0, 0.0)),))


def test_the_points_of_a_graph_are_its_vertices_and_edges() -> None:
    assert CORNER.points.tolist() == [[0, 0], [2, 1], [0, 0], [2, 0], [2, 1]]
    assert RouteGraph().points.shape == (0, 2)
