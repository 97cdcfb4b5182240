"""What a drive from vertex to vertex says of the departures, on graphs drawn by hand."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.driven_edges import DrivenEdges
from gvgbot.autonomy.events import ClosureRevoked, DoubtSettled
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local import Branch, LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.start_edge import StartEdge
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.local_graphs import Point, drawn, resampled

EAST, NORTH, WEST = 0, 1, 2  # keys of the half-edges of each vertex

# A street from west to east with side streets to the north at x = 0 (vertex 1) and 5 (vertex 2).
STREET = drawn(
    {1: (0.0, 0.0), 2: (5.0, 0.0), 3: (-4.0, 0.0), 4: (9.0, 0.0), 5: (0.0, 4.0), 6: (5.0, 4.0)},
    {10: (1, 2, []), 11: (3, 1, []), 12: (2, 4, []), 13: (1, 5, []), 14: (2, 6, [])},
)
ALL_SEEN = {
    Branch(10, forward=True): HalfEdgeId(1, EAST),
    Branch(10, forward=False): HalfEdgeId(2, WEST),
    Branch(12, forward=True): HalfEdgeId(2, EAST),
    Branch(13, forward=True): HalfEdgeId(1, NORTH),
    Branch(14, forward=True): HalfEdgeId(2, NORTH),
}

NOBODY = np.empty((0, 2))


class Drive:
    """A robot that has left vertex 1 by an edge, and where that leads."""

    def __init__(self, left: HalfEdgeId) -> None:
        self.mapper = Mapper(MappingConfig(), RecognitionConfig(), ScanMatchingConfig())
        for vertex, x in ((1, 0.0), (2, 5.0)):
            made = Vertex(vertex, 1.0, Pose(x, 0.0, 0.0), 0.0, 0.0)
            for bearing in (0.0, np.pi / 2, np.pi):
                made.add_half_edge(bearing)
            self.mapper.graph.vertices[vertex] = made
            belief, certain = self.mapper.belief, np.diag([1e-6] * 3)
            self.mapper.belief = ekf.add_vertex(belief, vertex, made.local, certain)
        self.where = Whereabouts(left, [np.zeros(2)])
        self.stamp = 0.0
        self.somebody = NOBODY  # where somebody stands
        self.aside = NOBODY  # and where in a team
        self._driven = DrivenEdges(self.mapper)

    @property
    def start(self) -> StartEdge | None:
        return self._driven.start

    @start.setter
    def start(self, edge: StartEdge) -> None:
        self._driven.start = edge

    @property
    def parts(self) -> list[tuple[Array, float]]:
        return self._driven.parts()

    def along(self, gvg: LocalGvg, seen: dict[Branch, HalfEdgeId], *corners: Point) -> "Drive":
        known = Correspondence()
        for branch, end in seen.items():
            known.pair(end.vertex, end.vertex)
            known.pair_branch(branch, end)
        for x, y in resampled(list(corners)):
            base = Pose(float(x), float(y), 0.0)
            walls = LocalMap(LocalMapConfig())
            view = View(
                0, self.stamp, 0.0, base, gvg, walls, doubtful=self.somebody, aside=self.aside
            )
            place = gvg.place(base.position)
            assert place is not None
            self._driven.learn(view, known, place, self.where)
        return self


@pytest.mark.parametrize(("somebody_at_y", "is_one"), [(2.5, True), (1.5, False)])
def test_a_departure_that_leads_where_another_is_known_to_lead_is_that_one(
    somebody_at_y: float, *, is_one: bool
) -> None:
    """By the way on which the robot arrives, an edge comes from the vertex that it has left.

    Not if somebody stands half a metre off its disc: then the way that it left by may be shut.
    """
    drive = Drive(HalfEdgeId(1, NORTH))
    drive.somebody = np.array([[0.0, somebody_at_y]])
    graph = drive.mapper.graph
    graph.join(
        HalfEdgeId(1, EAST),
        HalfEdgeId(2, WEST),
        np.array([[0.0, 0.0], [5.0, 0.0]]),
        1.0,
        driven=True,
    )
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.along(STREET, beyond, (0.0, 0.5), (2.0, 0.0), (6.0, 0.0))
    assert sorted(graph.vertices[1].half_edges) == [EAST, *([] if is_one else [NORTH]), WEST]
    assert len(graph.edges) == 1


@pytest.mark.parametrize("given_up", [HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)], ids=str)
def test_a_way_that_was_given_up_and_is_driven_is_an_edge(given_up: HalfEdgeId) -> None:
    """Somebody stood there, and has gone, or the robot comes from the other side."""
    drive = Drive(HalfEdgeId(1, EAST))
    graph = drive.mapper.graph
    graph.vertices[given_up.vertex].half_edges[given_up.key].blocked = True
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.along(STREET, beyond, (0.5, 0.0), (6.0, 0.0))
    (edge,) = graph.edges.values()
    assert {edge.a, edge.b} == {HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)}
    assert graph.blocked() == []


@pytest.mark.parametrize(
    ("metres", "degree", "is_driven"), [(3.0, 1, True), (1.5, 1, False), (3.0, 2, False)]
)
def test_a_dead_end_is_driven_by_who_is_well_in_it_when_its_end_is_seen(
    metres: float, degree: int, *, is_driven: bool
) -> None:
    """The street is 2 m wide; nobody has been at what else there may be at that end."""
    drive = Drive(HalfEdgeId(1, NORTH))
    graph = drive.mapper.graph
    graph.vertices[5] = Vertex(5, 1.0, Pose(0.0, 4.0, 0.0), 0.0, 0.0)
    for bearing in (-np.pi / 2, 0.0)[:degree]:
        graph.vertices[5].add_half_edge(bearing)
    drive.along(STREET, ALL_SEEN, (0.0, 0.5), (0.0, metres))
    way = np.array([[0.0, 0.0], [0.0, 4.0]])
    edge = graph.join(HalfEdgeId(1, NORTH), HalfEdgeId(5, 0), way, 1.0, driven=False)
    drive.along(STREET, ALL_SEEN, (0.0, metres), (0.0, metres - 0.1))
    assert edge.driven == is_driven


DEAD_END = drawn(
    {1: (0.0, 0.0), 2: (5.0, 0.0), 3: (-4.0, 0.0), 5: (0.0, 4.0)},
    {10: (1, 2, []), 11: (3, 1, []), 13: (1, 5, [])},
)


@pytest.mark.parametrize(("metres", "is_edge"), [(4.8, True), (4.0, False)])
def test_who_has_come_to_a_dead_end_has_driven_the_edge_to_it(
    metres: float, *, is_edge: bool
) -> None:
    """It is seen from end to end, whatever keeps sight from believing it."""
    drive = Drive(HalfEdgeId(1, EAST))
    seen = {branch: end for branch, end in ALL_SEEN.items() if branch.edge == 10}
    drive.along(DEAD_END, seen, (0.5, 0.0), (metres, 0.0))
    edges = drive.mapper.graph.edges.values()
    assert [({e.a, e.b}, e.driven) for e in edges] == [(set(seen.values()), True)] * is_edge


@pytest.mark.parametrize("is_seen", [True, False], ids=["seen", "gone"])
def test_what_was_none_leads_nowhere(*, is_seen: bool) -> None:
    """To the north, where there seemed to be a way, and across to the east, before the vertex."""
    drive = Drive(HalfEdgeId(1, NORTH))
    drive.where.trail = list(resampled([(0.0, 0.0), (0.0, 5.0)]))
    seen = {
        branch: end
        for branch, end in ALL_SEEN.items()
        if end == HalfEdgeId(1, EAST) or (is_seen and end == HalfEdgeId(1, NORTH))
    }
    drive.along(STREET, seen, (1.2, 0.0))
    assert len(drive.mapper.graph.edges) == int(is_seen)


SEEN_SO = drawn(
    {1: (0.0, 0.0), 7: (1.5, 0.0), 2: (3.0, 0.0), 8: (1.5, 2.0)},
    {10: (1, 7, []), 11: (7, 2, []), 15: (7, 8, [])},
)
SEEN_ENDS = {
    Branch(10, forward=True): HalfEdgeId(1, EAST),
    Branch(11, forward=False): HalfEdgeId(2, WEST),
}


@pytest.mark.parametrize(("period", "is_edge"), [(5.0, True), (1.0, False)])
def test_who_drives_to_and_fro_between_two_ends_has_driven_an_edge(
    period: float, *, is_edge: bool
) -> None:
    """What seems to be a vertex is between them. Once a second, that it drives so only seems so."""
    drive = Drive(HalfEdgeId(1, EAST))
    for _ in range(4):
        assert drive.mapper.graph.edges == {}
        drive.along(SEEN_SO, SEEN_ENDS, (0.5, 0.0), (2.5, 0.0))
        drive.stamp += period
        drive.where = Whereabouts(HalfEdgeId(1, EAST), [np.zeros(2)])
    joined = [{edge.a, edge.b} for edge in drive.mapper.graph.edges.values()]
    assert joined == ([{HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)}] if is_edge else [])


def test_who_comes_along_an_edge_that_was_opened_again_has_driven_it() -> None:
    """At once, and for good."""
    drive, ends = Drive(HalfEdgeId(1, EAST)), (HalfEdgeId(1, EAST), HalfEdgeId(2, WEST))
    graph, line = drive.mapper.graph, np.array([[0.0, 0.0], [3.0, 0.0]])
    assert drive.mapper.reopen(graph.join(*ends, line, 1.0, driven=False))
    drive.along(SEEN_SO, SEEN_ENDS, (0.5, 0.0), (2.5, 0.0))
    (edge,) = graph.edges.values()
    assert ({edge.a, edge.b}, edge.driven) == (set(ends), True)
    assert not drive.mapper.reopen(edge)
    assert graph.edges == {edge.id: edge}


@pytest.mark.parametrize("all_seen", [False, True])
def test_who_comes_back_to_a_vertex_round_a_loop_need_not_see_by_where_it_left(
    *, all_seen: bool
) -> None:
    """To the east and round to the north of vertex 1; the laser does not look to the east yet."""
    ahead = drawn(
        {1: (0.0, 0.0), 5: (0.0, 4.0)}, {13: (1, 5, [])}, unseen={} if all_seen else {1: 0.0}
    )
    drive = Drive(HalfEdgeId(1, EAST))
    loop = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 1.0)]
    drive.where.trail = list(resampled(loop))
    drive.along(ahead, {Branch(13, forward=True): HalfEdgeId(1, NORTH)}, (0.0, 1.0))
    joined = [{edge.a, edge.b} for edge in drive.mapper.graph.edges.values()]
    loops = [{HalfEdgeId(1, EAST), HalfEdgeId(1, NORTH)}]
    assert joined == ([] if all_seen else loops)


def test_who_turns_round_where_a_vertex_proves_to_be_none_comes_from_the_one_before() -> None:
    """While it turns, it learns nothing of where it is: that comes several views later."""
    drive = Drive(HalfEdgeId(2, NORTH))
    drive.where.trail = [np.array([5.0, 0.0])]
    graph, line = drive.mapper.graph, np.array([[0.0, 0.0], [5.0, 0.0]])
    graph.join(HalfEdgeId(1, EAST), HalfEdgeId(2, WEST), line, 1.0, driven=True)
    drive.mapper.move(Pose(5.0, 0.0), np.zeros((3, 3)))
    beside = View(0, 0.0, 0.0, Pose(5.0, 0.0), STREET, LocalMap(LocalMapConfig()))
    drive.mapper.remove(beside, graph.vertices[2], "an edge passes here")
    drive.mapper.observe(replace(beside, gvg=LocalGvg()))
    drive.along(STREET, {}, (5.0, 0.0), (5.0, 1.0))
    assert drive.where.on_edge == HalfEdgeId(1, EAST)
    assert drive.where.trail_length == pytest.approx(6.0, abs=0.1)


def with_north(drive: Drive, key: int, base: Pose) -> None:
    """Let a departure of vertex 2 lead north, to vertex 3, and the robot be at `base`."""
    graph, north = drive.mapper.graph, Vertex(3, 1.0, Pose(5.0, 8.0, 0.0), 0.0, 0.0)
    graph.vertices[3], graph.serial = north, 3
    ends = HalfEdgeId(2, key), HalfEdgeId(3, north.add_half_edge(-np.pi / 2))
    graph.join(*ends, resampled([(0.0, 0.0), (0.0, 8.0)]), 1.0, driven=True)
    drive.mapper.belief = ekf.add_vertex(drive.mapper.belief, 3, north.local, 1e-4 * np.eye(3))
    drive.mapper.move(base, np.zeros((3, 3)))


@pytest.mark.parametrize("west", [0.0, 2.0])
def test_where_the_robot_came_onto_a_known_edge_is_a_vertex_that_it_missed(west: float) -> None:
    """From vertex 1 to the north and east, and down the side street to vertex 2."""
    drive = Drive(HalfEdgeId(1, NORTH))
    with_north(drive, NORTH, Pose(5.0, 1.0))
    drive.where.trail = list(resampled([(0.0, 0.0), (west, 4.0), (5.0, 4.0), (5.0, 1.0)]))
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.along(STREET, beyond, (5.0, 1.0))
    graph = drive.mapper.graph
    (missed,) = (vertex for vertex in graph.vertices.values() if vertex.id not in (1, 2, 3))
    place = drive.mapper.belief.map_vertex(missed.id)
    assert (place.x, place.y) == pytest.approx((5.0, 4.0), abs=0.3)
    assert {frozenset((e.a.vertex, e.b.vertex)) for e in graph.edges.values()} == {
        frozenset((missed.id, neighbour)) for neighbour in (1, 2, 3)
    }
    assert graph.edge_at(HalfEdgeId(1, NORTH)) is not None


def test_a_way_that_only_ends_at_a_known_edge_is_no_fork_of_it() -> None:
    """To vertex 2 from the west, where its edge to the north is thought to begin."""
    drive = Drive(HalfEdgeId(1, NORTH))
    with_north(drive, WEST, Pose(4.0, 0.0))
    drive.where.trail = list(resampled([(0.0, 0.0), (0.0, 3.0), (2.5, 0.0), (4.0, 0.0)]))
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.along(STREET, beyond, (4.0, 0.0))
    assert sorted(drive.mapper.graph.vertices) == [1, 2, 3]
    assert len(drive.mapper.graph.edges) == 1


@pytest.mark.parametrize("is_hidden", [False, True])
def test_a_known_edge_that_passes_the_vertex_that_was_left_has_one_of_its_ends_there(
    *, is_hidden: bool
) -> None:
    """From vertex 2 to a vertex in the west it was taken for one edge, past vertex 1.

    Of that, somebody may have hidden the departure to the west so far.
    """
    drive = Drive(HalfEdgeId(1, EAST))
    if is_hidden:
        drive.mapper.graph.remove_half_edge(HalfEdgeId(1, WEST))
    graph, west = drive.mapper.graph, Vertex(3, 1.0, Pose(-5.0, 0.0, 0.0), 0.0, 0.0)
    graph.vertices[3], graph.serial = west, 3
    ends = HalfEdgeId(2, WEST), HalfEdgeId(3, west.add_half_edge(0.0))
    graph.join(*ends, resampled([(0.0, 0.0), (-10.0, 0.0)]), 1.0, driven=True)
    drive.mapper.belief = ekf.add_vertex(drive.mapper.belief, 3, west.local, 1e-4 * np.eye(3))
    drive.mapper.move(Pose(4.0, 0.0), np.zeros((3, 3)))
    drive.where.trail = list(resampled([(0.0, 0.0), (4.0, 0.0)]))
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.along(STREET, beyond, (4.0, 0.0))
    joined = {frozenset((edge.a, edge.b)) for edge in graph.edges.values()}
    (beyond_it,) = (key for key in graph.vertices[1].half_edges if key not in (EAST, NORTH))
    assert joined == {
        frozenset((HalfEdgeId(1, EAST), HalfEdgeId(2, WEST))),
        frozenset((HalfEdgeId(1, beyond_it), HalfEdgeId(3, 0))),
    }
    assert abs(graph.vertices[1].half_edges[beyond_it].bearing) == pytest.approx(np.pi)


def test_a_part_of_an_edge_is_kept_until_all_of_it_is_driven() -> None:
    drive = Drive(HalfEdgeId(1, EAST))
    assert drive.parts == []
    drive.along(STREET, {}, (0.0, 0.0), (3.0, 0.0), (1.0, 0.0))  # to and fro
    ((line, _),) = drive.parts
    assert np.ptp(line[:, 0]) == pytest.approx(3.0, abs=0.2)
    assert np.abs(line[:, 1]).max() < 0.01
    drive.along(STREET, ALL_SEEN, (3.0, 0.0), (6.0, 0.0))
    assert len(drive.mapper.graph.edges) == 1
    ((line, _),) = drive.parts  # of the edge beyond vertex 2
    assert line[[0, -1], 0] == pytest.approx([5.0, 6.0], abs=0.2)


def test_what_was_driven_from_a_vertex_that_was_none_was_driven_all_the_same() -> None:
    drive = Drive(HalfEdgeId(1, EAST)).along(STREET, {}, (0.0, 0.0), (3.0, 0.0))
    before = drive.parts
    del drive.mapper.graph.vertices[1]
    drive.along(STREET, {}, (3.0, 0.0), (3.1, 0.0))
    (line, clearance), (known, before_clearance) = drive.parts[0], before[0]
    np.testing.assert_array_equal(line, known)
    assert clearance == before_clearance
    drive.along(STREET, {}, (3.1, 0.0), (4.5, 0.0))
    assert max(np.ptp(line[:, 0]) for line, _ in drive.parts) == pytest.approx(4.5, abs=0.2)
    drive.where.on_edge, drive.where.trail = HalfEdgeId(2, EAST), [np.array([5.0, 0.0])]
    drive.along(STREET, {}, (5.2, 0.0), (6.0, 0.0))  # a vertex has been found, and left
    assert max(np.ptp(line[:, 0]) for line, _ in drive.parts) == pytest.approx(4.5, abs=0.2)


def test_what_was_driven_before_it_turned_round_was_driven() -> None:
    drive = Drive(HalfEdgeId(1, EAST))
    drive.where.on_edge, drive.where.trail = None, []
    drive.along(STREET, {}, (1.0, 0.0), (4.0, 0.0))
    drive.where.turn_round()
    drive.along(STREET, {}, (3.8, 0.0), (3.4, 0.0))
    longest = max(drive.parts, key=lambda part: float(np.ptp(part[0][:, 0])))[0]
    assert np.ptp(longest[:, 0]) == pytest.approx(3.0, abs=0.2)


def with_one_between(drive: Drive, *, leads_on: bool = True) -> Vertex:
    """Let a vertex 3 lie between vertices 1 and 2, beside the street; does it lead on to 2?"""
    graph, between = drive.mapper.graph, Vertex(3, 1.0, Pose(2.5, -0.7, 0.0), 0.0, 0.0)
    graph.vertices[3], graph.serial = between, 3
    west, east, _ = (between.add_half_edge(bearing) for bearing in (np.pi, 0.0, -np.pi / 2))
    drive.mapper.belief = ekf.add_vertex(drive.mapper.belief, 3, between.local, 1e-4 * np.eye(3))
    halves = (HalfEdgeId(1, EAST), HalfEdgeId(3, west)), (HalfEdgeId(3, east), HalfEdgeId(2, WEST))
    lines = [(0, 0), (2.5, -0.7)], [(0, 0), (2.5, 0.7)]
    for ends, line in list(zip(halves, lines, strict=True))[: 1 + leads_on]:
        graph.join(*ends, resampled(line), 1.0, driven=False)
    return between


@pytest.mark.parametrize("established", [False, True])
def test_a_vertex_that_it_drives_past_again_and_again_is_none(*, established: bool) -> None:
    """Between vertices 1 and 2 one was seen, with a way to the south; the street leads past it."""
    drive = Drive(HalfEdgeId(1, EAST))
    graph = drive.mapper.graph
    with_one_between(drive).established = established
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    for _ in range(3):
        assert 3 in graph.vertices
        drive.where = Whereabouts(HalfEdgeId(1, EAST), [np.zeros(2)])
        drive.along(STREET, beyond, (0.5, 0.0), (6.0, 0.0))
    assert (3 in graph.vertices) == established
    if not established:
        (edge,) = graph.edges.values()
        assert {edge.a, edge.b} == {HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)}


@pytest.mark.parametrize("in_team", [False, True])
def test_a_vertex_at_which_somebody_stands_is_not_driven_past(*, in_team: bool) -> None:
    """He hides it; in a team he is nothing that edges lead round."""
    drive = Drive(HalfEdgeId(1, EAST))
    between = with_one_between(drive)
    somebody = between.local.position[None] + [0.3, 0.5]
    drive.aside, drive.somebody = (somebody, NOBODY) if in_team else (NOBODY, somebody)
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    for _ in range(5):
        drive.where = Whereabouts(HalfEdgeId(1, EAST), [np.zeros(2)])
        drive.along(STREET, beyond, (0.5, 0.0), (6.0, 0.0))
    assert 3 in drive.mapper.graph.vertices


def has_driven_past(drive: Drive) -> Drive:
    """From vertex 1, where a loop was closed, past vertex 3 towards vertex 2."""
    vertices = drive.mapper.graph.vertices
    drive.mapper.unsettled.note_closure(vertices[1], is_surprising=True)
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    return drive.along(STREET, beyond, (0.5, 0.0), (4.0, 0.0))


@pytest.mark.parametrize("leads_on", [True, False])
def test_a_way_that_misses_a_vertex_and_comes_to_the_next_one_does_not_speak_against_a_closure(
    *, leads_on: bool
) -> None:
    """Somebody may have stood there. Where it is not known to lead to the next one, it does."""
    drive = Drive(HalfEdgeId(1, EAST))
    with_one_between(drive, leads_on=leads_on)
    events = has_driven_past(drive).mapper.unsettled.revoke(1.0)
    assert [type(event) for event in events] == ([] if leads_on else [ClosureRevoked])


def test_who_comes_back_over_an_edge_has_not_come_to_its_end() -> None:
    """From vertex 1, where a loop was closed, three metres to the north, back, and to the east.

    The edge to the north is eight metres long: that it is there speaks neither for the closure nor
    against it, and at its end the robot has not been.
    """
    drive = Drive(HalfEdgeId(1, NORTH))
    vertices, unsettled = drive.mapper.graph.vertices, drive.mapper.unsettled
    vertices[3] = north = Vertex(3, 1.0, Pose(0.0, 8.0, 0.0), 0.0, 0.0)
    ends = HalfEdgeId(1, NORTH), HalfEdgeId(3, north.add_half_edge(-np.pi / 2))
    line = resampled([(0.0, 0.0), (0.0, 8.0)])
    edge = drive.mapper.graph.join(*ends, line, 1.0, driven=False)
    unsettled.note_closure(vertices[1], is_surprising=True)
    drive.along(STREET, ALL_SEEN, (0.0, 0.0), (0.0, 3.0), (0.0, 0.0), (1.5, 0.0))
    assert edge.traversals == 0
    assert unsettled.revoke(1.0) == []
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert [type(event) for event in unsettled.revoke(2.0)] == [ClosureRevoked]


def test_who_comes_round_to_where_it_left_has_not_seen_where_the_edge_ends() -> None:
    """From vertex 1, where a loop was closed, to the east and round to the north of it.

    The edge to the east is known to end at vertex 2, which may have been hidden, or be elsewhere.
    """
    drive = Drive(HalfEdgeId(1, EAST))
    graph, unsettled = drive.mapper.graph, drive.mapper.unsettled
    ends = HalfEdgeId(1, EAST), HalfEdgeId(2, WEST)
    edge = graph.join(*ends, resampled([(0.0, 0.0), (5.0, 0.0)]), 1.0, driven=False)
    unsettled.note_closure(graph.vertices[1], is_surprising=True)
    loop = [(0.0, 0.0), (7.0, 0.0), (7.0, 4.0), (0.0, 4.0), (0.0, 1.0)]
    drive.where.trail = list(resampled(loop))
    drive.along(STREET, {Branch(13, forward=True): HalfEdgeId(1, NORTH)}, (0.0, 1.0))
    assert drive.where.on_edge == HalfEdgeId(1, NORTH)
    assert unsettled.revoke(1.0) == []
    unsettled.note_way(edge, arrived=99)  # not at its far end
    assert [type(event) for event in unsettled.revoke(2.0)] == [ClosureRevoked]


def test_who_looks_into_two_ways_again_and_again_has_not_driven_from_one_into_the_other() -> None:
    """To the north and back to vertex 1, to the east and back: these are two frontiers."""
    drive = Drive(HalfEdgeId(1, NORTH))
    at_1 = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 1}
    for _ in range(5):
        drive.stamp += 10.0
        drive.along(STREET, at_1, (0.0, 0.3), (0.0, 2.0), (0.0, 0.3), (0.3, 0.0))
        drive.along(STREET, at_1, (0.3, 0.0), (2.0, 0.0), (0.3, 0.0), (0.0, 0.3))
    assert drive.mapper.graph.edges == {}


def test_a_way_to_what_may_be_its_known_end_speaks_against_a_closure_once_that_is_another() -> None:
    """Vertex 2 may be vertex 3; both are known to centimetres, and stand metres apart."""
    drive = Drive(HalfEdgeId(1, EAST))
    with_one_between(drive, leads_on=False)
    unsettled, arrived = drive.mapper.unsettled, drive.mapper.graph.vertices[2]
    unsettled.doubt(arrived, Recognition(None, (3,), (5.0,), 0.02, 9.0), 0.0)
    has_driven_past(drive)
    assert unsettled.revoke(1.0) == []
    (settled,) = unsettled.settle(2.0)
    assert isinstance(settled, DoubtSettled)
    assert (settled.vertex, settled.known) == (2, None)
    assert [type(event) for event in unsettled.revoke(3.0)] == [ClosureRevoked]


@pytest.mark.parametrize("onwards", [0.3, -np.pi / 2], ids=["east", "south"])
def test_past_a_vertex_that_it_did_not_find_it_came_by_the_way_on_from_there(
    onwards: float,
) -> None:
    """The way from vertex 1 is known to end at vertex 3; the robot drives on to vertex 2."""
    drive = Drive(HalfEdgeId(1, EAST))
    graph, between = drive.mapper.graph, Vertex(3, 1.0, Pose(2.0, -0.5, 0.0), 0.0, 0.0)
    graph.vertices[3], graph.serial = between, 3
    west, way_on, _ = (between.add_half_edge(bearing) for bearing in (np.pi, onwards, np.pi / 2))
    drive.mapper.belief = ekf.add_vertex(drive.mapper.belief, 3, between.local, 1e-4 * np.eye(3))
    to_it = resampled([(0.0, 0.0), (2.0, -0.5)])
    graph.join(HalfEdgeId(1, EAST), HalfEdgeId(3, west), to_it, 1.0, driven=False)
    beyond = {branch: end for branch, end in ALL_SEEN.items() if end.vertex == 2}
    drive.mapper.move(Pose(4.0, 0.0), np.zeros((3, 3)))
    drive.where.trail = list(resampled([(0.0, 0.0), (4.0, 0.0)]))
    drive.along(STREET, beyond, (4.0, 0.0))
    edge = graph.edge_at(HalfEdgeId(2, WEST))
    if onwards < 0.0:
        assert edge is None
    else:
        assert edge is not None
        assert edge.other(HalfEdgeId(2, WEST)) == HalfEdgeId(3, way_on)
        assert edge.length == pytest.approx(3.0, abs=0.3)


@pytest.mark.parametrize("narrow_at_first", [True, False])
def test_who_comes_round_to_where_it_started_need_not_drive_the_first_half_of_that_edge_again(
    *, narrow_at_first: bool
) -> None:
    """A way of 33 m leads from vertex 2 round to vertex 1; the robot has begun 3 m before that.

    One half of it is narrower than the other one.
    """
    corners = [(9.0, 0.0), (9.0, -6.0), (-4.0, -6.0), (-4.0, 0.0)]
    ring = drawn(
        {1: (0.0, 0.0), 2: (5.0, 0.0), 5: (0.0, 4.0), 6: (5.0, 4.0)},
        {10: (1, 2, []), 13: (1, 5, []), 14: (2, 6, []), 20: (2, 1, corners)},
    )
    drive = Drive(HalfEdgeId(1, EAST))
    drive.where = Whereabouts()
    west, east = HalfEdgeId(1, WEST), HalfEdgeId(2, EAST)
    first = {Branch(20, forward=False): west, Branch(10, forward=True): HalfEdgeId(1, EAST)}
    second = {Branch(10, forward=False): HalfEdgeId(2, WEST), Branch(20, forward=True): east}
    drive.along(ring, {}, (-3.0, 0.0), (-1.0, 0.0)).along(ring, first, (-1.0, 0.0), (2.0, 0.0))
    assert drive.start is not None
    drive.start = replace(drive.start, narrowest=0.3 if narrow_at_first else 0.8)
    drive.along(ring, second, (2.0, 0.0), (7.0, 0.0))
    drive.where.narrowest = 0.8 if narrow_at_first else 0.3
    drive.along(ring, {}, (7.0, 0.0), *corners[:3], (-4.0, -0.6))
    graph = drive.mapper.graph
    assert {graph.edge_at(west), graph.edge_at(east)} == {None}
    drive.mapper.belief.x[:2] = -3.0, 0.0
    drive.along(ring, {}, (-4.0, 0.0), (-3.0, 0.0))
    edge = graph.edge_at(west)
    assert edge is not None
    assert edge is graph.edge_at(east)
    assert edge.length == pytest.approx(33.0, abs=1.0)
    assert edge.min_clearance == 0.3
