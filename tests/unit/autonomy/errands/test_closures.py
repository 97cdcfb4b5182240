"""Ways that are closed for a while."""

import math

from gvgbot.autonomy.errands.closures import Closures
from gvgbot.autonomy.slam.graph import HalfEdgeId
from gvgbot.autonomy.slam.names import Names
from gvgbot.autonomy.topology import fuse
from gvgbot.geometry import Pose
from tests.unit.autonomy.graphs import between, streets


def test_what_was_closed_is_open_again_when_its_time_is_over_and_not_before() -> None:
    graph, ids = streets(2, 2)
    closures = Closures(Names())
    one, other = (between(graph, ids[0, 0], ids[place]) for place in ((1, 0), (0, 1)))
    closures.close(graph, [one], until=100.0)
    closures.close(graph, [other], until=200.0)
    closures.open_due(graph, 99.9)
    assert set(graph.blocked()) == {one, other}
    closures.open_due(graph, 100.0)
    assert graph.blocked() == [other]
    assert closures.open_all(graph)
    assert graph.blocked() == []
    assert not closures.open_all(graph)


def test_what_exploring_has_given_up_stays_so() -> None:
    graph, ids = streets(2, 1)
    end = between(graph, ids[0, 0], ids[1, 0])
    graph.vertices[end.vertex].half_edges[end.key].blocked = True
    closures = Closures(Names())
    closures.close(graph, [end], until=1.0)
    closures.open_due(graph, 2.0)
    assert graph.blocked() == [end]


def test_an_edge_may_vanish_while_it_is_closed() -> None:
    graph, ids = streets(2, 1)
    end = between(graph, ids[0, 0], ids[1, 0])
    closures = Closures(Names())
    closures.close(graph, [end], until=1.0)
    graph.remove_vertex(end.vertex)
    closures.open_due(graph, 2.0)
    assert closures.until == {}


def test_a_way_closed_at_a_vertex_that_proves_to_be_a_known_one_opens_when_its_time_comes() -> None:
    graph, ids = streets(2, 1)
    kept, gone = (graph.vertices[ids[place]] for place in ((0, 0), (1, 0)))
    end = HalfEdgeId(gone.id, gone.add_half_edge(2.0))
    names = Names()
    closures = Closures(names)
    closures.close(graph, [end], until=100.0)
    fused = fuse(graph, kept, gone, Pose(), math.radians(40))
    names.change(fused.renamed)
    assert graph.blocked() == [fused.renamed[end]]
    closures.open_due(graph, 100.0)
    assert graph.blocked() == []
