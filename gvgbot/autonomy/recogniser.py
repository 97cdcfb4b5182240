"""Which known vertex is seen here: candidates, their walls laid on what is seen, the best one."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.slam.recognition import (
    RecognitionConfig,
    Sighting,
    detection_covariance,
    gate_distances,
    looks_alike,
)
from gvgbot.autonomy.slam.scan_matching import Registration, ScanMatchingConfig, Sides, register
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, Pose, rotated_covariance

CLOSE_M = 1.5  # as near as one needs to be to tell vertices apart
_WALL_M = 0.15  # a point so near to a wall lies on it
_BESIDE_M = 0.4  # walls that agree only so far off are another vertex's
_KNOWN_SHARE = 0.4  # of a vertex's walls must lie where something has been seen
_REGISTRATION_FLOOR = np.diag([4e-4, 4e-4, 9e-6])  # what registration cannot know of itself


class Candidate(NamedTuple):
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


class Recogniser:
    """Knows vertices again that were out of sight for long.

    `min_inliers` is the share of a vertex's walls that must be found again, `min_inliers_far` that
    of one which is not where it should be; `margin` says how much deeper in its gate (squared
    Mahalanobis distance) a match must lie than any other.
    """

    def __init__(
        self,
        config: RecognitionConfig,
        matching: ScanMatchingConfig,
        *,
        min_inliers: float,
        min_inliers_far: float,
        margin: float,
    ) -> None:
        self._config, self._matching, self._margin = config, matching, margin
        self._min_inliers, self._min_inliers_far = min_inliers, min_inliers_far

    def find(
        self, belief: Belief, vertices: Iterable[Vertex], view: View, sighting: Sighting
    ) -> Match | None:
        """The vertex that a sighting is beyond doubt; of two that pass all tests, neither."""
        compared = (
            self._compare(belief, view, sighting, candidate)
            for candidate in self.candidates(belief, vertices, view, sighting)
        )
        return self._beyond_doubt(belief, [m for m in compared if m is not None], sighting)

    def candidates(
        self, belief: Belief, vertices: Iterable[Vertex], view: View, sighting: Sighting
    ) -> list[Candidate]:
        """Those long out of sight that are inside the gate of a sighting; most likely first."""
        found = []
        far = gate_distances(belief, sighting, view.local_base, self._config)
        for vertex in vertices:
            if view.travelled - vertex.seen_at < self._config.tracked_m:
                continue
            d2, metres = far[vertex.id]
            if d2 < self._config.gate or metres < self._config.same_place_m:
                found.append(Candidate(d2, metres, vertex))
        return sorted(found, key=lambda candidate: (candidate.distance, candidate.vertex.id))

    def _compare(
        self, belief: Belief, view: View, sighting: Sighting, candidate: Candidate
    ) -> Match | None:
        """The vertex found where a sighting is, if its shape and the walls agree.

        Walls that have changed cannot hide a vertex that stands where it should and looks alike.
        """
        distance, metres, vertex = candidate
        foreseen = view.local_base.compose(ekf.expected(belief, vertex.id)[0])
        if not looks_alike(vertex, sighting, foreseen, self._config):
            return None
        prior = Pose(float(sighting.position[0]), float(sighting.position[1]), foreseen.theta)
        found, agreement = self._laid_on(belief, view, vertex, prior)
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
        covariance = detection_covariance(away, self._config)
        return Match(vertex, prior, covariance, agreement, distance, metres)

    def _laid_on(
        self, belief: Belief, view: View, vertex: Vertex, prior: Pose
    ) -> tuple[Registration | None, float]:
        """A vertex's frame laid onto the local map, and the share of its walls found where seen."""
        turn_sigma = math.sqrt(float(belief.P[2, 2])) + 0.02
        Q = np.diag([0.15**2, 0.15**2, turn_sigma**2])
        walls, tree = view.local_map.points(), view.local_map.tree()
        sides = Sides(view.local_map.sights(), vertex.sights)
        found = register(vertex.snapshot, tree, walls, prior, Q, self._matching, sides=sides)
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
