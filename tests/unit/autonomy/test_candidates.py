"""What is believed of vertices that have been seen, and from how far."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.candidates import Candidates, CandidatesConfig, Mistake
from gvgbot.autonomy.gvg.local import LocalNode
from gvgbot.autonomy.slam.recognition import Sighting
from tests.unit.autonomy.local_graphs import drawn

CONFIG = CandidatesConfig(meetpoint_sightings=3)
PLACE = np.array([5.0, 0.0])
NODE: LocalNode = drawn(
    {1: (5.0, 0.0), 2: (9.0, 0.0), 3: (5.0, 4.0), 4: (0.0, 0.0)},
    {10: (1, 2, []), 11: (1, 3, []), 12: (1, 4, [])},
).nodes[1]
SIGHTING = Sighting(PLACE, 1.0, (0.0, 1.57, 3.14), meetpoint=True)


def sightings_until_believed(
    candidates: Candidates,
    away: float,
    *,
    travelled: float,
    what: tuple[Sighting, LocalNode] = (SIGHTING, NODE),
) -> int | None:
    """How often it must be seen from so far; None if it is not believed after many times."""
    sighting, node = what
    for count in range(1, 50):
        candidate = candidates.note(sighting, away, travelled)
        if candidates.is_believable(candidate, node, away):
            candidates.drop(candidate)
            return count
    return None


@pytest.mark.parametrize(
    ("mistakes", "away", "believed_after"),
    [(0, 6.0, 3), (1, 6.0, 3), (2, 6.0, None), (2, 0.5, 3)],
    ids=["new", "wrong once", "wrong twice", "wrong twice, seen from near"],
)
def test_what_was_none_twice_is_believed_from_near_only(
    mistakes: int, away: float, believed_after: int | None
) -> None:
    candidates = Candidates(CONFIG)
    for _ in range(mistakes):
        candidates.note_mistake(Mistake(np.array([5.3, -0.2]), (), 10.0))
    assert sightings_until_believed(candidates, away, travelled=20.0) == believed_after


def test_mistakes_elsewhere_do_not_count() -> None:
    candidates = Candidates(CONFIG)
    for _ in range(5):
        candidates.note_mistake(Mistake(np.array([7.0, 0.0]), (), 10.0))
    assert sightings_until_believed(candidates, 6.0, travelled=20.0) == 3


@pytest.mark.parametrize(
    ("bearing", "believed_after"), [(0.1, None), (-0.8, 6)], ids=["the same one", "another one"]
)
def test_a_side_edge_of_which_too_little_is_seen_is_looked_at_once(
    bearing: float, believed_after: int | None
) -> None:
    """It leaves to the east, and so did one half a metre off that led nowhere."""
    suspect = replace(NODE, weak=frozenset(NODE.branches[:1]))
    sighting = replace(SIGHTING, unclear=(0.0,))
    candidates = Candidates(CONFIG)
    candidates.note_mistake(Mistake(np.array([5.4, 0.3]), (3.1, bearing, 1.7), 10.0))
    found = sightings_until_believed(candidates, 0.5, travelled=20.0, what=(sighting, suspect))
    assert found == believed_after


def test_a_side_edge_in_passing_is_believed_as_soon_as_the_robot_has_passed_it() -> None:
    """Before that it may still come into sight, so twice as many looks are needed."""
    suspect = replace(NODE, weak=frozenset(NODE.branches[:1]))
    sighting, candidates = replace(SIGHTING, unclear=(0.0,)), Candidates(CONFIG)
    believed = []
    for away in (0.9, 0.6, 0.4, 0.6, 0.8):
        candidate = candidates.note(sighting, away, 20.0)
        believed.append(candidates.is_believable(candidate, suspect, away))
    assert believed == [False, False, False, False, True]


def test_sightings_are_counted_by_place_and_kind() -> None:
    candidates = Candidates(CONFIG)
    beside = replace(SIGHTING, position=PLACE + 0.3)
    others = replace(SIGHTING, position=PLACE - 0.3), replace(SIGHTING, meetpoint=False)
    first = candidates.note(SIGHTING, 3.0, 20.0)
    assert candidates.note(beside, 3.0, 20.0) is first
    for other in others:
        assert candidates.note(other, 3.0, 20.0) is not first
    assert first.sightings == 2


def test_who_has_become_a_vertex_counts_anew_if_that_is_taken_out() -> None:
    candidates = Candidates(CONFIG)
    assert sightings_until_believed(candidates, 3.0, travelled=20.0) == 3
    assert sightings_until_believed(candidates, 3.0, travelled=20.0) == 3


def test_what_was_seen_twice_as_often_as_needed_is_examined() -> None:
    candidates = Candidates(CONFIG)
    looks = [candidates.is_examined(candidates.note(SIGHTING, 3.0, 20.0)) for _ in range(7)]
    assert looks == [False] * 5 + [True] * 2


def test_only_where_all_of_some_side_edges_led_nowhere_they_were_looked_at() -> None:
    candidates = Candidates(CONFIG)
    candidates.note_mistake(Mistake(PLACE, (0.1, -3.1), 10.0))
    assert candidates.was_looked_at(PLACE, 0.0, 3.1)
    assert not candidates.was_looked_at(PLACE, 0.0, 1.6)


def test_mistakes_are_forgotten_after_a_kilometre() -> None:
    candidates = Candidates(CONFIG)
    candidates.note_mistake(Mistake(PLACE, (), 10.0))
    for travelled, is_known in ((1000.0, True), (1020.0, False)):
        candidates.note_mistake(Mistake(PLACE + 50.0, (), travelled))
        assert candidates.was_mistaken_near(PLACE) == is_known
