"""What is closed is opened again in time, so many times and no more."""

from gvgbot.autonomy.exploration.obstructions import Obstructions
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId, Vertex
from gvgbot.autonomy.slam.names import Names
from gvgbot.geometry import Pose


def graph_with_a_frontier() -> tuple[GvgGraph, HalfEdgeId]:
    graph = GvgGraph()
    vertex = Vertex(graph.next_id(), clearance=1.0, local=Pose(), seen_at=0.0, updated_at=0.0)
    graph.vertices[vertex.id] = vertex
    return graph, HalfEdgeId(vertex.id, vertex.add_half_edge(0.0))


def test_a_closed_frontier_is_none_until_it_is_opened() -> None:
    graph, end = graph_with_a_frontier()
    obstructions = Obstructions(retries=1, retry_after=20.0, names=Names())
    obstructions.close(graph, [end], 100.0)
    assert graph.frontiers() == []
    assert not obstructions.open(graph, 119.0)
    assert obstructions.waiting
    assert obstructions.open(graph, 120.0)
    assert graph.frontiers() == [end]
    assert not obstructions.waiting


def test_after_its_retries_it_stays_closed() -> None:
    graph, end = graph_with_a_frontier()
    obstructions = Obstructions(retries=2, retry_after=20.0, names=Names())
    for stamp in (0.0, 100.0):
        obstructions.close(graph, [end], stamp)
        assert obstructions.open(graph, stamp + 50.0)
    obstructions.close(graph, [end], 200.0)
    assert not obstructions.waiting
    assert not obstructions.open(graph, 1e6)
    assert graph.blocked() == [end]


def test_each_has_retries_of_its_own() -> None:
    graph, end = graph_with_a_frontier()
    other = HalfEdgeId(end.vertex, graph.vertices[end.vertex].add_half_edge(1.0))
    obstructions = Obstructions(retries=1, retry_after=20.0, names=Names())
    for k, one in enumerate((end, other)):
        obstructions.close(graph, [one], 100.0 * k)
        assert obstructions.open(graph, 100.0 * k + 50.0)
    assert graph.frontiers() == [end, other]


def test_an_end_that_is_gone_is_not_waited_for() -> None:
    graph, end = graph_with_a_frontier()
    obstructions = Obstructions(retries=2, retry_after=20.0, names=Names())
    obstructions.close(graph, [end], 0.0)
    graph.remove_vertex(end.vertex)
    obstructions.open(graph, 50.0)
    assert not obstructions.waiting
    obstructions.close(graph, [end], 60.0)
    assert not obstructions.waiting


def test_some_are_opened_less_often_than_others() -> None:
    graph, end = graph_with_a_frontier()
    obstructions = Obstructions(retries=3, retry_after=20.0, names=Names())
    obstructions.close(graph, [end], 0.0, retries=1)
    assert obstructions.open(graph, 50.0)
    obstructions.close(graph, [end], 100.0, retries=1)
    assert not obstructions.waiting
    assert graph.blocked() == [end]
