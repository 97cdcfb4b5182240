"""What was found by when, in a run whose every event is known."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from gvgbot.maps.growth import Growth, frontiers
from gvgbot.maps.saved_run import SavedRun
from tests.unit.maps.small_run import GRAPH, UP, edge, vertex, write_run


@pytest.fixture
def growth(tmp_path: Path) -> Growth:
    return Growth.of(SavedRun.read(write_run(tmp_path / "run")))


@pytest.mark.parametrize(
    ("time", "vertices", "edges"),
    [
        (0.0, {1}, set()),
        (5.0, {1, 3}, set()),
        (7.0, {1, 3}, {(1, 2), (2, 3)}),  # one edge as yet: nothing of vertex 2 is known
        (8.5, {1, 2, 3}, {(1, 2), (2, 3)}),
        (10.0, {1, 2, 3, 4}, {(1, 2), (2, 3), (3, 4)}),
    ],
)
def test_vertices_and_edges_are_there_from_their_events_on(
    growth: Growth, time: float, vertices: set[int], edges: set[tuple[int, int]]
) -> None:
    found = growth.graph(time)
    assert {v.id for v in found[0]} == vertices
    assert {(e.start, e.end) for e in found[1]} == edges


def test_what_was_found_before_the_list_of_events_began_anew_was_found_then(
    tmp_path: Path,
) -> None:
    """As it does in a run of weeks: the older events are in a file beside it."""
    directory = write_run(tmp_path / "run")
    whole = Growth.of(SavedRun.read(directory))
    lines = (directory / "events.jsonl").read_text().splitlines(keepends=True)
    (directory / "events-before.jsonl").write_text("".join(lines[:4]))
    (directory / "events.jsonl").write_text("".join(lines[4:]))
    parted = Growth.of(SavedRun.read(directory))
    assert parted.vertex_found == whole.vertex_found
    assert parted.edge_found == whole.edge_found


def test_what_was_found_after_the_last_row_is_there_at_the_end(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    events = (directory / "events.jsonl").read_text().replace("1009.0", "1010.05")
    (directory / "events.jsonl").write_text(events)
    growth = Growth.of(SavedRun.read(directory))
    assert {v.id for v in growth.graph(9.9)[0]} == {1, 2, 3}
    vertices, edges = growth.graph(growth.duration)
    assert {v.id for v in vertices} == {1, 2, 3, 4}
    assert {(e.start, e.end) for e in edges} == {(1, 2), (2, 3), (3, 4)}


def test_the_path_ends_where_the_robot_is(growth: Growth) -> None:
    assert growth.duration == pytest.approx(10.0)
    assert growth.path(0.0).poses == pytest.approx(np.zeros((1, 3)))
    assert growth.path(3.25).poses[-1] == pytest.approx([3.2, 0.0, 0.0])
    assert len(growth.path(10.0).stamps) == 101


def test_the_metres_driven_are_in_the_end_those_of_the_summary(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    summary = json.loads((directory / "summary.json").read_text())
    (directory / "summary.json").write_text(json.dumps(summary | {"distance_m": 11.0}))
    growth = Growth.of(SavedRun.read(directory))
    assert growth.driven(0.0) == 0.0
    assert growth.driven(5.0) == pytest.approx(5.5)
    assert growth.driven(growth.duration) == pytest.approx(11.0)


def test_metres_that_no_row_tells_were_driven_in_between(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    lines = (directory / "odometry.tum").read_text().splitlines(keepends=True)
    (directory / "odometry.tum").write_text("".join(lines[:31] + lines[71:]))
    summary = json.loads((directory / "summary.json").read_text())
    (directory / "summary.json").write_text(json.dumps(summary | {"distance_m": 500.0}))
    growth = Growth.of(SavedRun.read(directory))
    assert growth.driven(2.0) == pytest.approx(2.0)
    assert growth.driven(9.0) == pytest.approx(499.0)
    assert growth.driven(10.0) == pytest.approx(500.0)


def test_of_a_run_that_was_killed_odometry_tells_the_metres(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    (directory / "summary.json").unlink()
    assert Growth.of(SavedRun.read(directory)).driven(10.0) == pytest.approx(10.0)


def test_the_grid_is_known_as_far_as_it_had_been_seen(growth: Growth) -> None:
    x = -1.0 + 0.1 * np.arange(120)
    known = np.asarray((growth.grid(3.0).cells >= 0).all(axis=0))
    assert known[x < 4.9].all()  # whole seconds are kept: two metres ahead, less one
    assert not known[x >= 6.1].any()
    assert (growth.grid(10.0).cells >= 0).all()


def test_what_was_seen_after_the_last_row_is_there_at_the_end(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    lines = (directory / "estimate.tum").read_text().splitlines(keepends=True)
    (directory / "estimate.tum").write_text("".join(lines[:51]))  # (10, 0) was seen after 8 s
    growth = Growth.of(SavedRun.read(directory))
    assert growth.duration == pytest.approx(5.0)
    assert (growth.grid(4.9).cells < 0).any()
    assert (growth.grid(5.0).cells >= 0).all()


def test_without_a_record_of_what_was_seen_the_whole_grid_is_there(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run")
    (directory / "seen.png").unlink()
    growth = Growth.of(SavedRun.read(directory))
    assert (growth.grid(0.0).cells >= 0).all()


def test_an_edge_that_no_event_names_waits_for_its_ends_and_for_being_seen(
    tmp_path: Path,
) -> None:
    directory = write_run(tmp_path / "run")
    lines = (directory / "events.jsonl").read_text().splitlines(keepends=True)
    (directory / "events.jsonl").write_text("".join(x for x in lines if "joined" not in x))
    first, second, last = Growth.of(SavedRun.read(directory)).edge_found
    assert first == pytest.approx(8.0)  # vertex 2
    assert second == pytest.approx(8.0, abs=0.2)  # (10, 0) is two metres ahead
    assert last == pytest.approx(9.0)  # vertex 4


def test_a_frontier_is_a_bearing_that_no_known_edge_leaves_along() -> None:
    middle = GRAPH.vertices[1]
    assert frontiers(middle, []) == [0.0, math.pi, UP]
    assert frontiers(middle, GRAPH.edges[:1]) == [0.0, UP]
    assert frontiers(middle, GRAPH.edges) == [UP]


def test_a_loop_takes_both_of_its_bearings() -> None:
    meetpoint = vertex(1, 0.0, 0.0, (0.1, 1.6, -3.1))
    loop = edge(1, 1, (0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0))
    assert frontiers(meetpoint, [loop]) == [-3.1]
