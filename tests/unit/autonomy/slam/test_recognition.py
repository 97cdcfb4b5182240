"""Which known vertex a sighting may be."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import mahalanobis as scipy_mahalanobis

from gvgbot.autonomy.slam.ekf import Belief, add_vertex, predict
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.slam.recognition import (
    RecognitionConfig,
    Sighting,
    detection_covariance,
    gate_distances,
    looks_alike,
    match_bearings,
)
from gvgbot.geometry import Pose, wrap_angle

CONFIG = RecognitionConfig()
LIMIT = math.radians(CONFIG.bearing_deg)
CROSSING = (0.0, math.pi / 2, math.pi, -math.pi / 2)
TEE = (0.0, math.pi, -math.pi / 2)

bearings = st.lists(st.floats(-math.pi, math.pi), max_size=5).map(tuple)


def vertex(*directions: float, clearance: float = 1.2) -> Vertex:
    made = Vertex(1, clearance, Pose(), 0.0, 0.0)
    for direction in directions:
        made.add_half_edge(direction)
    return made


def sighting(*directions: float, meetpoint: bool = True, clearance: float = 1.2) -> Sighting:
    return Sighting(np.zeros(2), clearance, directions, meetpoint)


@given(bearings, bearings)
def test_bearings_are_paired_one_to_one_within_the_limit(
    seen: tuple[float, ...], known: tuple[float, ...]
) -> None:
    matched = match_bearings(seen, dict(enumerate(known)), 0.7)
    assert len(set(matched.values())) == len(matched)
    for i, key in matched.items():
        assert math.cos(seen[i] - known[key]) >= math.cos(0.7) - 1e-12
    for i, angle in enumerate(seen):  # whoever is left alone had no free partner
        for key, other in enumerate(known):
            if i not in matched and key not in matched.values():
                assert abs(wrap_angle(angle - other)) > 0.7


@given(st.floats(-0.6, 0.6), st.permutations(range(4)))
def test_a_crossing_matches_itself_turned_a_little_in_any_order(
    turn: float, order: list[int]
) -> None:
    seen = tuple(wrap_angle(CROSSING[k] + turn) for k in order)
    assert match_bearings(seen, dict(enumerate(CROSSING)), LIMIT) == dict(enumerate(order))


@pytest.mark.parametrize("turn", [0.0, 0.4, -0.4])
def test_a_vertex_looks_like_itself(turn: float) -> None:
    seen = sighting(*(b + turn for b in TEE))
    assert looks_alike(vertex(*TEE), seen, Pose(), CONFIG)


@pytest.mark.parametrize("turn", [1.0, -2.5, math.pi])
def test_bearings_turn_with_the_frame_of_the_vertex(turn: float) -> None:
    seen = sighting(*(b + turn for b in TEE))
    assert looks_alike(vertex(*TEE), seen, Pose(4.0, 2.0, turn), CONFIG)
    assert not looks_alike(vertex(*TEE), seen, Pose(4.0, 2.0, turn + 1.2), CONFIG)


UNLIKE = {
    "another kind": sighting(*TEE, meetpoint=False),
    "a tee the other way up": sighting(0.3, math.pi - 0.3, math.pi / 2),
    "much wider": sighting(*TEE, clearance=1.8),
    "much narrower": sighting(*TEE, clearance=0.7),
    "two edges more": sighting(*TEE, 0.8, 2.4),
}


@pytest.mark.parametrize("seen", UNLIKE.values(), ids=UNLIKE)
def test_a_vertex_does_not_look_like(seen: Sighting) -> None:
    assert not looks_alike(vertex(*TEE), seen, Pose(), CONFIG)


def test_a_crossing_may_be_seen_as_one_of_a_close_pair_of_tees() -> None:
    assert looks_alike(vertex(*CROSSING), sighting(*TEE), Pose(), CONFIG)
    assert looks_alike(vertex(*TEE), sighting(*CROSSING), Pose(), CONFIG)


STAR = tuple(wrap_angle(k * math.pi / 4) for k in range(8))


@pytest.mark.parametrize("certain", [(0, 1, 2), (4, 6, 7), (0, 2, 4, 6), (0, 1, 2, 3, 4, 5, 6)])
def test_a_meetpoint_of_many_edges_is_the_same_whichever_of_them_are_certain(
    certain: tuple[int, ...],
) -> None:
    unclear = tuple(STAR[k] for k in range(8) if k not in certain)
    seen = replace(sighting(*(STAR[k] for k in certain)), unclear=unclear)
    assert looks_alike(vertex(*STAR[:5]), seen, Pose(), CONFIG)


def test_what_is_certain_must_be_there_though_more_may_be() -> None:
    """Seven departures for certain, and an eighth perhaps, are no tee, and no half of a star."""
    seen = replace(sighting(*STAR[:7]), unclear=STAR[7:])
    assert not looks_alike(vertex(*TEE), seen, Pose(), CONFIG)
    assert not looks_alike(vertex(*STAR[::2]), seen, Pose(), CONFIG)


@pytest.mark.parametrize("certain", [(0.0,), (0.0, math.pi)], ids=["one", "two"])
def test_departures_of_which_too_little_is_seen_may_be_none(certain: tuple[float, ...]) -> None:
    """In a square room with three doors, what leads to the corners behind the robot is unclear."""
    corners = (3 * math.pi / 4, -3 * math.pi / 4)
    unclear = tuple(bearing for bearing in (*TEE, *corners) if bearing not in certain)
    suspect = replace(sighting(*TEE, *corners), unclear=unclear)
    assert looks_alike(vertex(*TEE), suspect, Pose(), CONFIG)
    assert not looks_alike(vertex(math.pi / 2, *corners), suspect, Pose(), CONFIG)


@pytest.mark.parametrize(("beside", "alike"), [(0.0, False), (0.3, True), (2.0, False)])
def test_a_vertex_that_lies_beside_may_be_nearer_to_the_walls(beside: float, alike: bool) -> None:
    """Clearance is 1-Lipschitz; what is farther off than vertices err is not excused."""
    wider = sighting(*TEE, clearance=1.2 + (0.9 if beside > 1.0 else 0.45))
    assert looks_alike(vertex(*TEE), wider, Pose(0.0, beside, 0.0), CONFIG) is alike


def test_the_gate_is_mahalanobis_distance_with_the_joint_covariance() -> None:
    """The filter's numbers put together by hand, and the distance by scipy."""
    seen_first, here = Pose(2.0, 0.0, 0.0), Pose(3.0, 1.0, 1.0)
    belief = add_vertex(Belief(), 1, seen_first, np.diag([0.01, 0.02, 1e-6]))
    belief = predict(belief, here, np.diag([0.04, 0.09, 0.0]))
    local_base = Pose(7.0, -3.0, 2.0)
    base_vertex = here.to(seen_first).position + np.array([0.1, -0.2])
    target = Sighting(local_base.transform(base_vertex), 1.0, (), meetpoint=True)
    ((_, (d2, metres)),) = gate_distances(belief, target, local_base, CONFIG).items()
    assert metres == pytest.approx(math.hypot(0.1, 0.2))
    c, s = math.cos(1.0), math.sin(1.0)
    into_base = np.array([[c, s], [-s, c]])
    P = np.diag([0.01 + 0.04, 0.02 + 0.09])  # vertex and robot err independently, map frame
    S = into_base @ P @ into_base.T + detection_covariance(float(np.hypot(*base_vertex)), CONFIG)
    by_hand = scipy_mahalanobis([0.1, -0.2], [0.0, 0.0], np.linalg.inv(S))
    assert d2 == pytest.approx(by_hand**2)


@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_detection_is_less_certain_from_farther_away(one: float, other: float) -> None:
    near, far = sorted((one, other))
    trace = [float(np.trace(detection_covariance(d, CONFIG))) for d in (near, far)]
    assert 2 * CONFIG.detection_sigma_m**2 <= trace[0] <= trace[1]
