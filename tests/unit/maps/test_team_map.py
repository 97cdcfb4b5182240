"""Charts whose truth is known by construction, as one map."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gvgbot.config import load_config
from gvgbot.geometry import Pose
from gvgbot.maps import geojson
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.maps.team_map import route_graph, team_files
from gvgbot.session import Session
from gvgbot.team.chart import ChartWay
from tests.unit.team.building import Building, irregular
from tests.unit.team.test_member import START, team

BUILDING = irregular(5)  # at no junction that both know only two corridors meet
HERE, THERE = Pose(3.0, -2.0, 0.7), Pose(11.0, 6.0, -2.4)
LEFT, RIGHT = {0, 1, 2, 5, 6, 7, 10, 11, 12}, {2, 3, 4, 7, 8, 9, 12, 13, 14}


def test_what_two_know_is_one_map_in_the_frame_of_the_first() -> None:
    own = route_graph(BUILDING.chart(LEFT, HERE))
    others = {"two": (BUILDING.chart(RIGHT, THERE), HERE.to(THERE))}
    files = team_files(own, [], others, "a building")
    joined = geojson.decode(str(files["team.geojson"]))
    true = HERE.inverse().transform(BUILDING.places[sorted(LEFT | RIGHT)])
    found = np.array([vertex.position for vertex in joined.vertices])
    assert len(found) == len(true)
    away = np.hypot(*(found[:, None] - true).transpose(2, 0, 1))
    assert away.min(axis=0).max() < 0.01
    ways = {frozenset(pair) for pair in BUILDING.corridors}
    known = {way for way in ways if way <= LEFT or way <= RIGHT}
    assert len(joined.edges) == len(known)
    picture = files["team.png"]
    assert isinstance(picture, bytes)
    assert picture.startswith(b"\x89PNG")


def test_what_two_have_driven_from_both_ends_is_an_edge_of_the_team() -> None:
    places = np.array([(x, y) for y in (0.0, 6.0, -6.0) for x in (0.0, 10.0)])
    building = Building(places, ((0, 1), (0, 2), (1, 3), (0, 4), (1, 5)))

    def part(start: float, end: float) -> np.ndarray:
        return np.stack([np.linspace(start, end, 40), np.zeros(40)], axis=1)

    own = route_graph(building.chart({0, 2, 4}, HERE))
    theirs = building.chart({1, 3, 5}, THERE)
    theirs = replace(theirs, ways=(ChartWay(THERE.inverse().transform(part(10.0, 5.4)), 0.5),))
    parts = [(HERE.inverse().transform(part(0.0, 4.8)), 0.6)]
    files = team_files(own, parts, {"two": (theirs, HERE.to(THERE))}, "a building")
    joined = geojson.decode(str(files["team.geojson"]))
    assert sorted(edge.length for edge in joined.edges) == pytest.approx(
        [6.0] * 4 + [10.0], abs=0.1
    )
    assert not any(vertex.frontiers for vertex in joined.vertices)


def test_an_edge_of_the_team_is_as_long_as_its_line_whatever_was_measured() -> None:
    chart = BUILDING.chart(LEFT, HERE)
    measured = {key: replace(edge, length=0.9 * edge.length) for key, edge in chart.edges.items()}
    own = route_graph(replace(chart, edges=measured))
    joined = geojson.decode(str(team_files(own, [], {}, "a building")["team.geojson"]))
    for edge in joined.edges:
        straight = math.dist(BUILDING.places[edge.start], BUILDING.places[edge.end])
        assert edge.length == pytest.approx(straight, abs=1e-5)


def test_who_is_alone_leaves_its_own_map() -> None:
    own = route_graph(BUILDING.chart(LEFT, HERE))
    joined = geojson.decode(str(team_files(own, [], {}, "a building")["team.geojson"]))
    assert {v.id: v.position for v in joined.vertices} == {
        v.id: pytest.approx(v.position) for v in own.vertices
    }


def test_a_chart_keeps_its_frontiers_and_lengths() -> None:
    chart = BUILDING.chart(LEFT, HERE)
    graph = route_graph(chart)
    for vertex in graph.vertices:
        corridors = [pair for pair in BUILDING.corridors if vertex.id in pair]
        away = [pair for pair in corridors if not set(pair) <= LEFT]
        assert vertex.degree == len(corridors)
        assert len(vertex.frontiers) == len(away)
    for edge in graph.edges:
        straight = math.dist(BUILDING.places[edge.start], BUILDING.places[edge.end])
        assert edge.length == pytest.approx(straight)


def test_an_edge_that_its_robot_only_saw_was_driven_by_nobody() -> None:
    chart = BUILDING.chart(LEFT, HERE)
    seen = min(chart.edges)
    edges = {key: replace(edge, traversed=key != seen) for key, edge in chart.edges.items()}
    graph = route_graph(replace(chart, edges=edges))
    driven = dict(zip(edges, (edge.traversals for edge in graph.edges), strict=True))
    assert driven == {key: int(key != seen) for key in edges}


def test_a_robot_of_a_team_saves_where_the_others_maps_lie_and_what_is_on_them(
    tmp_path: Path,
) -> None:
    one, two = team()
    with RunDirectory.create(tmp_path, world="somewhere") as directory:
        session = Session(load_config(), directory, None)  # that has seen nothing itself
        session.member = one.member
        session.save()
    true = START["one"].to(START["two"])
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["frames"]["two"] == pytest.approx([true.x, true.y, true.theta], abs=0.05)
    joined = geojson.decode((tmp_path / "team.geojson").read_text())
    assert len(joined.vertices) == len(two.chart.vertices)
    found = np.array([vertex.position for vertex in joined.vertices])
    for vertex in two.chart.vertices.values():
        assert np.hypot(*(found - true.transform(vertex.position)).T).min() < 0.1
