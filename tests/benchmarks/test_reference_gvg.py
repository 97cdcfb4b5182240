"""The reference GVG of worlds whose GVG geometry tells."""

import heapq
import math
from dataclasses import replace
from itertools import count

import networkx as nx
import numpy as np
import pytest

from benchmarks.reference_gvg import Reference, reference_gvg
from gvgbot.drivers.world import World
from gvgbot.errors import WorldError
from gvgbot.worlds import builtin
from gvgbot.worlds.canvas import Canvas

RADIUS = 0.18
CELL = 0.05


def plus() -> Canvas:
    """Two corridors of two metres that cross at (8, 8), each ending 6 m from there."""
    canvas = Canvas(16.0, 16.0)
    canvas.carve(7.0, 2.0, 9.0, 14.0)
    canvas.carve(2.0, 7.0, 14.0, 9.0)
    return canvas


def alcove(depth: float) -> Canvas:
    """A corridor of two metres along y = 2 with an alcove as wide in the middle of one side."""
    canvas = Canvas(20.0, 12.0)
    canvas.carve(1.0, 1.0, 19.0, 3.0)
    canvas.carve(9.0, 3.0, 11.0, 3.0 + depth)
    return canvas


def vertices(reference: Reference) -> dict[tuple[float, float], tuple[int, bool]]:
    """Degree and whether it is required, by place to a decimetre."""
    graph = reference.graph
    return {
        (round(float(x), 1) + 0.0, round(float(y), 1) + 0.0): (graph.degree(node), required)
        for node, required in graph.nodes(data="is_required")
        for x, y in [graph.nodes[node]["position"]]
    }


def gvg(canvas: Canvas, start: tuple[float, float]) -> Reference:
    return reference_gvg(canvas.world("drawn"), start, RADIUS)


PLUS = {
    (8.0, 8.0): (4, True),  # the crossing; dead ends end where their end wall is as near as sides
    **dict.fromkeys(((3.0, 8.0), (13.0, 8.0), (8.0, 3.0), (8.0, 13.0)), (1, True)),
}


def test_two_corridors_cross_in_their_middle_and_end_at_equal_distance_of_three_walls() -> None:
    reference = gvg(plus(), (8.0, 4.0))
    assert vertices(reference) == PLUS
    assert reference.length == pytest.approx(4 * 5.0, abs=2 * CELL)


def test_the_clearance_is_the_distance_of_the_centres_of_wall_cells() -> None:
    graph = gvg(plus(), (8.0, 4.0)).graph
    clearances = {graph.degree(node): data["clearance"] for node, data in graph.nodes.items()}
    assert clearances[4] == pytest.approx(math.hypot(1.0 + CELL / 2, 1.0 + CELL / 2))
    assert clearances[1] == pytest.approx(1.0 + CELL / 2, abs=1e-3)


def test_a_rooms_meetpoints_are_as_far_from_both_ends_as_from_the_sides() -> None:
    canvas = Canvas(8.0, 6.0)
    canvas.carve(1.0, 1.0, 7.0, 5.0)
    meetpoints = gvg(canvas, (4.0, 3.0)).meetpoints
    assert np.unique(meetpoints.round(1), axis=0).tolist() == [[3.0, 3.0], [5.0, 3.0]]


@pytest.mark.parametrize("size", [0.1, 0.2])
def test_coarse_cells_give_the_same_graph(size: float) -> None:
    world = plus().world("fine")
    step = round(size / CELL)
    coarse = World(world.occupied[::step, ::step].copy(), size)
    assert vertices(reference_gvg(coarse, (8.0, 4.0), RADIUS)) == PLUS


def test_a_world_elsewhere_has_its_graph_there() -> None:
    moved = replace(plus().world("moved"), origin=(-10.0, 100.0))
    places = vertices(reference_gvg(moved, (-2.0, 104.0), RADIUS))
    assert places == {(x - 10.0, y + 100.0): kind for (x, y), kind in PLUS.items()}


def test_walls_at_an_angle_to_the_cells_do_not_bristle() -> None:
    canvas = Canvas(20.0, 20.0)
    y, x = (np.mgrid[:400, :400] + 0.5) * CELL - 10.0
    for angle in (0.3, 0.3 + math.pi / 2):
        along = x * math.cos(angle) + y * math.sin(angle)
        across = y * math.cos(angle) - x * math.sin(angle)
        canvas.occupied &= ~((abs(along) < 8.0) & (abs(across) < 1.0))
    turned = gvg(canvas, (10.0, 10.0))
    assert sorted(vertices(turned).values()) == [(1, True)] * 4 + [(4, True)]
    assert turned.length == pytest.approx(4 * 7.0, abs=0.3)


def test_only_the_free_space_of_the_start_counts() -> None:
    canvas = plus()
    canvas.carve(0.5, 0.5, 5.0, 1.5)
    assert vertices(gvg(canvas, (8.0, 4.0))) == PLUS


def test_a_gap_too_narrow_for_the_robot_is_no_way() -> None:
    canvas = plus()
    canvas.carve(10.0, 9.0, 10.25, 12.0)  # leads away from the corridor, and nowhere else
    canvas.carve(10.0, 12.0, 15.0, 14.0)
    assert vertices(gvg(canvas, (8.0, 4.0))) == PLUS


@pytest.mark.parametrize("thickness", [1, 2, 5])
@pytest.mark.parametrize(("width", "is_way"), [(0.3, False), (0.35, False), (0.4, True)])
def test_the_robot_fits_through_a_gap_that_is_wider_than_itself(
    thickness: int, width: float, *, is_way: bool
) -> None:
    canvas = Canvas(14.0, 4.0)
    canvas.carve(1.0, 1.0, 13.0, 3.0)
    canvas.build(7.0, 1.0, 7.0 + thickness * CELL, 3.0)
    canvas.carve(7.0, 2.0 - width / 2, 7.0 + thickness * CELL, 2.0 + width / 2)
    places = vertices(gvg(canvas, (3.0, 2.0)))
    assert any(x > 7.5 for x, _ in places) == is_way


def test_a_ring_has_no_required_vertex_and_its_length() -> None:
    canvas = Canvas(16.0, 16.0)
    canvas.carve_disc(8.0, 8.0, 7.0)
    canvas.build_disc(8.0, 8.0, 5.0)
    ring = gvg(canvas, (14.0, 8.0))
    ((place, kind),) = vertices(ring).items()
    assert math.dist(place, (14.0, 8.0)) < 0.2
    assert kind == (2, False)
    assert ring.length == pytest.approx(math.tau * 6.0, rel=0.02)
    assert ring.tour_length((14.0, 8.0)) == pytest.approx(ring.length)


def test_a_square_room_has_a_vertex_and_nothing_that_a_map_must_have() -> None:
    canvas = Canvas(6.0, 6.0)
    canvas.carve(1.0, 1.0, 5.0, 5.0)
    room = gvg(canvas, (2.0, 2.0))
    assert vertices(room) == {(3.0, 3.0): (0, False)}
    assert room.tour_length((2.0, 2.0)) == 0.0


def test_a_closet_has_no_graph() -> None:
    canvas = Canvas(2.0, 2.0)
    canvas.carve(0.8, 0.8, 1.2, 1.2)
    closet = gvg(canvas, (1.0, 1.0))
    assert (vertices(closet), closet.length, closet.tour_length((1.0, 1.0))) == ({}, 0.0, 0.0)


@pytest.mark.parametrize(
    ("depth", "kinds"),
    [
        # The corridor's middle is 1 m from its walls and hypot(1, 1) m from the corners of an
        # alcove as wide, where the branch begins; with its depth d the reach is (d + 1) / 1.41.
        (1.1, [(1, True), (1, True)]),
        (1.7, [(1, False), (1, True), (1, True), (3, False)]),
        (3.0, [(1, True), (1, True), (1, True), (3, True)]),
    ],
)
def test_an_alcove_is_a_corner_or_optional_or_a_dead_end_by_its_reach(
    depth: float, kinds: list[tuple[int, bool]]
) -> None:
    assert sorted(vertices(gvg(alcove(depth), (3.0, 2.0))).values()) == kinds


@pytest.mark.parametrize(("shift", "degrees"), [(0.3, [4]), (1.0, [3, 3])])
def test_meetpoints_that_almost_coincide_are_one(shift: float, degrees: list[int]) -> None:
    canvas = Canvas(16.0, 16.0)
    canvas.carve(1.0, 7.0, 15.0, 9.0)
    canvas.carve(7.0, 9.0, 9.0, 15.0)
    canvas.carve(7.0 + shift, 1.0, 9.0 + shift, 7.0)
    graph = gvg(canvas, (3.0, 8.0)).graph
    assert sorted(degree for _, degree in graph.degree if degree > 1) == degrees


@pytest.mark.parametrize("start", [(1.0, 1.0), (-3.0, 8.0), (7.05, 4.0)])
def test_a_start_without_room_is_refused(start: tuple[float, float]) -> None:
    with pytest.raises(WorldError, match="start"):
        gvg(plus(), start)


def test_a_mirrored_building_has_the_mirrored_graph() -> None:
    world, start = builtin("floor_plan:3")
    mirrored = World(world.occupied[:, ::-1].copy(), world.resolution_m)
    width = world.extent[2]
    there = reference_gvg(world, (start.x, start.y), RADIUS).graph
    back = reference_gvg(mirrored, (width - start.x, start.y), RADIUS).graph
    one, other = (
        np.array([(*d["position"], g.degree(n), d["is_required"]) for n, d in g.nodes.items()])
        for g in (there, back)
    )
    other[:, 0] = width - other[:, 0]
    assert len(one) == len(other)
    for row in one:
        assert np.abs(other - row).max(axis=1).min() < 1e-6


def test_the_tour_begins_at_the_start_and_ends_where_it_likes() -> None:
    reference = gvg(plus(), (8.0, 4.0))
    # From the end of an arm of 5 m: all arms once, two of them back again.
    assert reference.tour_length((8.0, 2.5)) == pytest.approx(6 * 5.0, abs=4 * CELL)
    # One metre into an arm: that metre is driven twice.
    assert reference.tour_length((8.0, 4.0)) == pytest.approx(6 * 5.0 + 1.0, abs=4 * CELL)
    # From the crossing: three arms there and back, the last one only there.
    assert reference.tour_length((8.0, 8.0)) == pytest.approx(7 * 5.0, abs=4 * CELL)


@pytest.mark.parametrize("seed", range(12))
def test_no_search_finds_a_shorter_tour(seed: int) -> None:
    graph = random_multigraph(np.random.default_rng(seed))
    for start in graph:
        x, y = graph.nodes[start]["position"]
        tour = Reference(graph).tour_length((float(x), float(y)))
        assert tour == pytest.approx(searched_tour(graph, start))


def random_multigraph(rng: np.random.Generator) -> nx.MultiGraph:
    """Connected, with edges that bend, parallel ones and at times a loop."""
    graph = nx.MultiGraph()
    places = rng.uniform(0.0, 10.0, (5, 2))
    for node, place in enumerate(places):
        graph.add_node(node, position=place)
    ends = [(int(rng.integers(node)), node) for node in range(1, 5)]
    ends += [(int(a), int(b)) for a, b in rng.integers(5, size=(3, 2))]
    for a, b in ends:
        line = np.array([places[a], rng.uniform(20.0, 30.0, 2), places[b]])
        length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        graph.add_edge(a, b, line=line, length=length)
    return graph


def searched_tour(graph: nx.MultiGraph, start: int) -> float:
    """The shortest open tour by Dijkstra's search over places and edges driven."""
    edges = list(graph.edges(data="length"))
    serial = count()
    queue = [(0.0, next(serial), start, frozenset[int]())]
    best: dict[tuple[int, frozenset[int]], float] = {}
    while True:
        metres, _, here, driven = heapq.heappop(queue)
        if len(driven) == len(edges):
            return metres
        if best.get((here, driven), math.inf) <= metres:
            continue
        best[here, driven] = metres
        for k, (a, b, length) in enumerate(edges):
            for one, other in ((a, b), (b, a)):
                if one == here:
                    entry = (metres + length, next(serial), other, driven | {k})
                    heapq.heappush(queue, entry)
