import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.errors import GvgbotError
from gvgbot.geometry import Pose
from gvgbot.team.chart import Chart, ChartWay
from gvgbot.team.news import (
    Claim,
    Course,
    Frame,
    News,
    TeamVertex,
    TeamWay,
    ToldLook,
    decode,
    encode,
    told_edges,
    told_vertices,
    told_ways,
)
from tests.unit.team.building import irregular

CHART = irregular(1).chart({0, 1, 2, 5, 6, 7}, Pose(3.0, -2.0, 0.7))


def news(chart: Chart) -> News:
    return News(
        robot="one",
        life=3,
        sequence=7,
        pose=(1.0, 2.0, 0.5),
        radius=0.25,
        claim=Claim(1.0, 2.0, 0.1, 12.0),
        finished=False,
        frames=(Frame("two", 8, (4.0, 5.0, 0.6)),),
        vertices=told_vertices(chart),
        edges=told_edges(chart),
    )


def test_a_chart_arrives_as_it_was_to_the_centimetre() -> None:
    heard = decode(encode(news(CHART)))
    assert isinstance(heard, News)
    assert heard.claim == Claim(1.0, 2.0, 0.1, 12.0)
    assert heard.frames == (Frame("two", 8, (4.0, 5.0, 0.6)),)
    chart = heard.chart
    assert chart.vertices.keys() == CHART.vertices.keys()
    for key, vertex in CHART.vertices.items():
        other = chart.vertices[key]
        assert other.departures == vertex.departures
        np.testing.assert_array_equal(other.position, vertex.position)
        np.testing.assert_array_equal(other.covariance, vertex.covariance)
        np.testing.assert_allclose(other.walls, vertex.walls, atol=0.0051)
    for key, edge in CHART.edges.items():
        assert (chart.edges[key].a, chart.edges[key].b) == (edge.a, edge.b)
        np.testing.assert_allclose(chart.edges[key].polyline, edge.polyline, atol=1e-5)


def test_parts_of_edges_arrive_as_they_were() -> None:
    corner = np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)])
    told = msgspec.structs.replace(
        news(CHART), ways=told_ways(Chart(ways=(ChartWay(corner, 0.4),)))
    )
    heard = decode(encode(told))
    assert isinstance(heard, News)
    (way,) = heard.chart.ways
    assert way.min_clearance == 0.4
    np.testing.assert_allclose(way.polyline[[0, -1]], corner[[0, -1]], atol=1e-5)
    off = np.minimum(np.abs(way.polyline[:, 1]), np.abs(way.polyline[:, 0] - 3.0))
    assert off.max() < 0.1


@pytest.mark.parametrize("points", [b"", b"x", np.zeros((1, 2), "<f4").tobytes(), b"\xff" * 16])
def test_a_part_of_an_edge_without_a_line_is_refused(points: bytes) -> None:
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(news(CHART), ways=(TeamWay(0.4, points),))))


def test_what_older_robots_tell_besides_is_passed_over() -> None:
    told = msgspec.msgpack.decode(encode(news(CHART)))
    assert not {"stamp", "speed"} & set(told)
    assert decode(msgspec.msgpack.encode(told | {"stamp": 12.5, "speed": 0.0})) == news(CHART)


@given(data=st.data())
def test_damaged_news_are_refused_or_whole(data: st.DataObject) -> None:
    told = bytearray(encode(news(CHART)))
    at = data.draw(st.integers(0, len(told) - 1))
    told[at] = data.draw(st.integers(0, 255))
    try:
        heard = decode(bytes(told))
    except GvgbotError:
        return
    assert isinstance(heard, News)
    ends = {end.vertex for e in heard.chart.edges.values() for end in (e.a, e.b)}
    assert ends <= heard.chart.vertices.keys()


def test_an_edge_that_ends_nowhere_is_refused() -> None:
    told = news(CHART)
    lost = told.edges[0].a[0]
    others = tuple(vertex for vertex in told.vertices if vertex.id != lost)
    damaged = msgspec.structs.replace(told, vertices=others)
    with pytest.raises(GvgbotError, match="do not belong together"):
        decode(encode(damaged))


@pytest.mark.parametrize("is_last", [True, False])
def test_two_edges_that_leave_by_one_departure_are_refused(*, is_last: bool) -> None:
    told = news(CHART)
    twice = msgspec.structs.replace(told.edges[0], id=1000)
    edges = (*told.edges, twice) if is_last else (twice, *told.edges)
    with pytest.raises(GvgbotError, match="do not belong together"):
        decode(encode(msgspec.structs.replace(told, edges=edges)))


def test_a_departure_that_is_told_twice_is_refused() -> None:
    told = news(CHART)
    first, *rest = told.vertices
    first = msgspec.structs.replace(first, departures=first.departures + first.departures[:1])
    with pytest.raises(GvgbotError, match="more departures"):
        decode(encode(msgspec.structs.replace(told, vertices=(first, *rest))))


def test_more_open_departures_than_a_building_has_are_refused() -> None:
    """Each is looked for in the maps of all others, while the robot drives."""
    hub = tuple((key, 0.3 * key, None, False) for key in range(16))
    walls = news(CHART).vertices[0].walls
    star = tuple(
        TeamVertex(k, (float(k), 0.0), (1.0, 0.0, 0.0, 1.0), 1.0, hub, walls) for k in range(63)
    )
    told = msgspec.structs.replace(news(CHART), vertices=star, edges=(), ways=())
    with pytest.raises(GvgbotError, match="more departures"):
        decode(encode(told))


@pytest.mark.parametrize(
    "covariance", [(-1e-6, 0.0, 0.0, 1.0), (1.0, 2.0, 2.0, 1.0), (1.0, 0.5, -0.5, 1.0)]
)
def test_a_covariance_that_is_none_is_refused(
    covariance: tuple[float, float, float, float],
) -> None:
    """It would be inverted when maps are joined."""
    told = news(CHART)
    vertex = msgspec.structs.replace(told.vertices[0], covariance=covariance)
    with pytest.raises(GvgbotError, match="covariance"):
        decode(encode(msgspec.structs.replace(told, vertices=(vertex, *told.vertices[1:]))))


@pytest.mark.parametrize("number", [math.nan, math.inf, -1e9])
@pytest.mark.parametrize("part", ["position", "covariance", "clearance", "departures"])
def test_news_with_a_number_that_is_none_are_refused(part: str, number: float) -> None:
    told = news(CHART)
    broken = {
        "position": (number, 0.0),
        "covariance": (1.0, number, 0.0, 1.0),
        "clearance": number,
        "departures": ((0, number, None, False),),
    }
    vertex = msgspec.structs.replace(told.vertices[0], **{part: broken[part]})
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(told, vertices=(vertex, *told.vertices[1:]))))


def test_more_frames_than_a_robot_knows_others_are_refused() -> None:
    """All of them are gone through several times a second, and a robot knows 64 others."""
    frames = tuple(Frame(f"robot-{number}", 0, (0.0, 0.0, 0.0)) for number in range(65))
    decode(encode(msgspec.structs.replace(news(CHART), frames=frames[:64])))
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(news(CHART), frames=frames)))


@pytest.mark.parametrize("changes", [{"radius": 0.0}, {"pose": (0.0, math.nan, 0.0)}])
def test_news_of_an_impossible_robot_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(news(CHART), **changes)))


@pytest.mark.parametrize("name", ["", "two words", "one\n", "\x1b[2J", "../one"])
def test_who_has_no_name_that_a_robot_can_have_is_refused(name: str) -> None:
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(news(CHART), robot=name)))


@pytest.mark.parametrize("kind", [b"\xa4news", b"\xa6course"])
def test_what_is_nested_without_end_is_refused(kind: bytes) -> None:
    with pytest.raises(GvgbotError, match="damaged"):
        decode(b"\x82\xa4type" + kind + b"\xa5extra" + b"\x91" * 100_000 + b"\xc0")


@pytest.mark.parametrize("line", [[(0, 0), (3e38, 0)], [(0, 0), (0, 1000)] * 20])
def test_a_way_that_no_robot_can_have_driven_is_refused(line: list[tuple[float, float]]) -> None:
    told = news(CHART)
    points = np.array(line, "<f4").tobytes()
    edge = msgspec.structs.replace(told.edges[0], points=points)
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(told, edges=(edge, *told.edges[1:]))))


def test_news_of_more_bytes_than_a_building_needs_are_refused() -> None:
    told = news(CHART)
    vertex = msgspec.structs.replace(told.vertices[0], walls=bytes(10_000_000))
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(told, vertices=(vertex, *told.vertices[1:]))))


def test_a_course_arrives_as_it_was() -> None:
    line = np.array([[1.0, 2.0], [3.0, -4.5]], "<f4")
    course = Course(robot="one", life=3, sequence=7, pose=(1.0, 2.0, 0.5), line=line.tobytes())
    heard = decode(encode(course))
    assert heard == course
    assert isinstance(heard, Course)
    np.testing.assert_array_equal(heard.points, line)


@pytest.mark.parametrize(
    "line",
    [
        b"\x00" * 7,
        np.array([np.nan, 0.0], "<f4").tobytes(),
        np.array([3e38, 0.0], "<f4").tobytes(),
        bytes(1_000_000),
    ],
    ids=["cut", "nowhere", "too far", "too long"],
)
def test_a_damaged_course_is_refused(line: bytes) -> None:
    course = Course(robot="one", life=3, sequence=7, pose=(1.0, 2.0, 0.5), line=line)
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(course))


@pytest.mark.parametrize(
    ("age", "bodies"),
    [
        (-1.0, ((1.0, 2.0, 0.2),)),  # what is yet to be seen
        (math.nan, ((1.0, 2.0, 0.2),)),
        (0.1, ((math.nan, 2.0, 0.2),)),
        (0.1, ((1.0, 2.0, 0.0),)),
        (0.1, 1001 * ((1.0, 2.0, 0.2),)),
    ],
)
def test_a_look_that_no_robot_can_have_had_is_refused(
    age: float, bodies: tuple[tuple[float, float, float], ...]
) -> None:
    pose = 1.0, 2.0, 0.5
    look = ToldLook(age, pose, bodies)
    course = Course(robot="one", life=3, sequence=7, pose=pose, line=b"", look=look)
    possible = ToldLook(0.1, pose, ((1.0, 2.0, 0.2),))
    assert decode(encode(msgspec.structs.replace(course, look=possible))) is not None
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(course))


def test_more_vertices_than_a_building_has_are_refused() -> None:
    """Maps are laid on each other in time that grows with the square of their vertices."""
    lone = TeamVertex(0, (0.0, 0.0), (1.0, 0.0, 0.0, 1.0), 1.0, (), b"")
    crowd = tuple(msgspec.structs.replace(lone, id=k) for k in range(1001))
    told = msgspec.structs.replace(news(CHART), vertices=crowd[:1000], edges=(), ways=())
    assert decode(encode(told)) == told
    with pytest.raises(GvgbotError, match="damaged"):
        decode(encode(msgspec.structs.replace(told, vertices=crowd)))
