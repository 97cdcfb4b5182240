"""Which known vertex is this? Tests in the order of their cost; what fails all of them is new.

A vertex seen moments ago is told by its place in the local map alone. One not seen for a while
must pass the Mahalanobis gate with the full joint covariance, then degree, clearance and bearings
under the best pairing of the departures, and last the registration of the walls around it.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.autonomy.slam.ekf import Belief, distances
from gvgbot.autonomy.slam.graph import Kind, Vertex
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.ranges import Range

_SIGMA_PER_M = 0.015  # of a vertex's place, m per metre from which it is seen
_SIGHT = 0.5  # of that is what a sight errs; on another visit the place may look another
_UNSETTLED = 3.0  # times as far off where what is not seen yet may move it, at least
_CLEARANCE_SHARE = 0.15  # by which two sightings may differ in a wide space
_DEGREE_SHARE = 0.4  # by which degrees may differ
_BESIDE_M = 0.4  # where a vertex is known to be, and where it is: as far apart as that may be


@dataclass(frozen=True, slots=True, kw_only=True)
class RecognitionConfig:
    """Gates of the tests."""

    tracked_m: Annotated[float, Range(1.0, 100.0)] = (
        12.0  # driven since last seen: told by place alone
    )
    same_place_m: Annotated[float, Range(0.2, 2.0)] = 0.8  # vertices closer than this may be one
    gate: Annotated[float, Range(1.0, 50.0)] = (
        13.8  # squared Mahalanobis distance, 2 degrees of freedom
    )
    # by which two sightings of one vertex may differ
    clearance_m: Annotated[float, Range(0.05, 2.0)] = 0.3
    bearing_deg: Annotated[float, Range(5.0, 90.0)] = 40.0  # by which departing edges may differ
    # of a vertex's place as seen from near
    detection_sigma_m: Annotated[float, Range(0.01, 1.0)] = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A vertex as seen now: position (2,) and bearings in the local frame.

    Of the edges that leave at bearings that are `unclear` as well, too little is seen. Where it is
    not `settled`, what is not seen yet may move it.
    """

    position: Array
    clearance: float
    bearings: tuple[float, ...]
    meetpoint: bool
    unclear: tuple[float, ...] = ()
    settled: bool = True

    @property
    def kind(self) -> Kind:
        """What a vertex of this shape is."""
        return "meetpoint" if self.meetpoint else "endpoint"


def detection_covariance(
    distance: float, config: RecognitionConfig, *, settled: bool = True
) -> Array:
    """Covariance (2, 2) by which a vertex seen from a distance may be a known one, m^2."""
    sigma = math.hypot(config.detection_sigma_m, _SIGMA_PER_M * distance)
    return np.eye(2) * (sigma * (1.0 if settled else _UNSETTLED)) ** 2


def sight_covariance(distance: float, config: RecognitionConfig, *, settled: bool = True) -> Array:
    """Covariance (2, 2) of what one visit says of a vertex position from a distance, m^2."""
    return np.asarray(
        _SIGHT**2 * detection_covariance(distance, config, settled=settled), np.float64
    )


def match_bearings(
    seen: tuple[float, ...], known: dict[int, float], limit: float
) -> dict[int, int]:
    """Pairs of directions that agree, closest first: index of `seen` -> key of `known`."""
    pairs = sorted(
        (abs(wrap_angle(a - b)), i, key) for i, a in enumerate(seen) for key, b in known.items()
    )
    matched: dict[int, int] = {}
    for angle, i, key in pairs:
        if angle > limit:
            break
        if i not in matched and key not in matched.values():
            matched[i] = key
    return matched


def gate_distances(
    belief: Belief, sighting: Sighting, local_base: Pose, config: RecognitionConfig
) -> dict[int, tuple[float, float]]:
    """Squared Mahalanobis distance and metres between a sighting and each known vertex, by id."""
    seen = local_base.inverse().transform(sighting.position)
    R = detection_covariance(float(np.hypot(*seen)), config)
    d2, metres = distances(belief, seen, R)
    return dict(zip(belief.ids, zip(d2.tolist(), metres.tolist(), strict=True), strict=True))


def looks_alike(
    vertex: Vertex, sighting: Sighting, local_vertex: Pose, config: RecognitionConfig
) -> bool:
    """Whether kind, degree, clearance and bearings agree, the vertex's frame at `local_vertex`.

    A degree that differs by one passes: of a pair of close meetpoints either may be seen as one. So
    does more where many edges leave, of which some cannot be seen, and what is unclear may be one,
    or none: behind who comes through a door are corners that nobody has seen.
    Clearance changes at most as much as the place: a vertex found from afar may have lain beside.
    """
    if vertex.kind != sighting.kind:
        return False
    seen, possible = len(sighting.bearings), (*sighting.bearings, *sighting.unclear)
    differing = max(1.0, _DEGREE_SHARE * min(vertex.degree, seen))
    certain = len(set(sighting.bearings) - set(sighting.unclear))
    if not certain - differing <= vertex.degree <= len(possible) + differing:
        return False
    beside = min(float(np.hypot(*(sighting.position - local_vertex.position))), _BESIDE_M)
    tolerance = max(config.clearance_m, _CLEARANCE_SHARE * vertex.clearance) + beside
    if abs(vertex.clearance - sighting.clearance) > tolerance:
        return False
    matched = _turns(vertex, possible, local_vertex, config)
    return len(matched) >= min(vertex.degree, seen)


def turn_by_bearings(
    vertex: Vertex, sighting: Sighting, local_vertex: Pose, config: RecognitionConfig
) -> float:
    """By how much its departures are seen turned, rad, the vertex's frame at `local_vertex`."""
    return float(np.mean(_turns(vertex, sighting.bearings, local_vertex, config) or [0.0]))


def _turns(
    vertex: Vertex, seen: tuple[float, ...], local_vertex: Pose, config: RecognitionConfig
) -> list[float]:
    """By how much each departure that is found among those seen is turned, rad."""
    known = {key: half.bearing + local_vertex.theta for key, half in vertex.half_edges.items()}
    matched = match_bearings(seen, known, math.radians(config.bearing_deg))
    return [wrap_angle(seen[i] - known[key]) for i, key in matched.items()]
