"""Which known vertex is seen here: candidates, their walls laid on what is seen, the best one."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.doubts import NEW_PER_M2, match_cost, novelty_cost, room_for_new
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, Vertex
from gvgbot.autonomy.slam.recognition import (
    RecognitionConfig,
    Sighting,
    detection_covariance,
    gate_distances,
    looks_alike,
    sight_covariance,
    turn_by_bearings,
)
from gvgbot.autonomy.slam.scan_matching import Registration, ScanMatchingConfig, Sides, register
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, Pose, rotated_covariance, wrap_angle

CLOSE_M = 1.5  # as near as one needs to be to tell vertices apart
_WALL_M = 0.15  # a point so near to a wall lies on it
_BESIDE_M = 0.4  # walls that agree only so far off are another vertex's
_KNOWN_SHARE = 0.4  # of a vertex's walls must lie where something has been seen
_RIVALS = 4  # that are kept in mind
_COMPARED = 12  # vertices elsewhere, to tell how many look like what is seen
_PLACE_SIGMA_M = 0.15  # of a vertex laid onto what is seen, before its walls are
_TURN_SIGMA_RAD = 0.02  # and of its turn, beside the robot's own
_WALLS_M = 2.5  # from a vertex, about: turned by so much that these are missed, none are found
# what registration cannot know of itself: (5 mm)^2 and (1 mrad)^2
_REGISTRATION_FLOOR = np.diag([25e-6, 25e-6, 1e-6])


class GatedVertex(NamedTuple):
    """A vertex that may be what is seen, by its place: squared Mahalanobis distance and metres."""

    distance: float
    metres: float
    vertex: Vertex


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """A known vertex laid onto a sighting: its frame there, and how well it fits.

    `covariance` (2, 2) or (3, 3) is of the measurement in the base frame, `distance` the squared
    Mahalanobis distance, `metres` the offset.
    """

    vertex: Vertex
    local: Pose
    covariance: Array
    agreement: float
    distance: float
    metres: float


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """What a sighting was recognised as, and the vertices that it may be.

    `costs` are those of taking it for each (minus twice the log likelihood), likeliest first;
    `density`, 1/m^2, is that of new vertices that look like it, and `novelty` the cost of one.
    """

    match: Match | None = None
    rivals: tuple[int, ...] = ()
    costs: tuple[float, ...] = ()
    density: float = NEW_PER_M2
    novelty: float = 0.0


class Recogniser:
    """Knows vertices again that were out of sight for long.

    `min_inliers` is the share of a vertex's walls that must be found again, `min_inliers_far` that
    of one which is not where it should be; `margin` says how much deeper in its gate (squared
    Mahalanobis distance) a match must lie than any other, `novelty_margin` how much less it must
    cost (minus twice the log likelihood) than a new vertex.
    """

    def __init__(
        self,
        config: RecognitionConfig,
        matching: ScanMatchingConfig,
        *,
        min_inliers: float,
        min_inliers_far: float,
        margin: float,
        novelty_margin: float,
    ) -> None:
        self._config, self._matching, self._margin = config, matching, margin
        self._novelty_margin = novelty_margin
        self._min_inliers, self._min_inliers_far = min_inliers, min_inliers_far

    def find(
        self,
        belief: Belief,
        graph: GvgGraph,
        vertices: Iterable[Vertex],
        view: View,
        sighting: Sighting,
        *,
        wary: bool = False,
    ) -> Recognition:
        """Which of some vertices a sighting is, if that is beyond doubt.

        Of two that pass all tests it is neither, nor is it one that a new vertex may be as well.
        Who is wary takes none for it but one whose place is known.
        """
        compared = (
            self._compare(belief, view, sighting, gated)
            for gated in self.gated(belief, vertices, view, sighting)
        )
        matches = [match for match in compared if match is not None]
        best = self._beyond_doubt(belief, matches, sighting)
        if not matches or (best is not None and self._is_in_place(belief, best)):
            return Recognition(best)
        found = self._against_new(belief, graph, matches, best, view, sighting)
        return replace(found, match=None) if wary else found

    def _is_in_place(self, belief: Belief, match: Match) -> bool:
        """Whether it is where it should be, and that is known better than vertices lie apart."""
        _, S, _ = ekf.innovation(belief, match.vertex.id, Pose(), np.zeros((2, 2)))
        reach = self._config.same_place_m
        return match.metres < reach and bool(np.trace(S) < reach**2)

    def _against_new(
        self,
        belief: Belief,
        graph: GvgGraph,
        matches: list[Match],
        best: Match | None,
        view: View,
        sighting: Sighting,
    ) -> Recognition:
        """The best match, if it costs less than a new vertex; otherwise what it may be."""
        seen = view.local_base.inverse().transform(sighting.position)
        R = detection_covariance(float(np.hypot(*seen)), self._config)
        r, S = ekf.offsets(belief, seen, R)
        at = {vertex: i for i, vertex in enumerate(belief.ids)}
        reach = np.array([graph.reach(graph.vertices[vertex]) for vertex in belief.ids])
        density = NEW_PER_M2 * self._commonness(belief, graph, view, sighting)
        novelty = novelty_cost(density, room_for_new(r, S, reach))
        costs = {m.vertex.id: match_cost(r[at[m.vertex.id]], S[at[m.vertex.id]]) for m in matches}
        if best is not None and costs[best.vertex.id] > novelty - self._novelty_margin:
            best = None
        rivals = tuple(sorted(costs, key=lambda vertex: costs[vertex]))[:_RIVALS]
        return Recognition(best, rivals, tuple(costs[v] for v in rivals), density, novelty)

    def _commonness(self, belief: Belief, graph: GvgGraph, view: View, sighting: Sighting) -> float:
        """The share of vertices that look like a sighting, by those that it cannot be."""
        far = gate_distances(belief, sighting, view.local_base, self._config)
        elsewhere = sorted((metres, v) for v, (d2, metres) in far.items() if d2 > self._config.gate)
        alike = 0
        for metres, v in elsewhere[:_COMPARED]:
            gated = GatedVertex(0.0, metres, graph.vertices[v])
            alike += self._compare(belief, view, sighting, gated) is not None
        return (1 + alike) / (2 + len(elsewhere[:_COMPARED]))

    def gated(
        self, belief: Belief, vertices: Iterable[Vertex], view: View, sighting: Sighting
    ) -> list[GatedVertex]:
        """Those long out of sight that are inside the gate of a sighting; most likely first."""
        long_gone = [v for v in vertices if view.travelled - v.seen_at >= self._config.tracked_m]
        if not long_gone:
            return []
        found = []
        far = gate_distances(belief, sighting, view.local_base, self._config)
        for vertex in long_gone:
            d2, metres = far[vertex.id]
            if d2 < self._config.gate or metres < self._config.same_place_m:
                found.append(GatedVertex(d2, metres, vertex))
        return sorted(found, key=lambda gated: (gated.distance, gated.vertex.id))

    def _compare(
        self, belief: Belief, view: View, sighting: Sighting, gated: GatedVertex
    ) -> Match | None:
        """The vertex found where a sighting is, if its shape and the walls agree.

        Walls that have changed cannot hide a vertex that stands where it should and looks alike.
        """
        distance, metres, vertex = gated
        base_vertex = ekf.expected(belief, vertex.id)[0]
        foreseen = view.local_base.compose(base_vertex)
        if not looks_alike(vertex, sighting, foreseen, self._config):
            return None
        S = ekf.innovation(belief, vertex.id, base_vertex, np.zeros((3, 3)))[1]
        turn_sigma = math.sqrt(float(S[2, 2])) + _TURN_SIGMA_RAD
        turn = 0.0
        if turn_sigma * _WALLS_M > self._matching.max_pair_m:
            turn = turn_by_bearings(vertex, sighting, foreseen, self._config)
        x, y = sighting.position
        prior = Pose(float(x), float(y), wrap_angle(foreseen.theta + turn))
        found, agreement = self._laid_on(view, vertex, prior, turn_sigma)
        surprising = metres > self._config.same_place_m
        least = self._min_inliers_far if surprising else self._min_inliers
        if found is not None and agreement >= least:
            if np.hypot(*(found.pose.position - sighting.position)) > _BESIDE_M:
                return None  # it stands beside what is seen
            covariance = rotated_covariance(
                found.covariance + _REGISTRATION_FLOOR, view.local_base.to(found.pose).theta
            )
            return Match(vertex, found.pose, covariance, agreement, distance, metres)
        away = float(np.hypot(*(sighting.position - view.local_base.position)))
        if away > CLOSE_M or metres > 0.5 * self._config.same_place_m:
            return None
        covariance = sight_covariance(away, self._config)
        return Match(vertex, prior, covariance, agreement, distance, metres)

    def _laid_on(
        self, view: View, vertex: Vertex, prior: Pose, turn_sigma: float
    ) -> tuple[Registration | None, float]:
        """A vertex's frame laid onto the local map, and the share of its walls found where seen."""
        Q = np.diag([_PLACE_SIGMA_M**2, _PLACE_SIGMA_M**2, turn_sigma**2])
        tree = view.local_map.tree()
        sides = Sides(view.local_map.sights(), vertex.sights)
        found = register(vertex.snapshot, tree, prior, Q, self._matching, sides=sides)
        if found is None:
            return None, 0.0
        laid = found.pose.transform(vertex.snapshot)
        laid = laid[view.local_map.known(laid)]
        if len(laid) < max(self._matching.min_pairs, _KNOWN_SHARE * len(vertex.snapshot)):
            return None, 0.0
        distance, _ = tree.query(laid, distance_upper_bound=_WALL_M)
        return found, float(np.isfinite(distance).mean())

    def _beyond_doubt(
        self, belief: Belief, matches: list[Match], sighting: Sighting
    ) -> Match | None:
        """The match that lies far deeper in its gate than any other elsewhere in the building.

        Of two close together, the one whose walls lie nearer to what is seen.
        """
        if not matches:
            return None
        first = matches[0]
        here = belief.map_vertex(first.vertex.id)
        neighbours = []
        for match in matches:
            if here.distance(belief.map_vertex(match.vertex.id)) < CLOSE_M:
                neighbours.append(match)
            elif match.distance < first.distance + self._margin:
                return None
        return min(
            neighbours, key=lambda m: float(np.hypot(*(m.local.position - sighting.position)))
        )
