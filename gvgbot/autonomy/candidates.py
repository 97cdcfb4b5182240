"""Vertices that have been seen, but not yet often enough to be believed."""

import math
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from gvgbot.autonomy.gvg.local import LocalNode
from gvgbot.autonomy.recogniser import Recognition
from gvgbot.autonomy.slam.recognition import Sighting
from gvgbot.geometry import Array, wrap_angle
from gvgbot.ranges import Range

_PASSED_M = 1.0  # from so near, what cannot be seen of an edge must be driven to
_LEFT_BEHIND_M = 0.3  # the robot has passed a point if it was nearer by this
_SAME_M = 0.5  # sightings nearer than this are of one candidate
_MEMORY_M = 12.0  # driven, after which a candidate is forgotten
_MISTAKEN_M = 1.0  # around a mistake
_NEAR_M = 6.0  # about a mistake: as far as walls of glass go, or so
_MISTAKES = 2  # at a place of late, after which a vertex there is only believed from near
_LATE_M = 100.0  # driven since a mistake
_STUBBORN = 4  # mistakes at a place, after which what comes back there once more is left alone
_MISTAKES_KEPT_M = 1000.0  # driven, after which a mistake is forgotten
_SAME_RAD = 0.5  # departures that differ by less are the same ones


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidatesConfig:
    """How often something must be seen before it is believed."""

    meetpoint_sightings: Annotated[int, Range(1, 50)] = 4  # before a meetpoint enters the map
    endpoint_sightings: Annotated[int, Range(1, 50)] = 6  # before an endpoint enters the map


@dataclass(slots=True, eq=False)
class Candidate:
    """A vertex not yet believed; `nearest` is how near to it the robot has been, m.

    `may_be` is what the latest look found that left more than one reading open.
    """

    position: Array
    meetpoint: bool
    seen_at: float  # metres driven
    nearest: float = math.inf
    unclear: tuple[float, ...] = ()  # bearings of edges of which too little is seen
    sightings: int = 0
    near_sightings: int = 0
    may_be: Recognition = field(default_factory=Recognition)


class Mistake(NamedTuple):
    """A vertex that has proved to be none: its place and bearings, local frame, and metres driven.

    The bearings are those in which edges seemed to leave.
    """

    position: Array
    bearings: tuple[float, ...]
    at: float


class Candidates:
    """Counts the sightings of each candidate."""

    def __init__(self, config: CandidatesConfig) -> None:
        self._config = config
        self._all: list[Candidate] = []
        self._mistakes: list[Mistake] = []

    def note_mistake(self, mistake: Mistake) -> None:
        """Take down that a vertex has proved to be none."""
        late = mistake.at - _MISTAKES_KEPT_M
        self._mistakes = [one for one in self._mistakes if one.at > late]
        self._mistakes.append(mistake)

    def forget(self) -> None:
        """Begin anew: the local frame is another one."""
        self._all.clear()
        self._mistakes.clear()

    def note(self, sighting: Sighting, away: float, travelled: float) -> Candidate:
        """The candidate of a sighting from `away` metres, with this sighting counted."""
        self._all = [c for c in self._all if travelled - c.seen_at < _MEMORY_M]
        candidate = self._nearest(sighting)
        if candidate is None:
            candidate = Candidate(sighting.position, sighting.meetpoint, travelled)
            self._all.append(candidate)
        candidate.position, candidate.seen_at = sighting.position, travelled
        candidate.unclear = sighting.unclear
        candidate.nearest = min(candidate.nearest, away)
        candidate.sightings += 1
        candidate.near_sightings += away < _PASSED_M
        return candidate

    def _nearest(self, sighting: Sighting) -> Candidate | None:
        for candidate in self._all:
            apart = np.hypot(*(candidate.position - sighting.position))
            if candidate.meetpoint == sighting.meetpoint and apart < _SAME_M:
                return candidate
        return None

    def is_believable(self, candidate: Candidate, node: LocalNode, away: float) -> bool:
        """Whether it has been seen often enough; a suspect must have been passed, too.

        A side edge that could not be seen to the end in passing is not forgotten: it becomes a
        frontier, and a closer look decides, once. What has proved to be none whenever the robot
        came near is not driven to for ever.
        """
        if away > _PASSED_M and self._is_mistakable(candidate):
            return False
        if node.is_suspect:
            if self.was_looked_at(candidate.position, *candidate.unclear):
                return False
            passed = away > candidate.nearest + _LEFT_BEHIND_M
            enough = self._config.meetpoint_sightings * (1 if passed else 2)
            return candidate.near_sightings >= enough
        return candidate.sightings >= self._needed(candidate)

    def _is_mistakable(self, candidate: Candidate) -> bool:
        late = candidate.seen_at - _LATE_M
        return sum(one.at > late for one in self._mistaken_at(candidate.position)) >= _MISTAKES

    def was_looked_at(self, place: Array, *bearings: float) -> bool:
        """Whether nothing was behind side edges at a place (2,) when the robot drove there.

        Place and bearings are of the local frame.
        """
        return any(_are_among(bearings, one.bearings) for one in self._mistaken_at(place))

    def is_stubborn(self, position: Array) -> bool:
        """Whether what was seen at a place (2,), local frame, came back whenever it was taken out.

        Sight at a threshold may go on like that for ever, and the robot with it.
        """
        return len(self._mistaken_at(position)) >= _STUBBORN

    def was_mistaken_near(self, place: Array) -> bool:
        """Whether anything some metres about a place (2,), local frame, has proved to be none."""
        return any(np.hypot(*(place - one.position)) < _NEAR_M for one in self._mistakes)

    def _mistaken_at(self, position: Array) -> list[Mistake]:
        """The mistakes about a place (2,)."""
        return [one for one in self._mistakes if _is_at(one, position)]

    def is_examined(self, candidate: Candidate) -> bool:
        """Whether it has been seen twice as often as needed: enough to tell it from a known one."""
        return candidate.sightings >= 2 * self._config.meetpoint_sightings

    def _needed(self, candidate: Candidate) -> int:
        config = self._config
        return config.meetpoint_sightings if candidate.meetpoint else config.endpoint_sightings

    def drop(self, candidate: Candidate) -> None:
        """Forget a candidate, for it is a vertex now."""
        self._all.remove(candidate)


def _is_at(mistake: Mistake, position: Array) -> bool:
    return bool(np.hypot(*(position - mistake.position)) < _MISTAKEN_M)


def _are_among(some: tuple[float, ...], others: tuple[float, ...]) -> bool:
    """Whether each of some bearings is one of the others."""
    return all(any(abs(wrap_angle(a - b)) < _SAME_RAD for b in others) for a in some)
