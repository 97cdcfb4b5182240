"""How an exploration ends: its outcome, and why."""

from collections.abc import Callable, Collection, Sequence
from typing import Literal, NamedTuple

import numpy as np

from gvgbot.autonomy.exploration.unseen import places_in_words
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.geometry import Array

Outcome = Literal["explored", "explored_with_blocked", "failed", "stopped"]


class Surveyed(NamedTuple):
    """What the grid of all scans shows in the end, m, map frame."""

    places: Array  # (N, 2), that are worth another look
    narrows: Array  # (N, 2), ways too narrow for the robot that lead to floor without another
    is_beside_floor: bool = False  # all edges are where it lacks the room it wants, places are not
    doorsteps: Array = np.empty((0, 2))  # (M, 2), before what may be somebody, or narrowed by him
    awaited: Array = np.empty((0, 2))  # (K, 2), ways that he may stand in, narrow or closed
    barred: Sequence[int] = ()  # edges over what looked like a wall, not driven
    is_whole: bool = False  # all floor is seen, and edges lead wherever they should
    is_walled: bool = True  # a wall was seen at all


Survey = Callable[[], Surveyed | None]  # None: not yet told


def too_narrow(narrows: Array) -> str:
    """What there is to say of ways (N, 2) that the robot leaves alone."""
    return f"; too narrow for it near {places_in_words(narrows)}" if len(narrows) else ""


def has_meetpoints(graph: GvgGraph) -> bool:
    """Whether more than one edge is known, or where others begin."""
    return any(vertex.kind == "meetpoint" for vertex in graph.vertices.values())


def given_up(graph: GvgGraph) -> int:
    """How many frontiers were given up."""
    return sum(graph.edge_at(end) is None for end in graph.blocked())


def all_examined(graph: GvgGraph, remark: str) -> tuple[Outcome, str]:
    """No frontier is left, and nothing in sight may be a vertex."""
    blocked = given_up(graph)
    if blocked:
        return "explored_with_blocked", f"frontiers given up: {blocked}{remark}"
    return "explored", f"no frontier is left{remark}"


def unless_shut_in(
    survey: Survey | None, explored: tuple[Outcome, str]
) -> tuple[Outcome, str] | None:
    """Explored, or else what there is to say of a robot in a slot; None: not yet told."""
    if survey is None:
        return explored
    surveyed = survey()
    if surveyed is None:
        return None
    shut_in: tuple[Outcome, str] = ("failed", "there is floor in sight, but no way onto it")
    return shut_in if surveyed.is_beside_floor else explored


def left_to_others(
    graph: GvgGraph, unfollowed: Collection[HalfEdgeId], remark: str
) -> tuple[Outcome, str]:
    """Robots of a team have followed all, but for what this one gave up and nobody followed."""
    blocked = len(set(graph.blocked()) & set(unfollowed))
    if blocked:
        reason = f"frontiers given up: {blocked}; no other one is left"
        return "explored_with_blocked", reason + remark
    return "explored", f"no frontier of the team is left{remark}"


def cut_short(graph: GvgGraph, without_map: str, reason: str) -> tuple[Outcome, str]:
    """Nothing more can be done; why, if nothing is mapped, and if something is."""
    if not graph.vertices:
        return "failed", without_map
    left = len(graph.frontiers()) + given_up(graph)
    return "explored_with_blocked", f"frontiers left: {left}; {reason}"


def leading_nowhere(
    graph: GvgGraph, survey: Survey | None, reason: str
) -> tuple[Outcome, str] | None:
    """Frontiers are left, and the robot does not come on there; None as long as the survey takes.

    The middle of a room that is nearly square looks like the end of an edge from where not all of
    the room is in sight. Where the map is whole, frontiers are what somebody in the way made up.
    """
    left: tuple[Outcome, str] = ("explored_with_blocked", reason)
    if survey is None or not _has_ways(graph):
        return unless_closed_room(graph, survey, left)
    surveyed = survey()
    if surveyed is None:
        return None
    return ("explored", "no frontier is left that leads anywhere") if surveyed.is_whole else left


def without_target(
    graph: GvgGraph, survey: Survey | None, reason: str
) -> tuple[Outcome, str] | None:
    """There is nothing to go for, and no way on; None as long as the survey takes."""
    without_map = f"no vertex found, perhaps no way out: {reason}"
    return unless_closed_room(graph, survey, cut_short(graph, without_map, reason))


def unless_closed_room(
    graph: GvgGraph, survey: Survey | None, other: tuple[Outcome, str]
) -> tuple[Outcome, str] | None:
    """How else it ends, if an edge is mapped or floor unseen; None as long as the survey takes."""
    return other if survey is None or _has_ways(graph) else _closed_room_or(other, survey)


def _has_ways(graph: GvgGraph) -> bool:
    """Whether an edge is known, or where some begin, and not the end of one at most."""
    return bool(graph.edges) or has_meetpoints(graph)


def _closed_room_or(other: tuple[Outcome, str], survey: Survey) -> tuple[Outcome, str] | None:
    """Explored, where no floor is unseen that the robot could drive onto; None: not yet told.

    Without an edge it is in a closed room then.
    """
    surveyed = survey()
    if surveyed is None:
        return None
    if len(surveyed.places) or not surveyed.is_walled:
        return other
    return "explored", f"a space without edges, and no way out{too_narrow(surveyed.narrows)}"
