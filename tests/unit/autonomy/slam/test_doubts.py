"""Vertices that may be known ones: likelihoods against scipy, readings on a regular town."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, ncx2

from gvgbot.autonomy.slam.doubts import (
    IMPOSSIBLE,
    NEW_PER_M2,
    Doubt,
    Doubts,
    habit_density,
    match_cost,
    novelty_cost,
    room_for_new,
)
from gvgbot.autonomy.slam.ekf import Belief, add_vertex, predict
from gvgbot.geometry import Array, Pose

STREET = 10.0  # m
SEEN = np.diag([0.05**2, 0.05**2, 1e-6])  # of a vertex, from near
STEADY = np.diag([0.1**2, 0.1**2, 0.005**2])  # of a street's length as driven
MARGIN = 6.0

covariances = st.builds(
    lambda a, b, c: np.array([[a, 0.0], [c, b]]) @ np.array([[a, c], [0.0, b]]),
    st.floats(0.1, 3.0),
    st.floats(0.1, 3.0),
    st.floats(-1.0, 1.0),
)
offsets = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)).map(np.array)


@given(offsets, covariances)
def test_the_cost_of_a_match_is_minus_twice_the_log_likelihood(r: Array, cov: Array) -> None:
    expected = -2 * multivariate_normal.logpdf(r, cov=cov)
    assert match_cost(r, cov) == pytest.approx(expected, abs=1e-6)


def test_the_cost_of_a_new_vertex_is_that_of_a_poisson_process() -> None:
    assert novelty_cost(0.02, 0.5) == pytest.approx(-2 * math.log(0.01))
    assert novelty_cost(0.02, 0.0) == pytest.approx(-2 * math.log(0.02 * IMPOSSIBLE))


@given(offsets, st.floats(0.3, 4.0), st.floats(0.5, 6.0))
def test_room_is_what_a_noncentral_chi_squared_leaves(r: Array, sigma: float, reach: float) -> None:
    found = room_for_new(r[None], sigma**2 * np.eye(2)[None], np.array([reach]))
    exact = ncx2.sf((reach / sigma) ** 2, 2, (r @ r) / sigma**2)
    assert found == pytest.approx(exact, abs=0.03)  # 256 points


def test_there_is_no_room_where_the_surroundings_cover_all() -> None:
    r, S = np.array([[0.1, 0.0], [20.0, 0.0]]), np.stack([0.01 * np.eye(2)] * 2)
    assert room_for_new(r, S, np.array([5.0, 5.0])) == 0.0


def test_habits_add_half_a_vertex_for_a_way_and_nothing_far_from_all() -> None:
    ways = np.array([[STREET, 0.0], [0.0, STREET]])
    x, y = np.meshgrid(np.arange(-2, 13, 0.1), np.arange(-2, 13, 0.1))
    density = [habit_density(np.array(at), ways) for at in zip(x.ravel(), y.ravel(), strict=True)]
    assert sum(density) * 0.1**2 == pytest.approx(0.5, rel=1e-3)
    assert habit_density(np.array([5.0, 5.0]), ways) == pytest.approx(0.0, abs=1e-9)
    assert habit_density(np.array([STREET, 0.0]), np.zeros((0, 2))) == 0.0


class Walk:
    """A robot that walks a town by odometry; each crossing enters the belief as a new vertex."""

    def __init__(self) -> None:
        self.belief = Belief()
        self.doubts = Doubts()
        self.reach: dict[int, float] = {}

    def see(self, vertex: int, *rivals: int) -> "Walk":
        """A crossing where the robot stands."""
        self.belief = add_vertex(self.belief, vertex, Pose(), SEEN)
        self.reach[vertex] = STREET / 2
        self.doubts.note(Doubt(vertex, rivals, NEW_PER_M2 / 2))
        return self

    def go(self, x: float, y: float, *, sigma: float = 0.0) -> "Walk":
        """To a crossing so far away, with so much more uncertainty than a street costs."""
        more = np.diag([sigma**2, sigma**2, 0.0])
        self.belief = predict(self.belief, Pose(x, y, 0.0), STEADY + more)
        return self

    def weighed(self) -> tuple[int, int | None] | None:
        verdict = self.doubts.weigh(self.belief, self.reach, MARGIN)
        return None if verdict is None else (verdict.vertex, verdict.known)


def tees() -> Walk:
    """Two known vertices, 1 and 2, in a street, and the robot lost for a while."""
    return Walk().see(1).go(STREET, 0.0).see(2)


def test_a_place_that_may_be_new_stays_in_doubt() -> None:
    walk = tees().go(-STREET, 0.5, sigma=2.5).see(3, 1)
    assert walk.weighed() is None


def test_the_next_vertices_make_it_certain_that_it_is_a_known_one() -> None:
    walk = tees().go(-STREET, 0.5, sigma=2.5).see(3, 1).go(STREET, 0.0).see(4, 2)
    assert walk.weighed() == (3, 1)


def test_where_the_next_vertex_has_no_room_beside_the_known_one_it_was_a_new_one() -> None:
    walk = tees().go(-STREET, 2.0, sigma=2.0).see(3, 1).go(STREET, 3.0).see(4)
    assert walk.weighed() == (3, None)  # else 4 would stand three metres from 2


def test_a_place_that_becomes_certain_needs_no_further_vertex() -> None:
    assert tees().go(-STREET, 0.1).see(3, 1).weighed() == (3, 1)
    assert tees().go(0.0, 3 * STREET).see(3, 1).weighed() == (3, None)


def test_only_the_latest_are_weighed_together() -> None:
    """Each costs a reading of all others; what is older counts as new."""
    doubts = Doubts()
    for vertex in range(2, 40):
        doubts.note(Doubt(vertex, (1,), NEW_PER_M2))
    assert [doubt.vertex for doubt in doubts.recent] == list(range(32, 40))


def thrice(sigma: float, again: float, *rivals: int) -> Walk:
    """At vertex 1; lost for a while, there as 5; at 7, and lost once more; there as 9."""
    walk = Walk().see(1).go(0.0, 0.0, sigma=sigma).see(5, 1).go(0.0, STREET).see(7)
    return walk.go(0.0, -STREET, sigma=again).see(9, *rivals)


@pytest.mark.parametrize(("sigma", "again"), [(1.0, 0.8), (2.0, 0.5)])
def test_two_places_in_doubt_may_be_the_same_known_one(sigma: float, again: float) -> None:
    """So near to each other there is no room for two of them, let alone for three."""
    assert thrice(sigma, again, 1, 5).weighed() == (5, 1)


def test_a_place_is_surely_another_one_though_that_may_be_a_known_one() -> None:
    """Four metres off, 5 may be 1, or not; it is a street to 7 and the same one back."""
    walk = Walk().see(1).go(4.0, 0.0, sigma=3.0).see(5, 1).go(0.0, STREET).see(7)
    assert walk.go(0.0, -STREET).see(9, 1, 5).weighed() == (9, 5)


def test_two_places_that_do_not_look_like_each_other_are_not_both_the_same_known_one() -> None:
    assert thrice(1.0, 0.8, 1).weighed() is None


def test_in_whatever_order_they_came_into_doubt_all_may_be_the_same_known_one() -> None:
    walk = Walk().see(1).go(0.0, 0.0, sigma=0.5).see(5).go(0.0, 0.0, sigma=0.5).see(7, 5)
    walk.doubts.note(Doubt(5, (1, 7), NEW_PER_M2 / 2))
    assert walk.go(0.0, 0.0, sigma=0.5).see(9, 7).weighed() in ((5, 1), (7, 1))


@pytest.mark.parametrize("seed", range(50))
def test_places_that_are_not_one_are_never_taken_for_one(seed: int) -> None:
    """Streets away from vertex 1 there are 5 and 9, which is 5; odometry errs as it says."""
    rng = np.random.default_rng(seed)
    (x, y), (u, v) = rng.normal(0.0, 2.0, 2), rng.normal(0.0, 1.0, 2)
    walk = Walk().see(1).go(STREET + x, y, sigma=2.0).see(5, 1).go(0.0, STREET).see(7)
    verdict = walk.go(u, v - STREET, sigma=1.0).see(9, 1, 5).weighed()
    assert verdict in (None, (5, None), (9, 5))


def test_what_is_refuted_is_weighed_no_more() -> None:
    walk = tees().go(-STREET, 0.1).see(3, 1, 2)
    walk.doubts.refute(1)
    assert walk.doubts.recent[0].rivals == (2,)
    walk.doubts.refute(2)
    assert walk.weighed() is None


def test_habits_make_a_new_vertex_as_likely_as_a_match_one_street_off() -> None:
    """Every crossing is a street from the last: so is a new one, and says nothing of where."""
    walk = tees().go(-STREET, 1.0, sigma=2.5).see(3, 1).go(STREET, 0.0).see(4, 2)
    assert walk.weighed() == (3, 1)
    usual = habit_density(np.array([STREET, 0.0]), np.array([[STREET, 0.0], [-STREET, 0.0]]))
    walk.doubts.recent = [Doubt(d.vertex, d.rivals, d.density, usual) for d in walk.doubts.recent]
    assert walk.weighed() is None


def test_only_vertices_after_a_doubted_one_are_kept() -> None:
    doubts = Doubts()
    doubts.note(Doubt(1, (), 0.01))
    assert doubts.recent == []
    doubts.note(Doubt(2, (1,), 0.01))
    doubts.note(Doubt(3, (), 0.01))
    assert [doubt.vertex for doubt in doubts.recent] == [2, 3]
    doubts.believe(2)
    assert doubts.recent == []


def test_a_vertex_that_was_in_doubt_before_may_be_one_more() -> None:
    doubts = Doubts()
    doubts.note(Doubt(5, (1,), 0.01))
    doubts.note(Doubt(6, (2,), 0.01))
    doubts.note(Doubt(5, (3, 1), 0.02))
    assert [(doubt.vertex, doubt.rivals) for doubt in doubts.recent] == [(5, (1, 3)), (6, (2,))]


def test_what_may_be_a_vertex_that_proved_to_be_another_may_be_that_one() -> None:
    doubts = Doubts()
    doubts.note(Doubt(5, (1, 2), 0.01))
    doubts.note(Doubt(8, (5, 1), 0.01))
    doubts.note(Doubt(9, (3, 5), 0.01))
    doubts.unite(1, 5)
    assert [(doubt.vertex, doubt.rivals) for doubt in doubts.recent] == [(8, (1,)), (9, (3, 1))]


def test_no_vertex_may_be_itself() -> None:
    doubts = Doubts()
    doubts.note(Doubt(5, (1, 9), 0.01))
    doubts.note(Doubt(9, (5,), 0.01))
    doubts.unite(5, 9)
    assert [(doubt.vertex, doubt.rivals) for doubt in doubts.recent] == [(5, (1,))]
