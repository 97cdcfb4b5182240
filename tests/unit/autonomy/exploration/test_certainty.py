"""What is visited again, and when: beliefs with standard deviations by design, ways of one edge."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.exploration.certainty import (
    CertaintyConfig,
    Revisiting,
    arrival_sigma,
    robot_sigma,
    vertex_sigma,
)
from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from tests.unit.autonomy.graphs import STREET, between, streets

FRONTIER = HalfEdgeId(0, 0)


def town(*, explored: bool) -> tuple[GvgGraph, dict[tuple[int, int], int]]:
    """Two by two blocks; unless explored, one street is still a frontier at both ends."""
    graph, ids = streets(3, 3)
    if not explored:
        edge = graph.edge_at(between(graph, ids[2, 2], ids[1, 2]))
        assert edge is not None
        graph.unjoin(edge)
    return graph, ids


def believed(robot: float, sigmas: dict[int, float]) -> Belief:
    """A belief without correlations, with these standard deviations of positions."""
    variances = [robot**2 / 2, robot**2 / 2, 1e-4]
    for sigma in sigmas.values():
        variances += [sigma**2 / 2, sigma**2 / 2, 1e-4]
    return Belief(np.zeros(len(variances)), np.diag(variances), tuple(sigmas))


def test_standard_deviations_are_of_positions() -> None:
    belief = believed(0.3, {7: 0.2})
    assert robot_sigma(belief) == pytest.approx(0.3)
    assert vertex_sigma(belief, 7) == pytest.approx(0.2)


@pytest.mark.parametrize(("robot", "goes_back"), [(0.4, False), (0.6, True)])
def test_a_lost_robot_goes_back_to_the_nearest_place_that_it_knows_well(
    robot: float, goes_back: bool
) -> None:
    graph, ids = town(explored=False)
    sigmas = dict.fromkeys(ids.values(), 0.55)
    sigmas[ids[0, 1]] = sigmas[ids[2, 0]] = 0.1  # one and three blocks from where the robot is
    revisiting = Revisiting(CertaintyConfig(pose_sigma_m=0.5))
    revisiting.note_target(FRONTIER)
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    wanted = revisiting.next(graph, believed(robot, sigmas), starts)
    assert (None if wanted is None else wanted.vertex) == (ids[0, 1] if goes_back else None)
    again = revisiting.next(graph, believed(robot, sigmas), starts)
    assert again is None  # not before something has been explored


def test_a_robot_far_from_all_that_it_knows_well_goes_on_after_having_gone_back() -> None:
    """Whatever it explores there, it is as uncertain; much worse than that, it goes back again."""
    graph, ids = town(explored=False)
    sigmas = dict.fromkeys(ids.values(), 0.55)
    sigmas[ids[0, 1]] = 0.1
    revisiting = Revisiting(CertaintyConfig(pose_sigma_m=0.5))
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    went_back = []
    for robot in (0.6, 0.6, 0.5, 0.7, 0.8, 1.0, 1.1, 1.3, 1.6):
        revisiting.note_target(FRONTIER)
        if revisiting.next(graph, believed(robot, sigmas), starts) is not None:
            went_back.append(robot)
    assert went_back == [0.6, 1.0, 1.6]
    revisiting.configure(CertaintyConfig(pose_sigma_m=0.4))  # somebody wants it surer
    revisiting.note_target(FRONTIER)
    assert revisiting.next(graph, believed(0.5, sigmas), starts) is not None


@pytest.mark.parametrize("p_explore", [1.0, 0.9, 0.7, 0.5, 0.1])
def test_the_share_of_tasks_that_explore_is_as_configured(p_explore: float) -> None:
    graph, ids = town(explored=False)
    belief = believed(0.0, dict.fromkeys(ids.values(), 0.1))
    revisiting = Revisiting(CertaintyConfig(p_explore=p_explore))
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    explored = 0
    for _ in range(1000):  # after each task, of either kind
        if revisiting.next(graph, belief, starts) is None:
            revisiting.note_target(FRONTIER)
            explored += 1
    assert explored == pytest.approx(1000 * p_explore, abs=2)


@pytest.mark.parametrize(("share", "far"), [(0.9, False), (1.1, True)])
def test_when_it_is_a_vertex_s_turn_each_twenty_metres_make_one_e_times_less_worth_while(
    share: float, *, far: bool
) -> None:
    graph, ids = town(explored=False)
    sigmas = dict.fromkeys(ids.values(), 1e-6)
    near, away = ids[0, 1], ids[0, 2]
    sigmas[near], sigmas[away] = 0.2, share * 0.2 * math.exp(STREET / 20.0)
    revisiting = Revisiting(CertaintyConfig(p_explore=0.5, pose_sigma_m=9.0))
    revisiting.note_target(FRONTIER)
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    wanted = revisiting.next(graph, believed(0.1, sigmas), starts)
    assert wanted is not None
    assert wanted.vertex == (away if far else near)


def test_the_goal_is_pursued_while_it_helps_and_no_longer() -> None:
    graph, ids = town(explored=True)
    sigmas = dict.fromkeys(ids.values(), 0.05)
    worst, stuck = ids[2, 2], ids[0, 2]
    sigmas[worst], sigmas[stuck] = 0.4, 0.3
    revisiting = Revisiting(CertaintyConfig(vertex_sigma_m=0.1))
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    visited = []
    while (wanted := revisiting.next(graph, believed(0.05, sigmas), starts)) is not None:
        visited.append(wanted.vertex)
        if wanted.vertex == worst:
            sigmas[worst] /= 2.0  # each visit helps
        assert len(visited) < 10
    assert visited.count(worst) == 2  # 0.4, 0.2, 0.1
    assert visited.count(stuck) == 2  # and both in vain
    assert revisiting.too_uncertain(believed(0.05, sigmas)) == [stuck]


def test_no_goal_is_pursued_that_no_way_can_reach() -> None:
    """The robot itself knows less than the vertex, and so does every vertex on the way."""
    graph, ids = town(explored=True)
    belief = believed(0.5, dict.fromkeys(ids.values(), 0.3))
    revisiting = Revisiting(CertaintyConfig(vertex_sigma_m=0.1, pose_sigma_m=9.0))
    starts = [Approach(0.0, HalfEdgeId(ids[0, 0], -1))]
    assert revisiting.next(graph, belief, starts) is None


def test_the_robot_arrives_as_certain_as_the_last_places_let_it_be() -> None:
    """By hand: 0.01 m per square root of a metre; a place leaves its own variance and 0.001."""
    belief = believed(0.5, {1: 0.1, 2: 0.2})
    over = (HalfEdgeId(1, 0), HalfEdgeId(2, 0))
    assert arrival_sigma(belief, Approach(9.0, HalfEdgeId(3, 0))) == pytest.approx(
        math.sqrt(0.25 + 9e-4)
    )
    at_first = 0.01 + 0.001  # which beats what the second place could tell
    assert arrival_sigma(belief, Approach(9.0, HalfEdgeId(3, 0), over)) == pytest.approx(
        math.sqrt(at_first + 6e-4)
    )
