"""What was felt or forbidden but not seen: obstacles that only the planner knows of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.geometry import Array, Pose
from gvgbot.ranges import Range

_SPREAD_RAD = 0.35  # a bumper's middle is felt from this far to either side
_BEYOND_M = 0.03  # of the robot's rim


@dataclass(frozen=True, slots=True, kw_only=True)
class HazardConfig:
    """How long an obstacle is remembered that was only felt."""

    memory_m: Annotated[float, Range(1.0, 1000.0)] = 15.0  # driven; a second hit makes it lasting
    same_m: Annotated[float, Range(0.05, 2.0)] = 0.35  # hits nearer than this are of one thing
    blocking_hits: Annotated[int, Range(1, 20)] = 3  # see blocking_m
    blocking_m: Annotated[float, Range(0.1, 5.0)] = 1.0  # so many hits so near block the way


@dataclass(slots=True, eq=False)
class Hazard:
    """Something that was felt once."""

    points: Array  # (N, 2) local frame
    travelled: float  # metres driven when it was felt
    lasting: bool

    @property
    def centre(self) -> Array:
        """The middle (2,) of its points."""
        return np.asarray(self.points.mean(axis=0))


class Hazards:
    """Obstacles that were felt, and virtual walls."""

    def __init__(self, config: HazardConfig) -> None:
        self._config = config
        self.felt: list[Hazard] = []
        self.virtual_walls = np.empty((0, 2))  # points of those in reach, local frame

    def add(
        self,
        local_base: Pose,
        bearings: Sequence[float],
        radius: float,
        travelled: float,
        *,
        lasting: bool,
    ) -> bool:
        """Remember what was felt at the rim, at bearings (rad), of a robot of a radius (m).

        True if that many hits so near mean that there is no way through.
        """
        self.forget(travelled)
        hazard = Hazard(_rim(local_base, bearings, radius + _BEYOND_M), travelled, lasting)
        away = [float(np.hypot(*(other.centre - hazard.centre))) for other in self.felt]
        for other, metres in zip(self.felt, away, strict=True):
            if metres < self._config.same_m:
                other.lasting = hazard.lasting = True
        self.felt.append(hazard)
        hits = 1 + sum(metres < self._config.blocking_m for metres in away)
        return hits >= self._config.blocking_hits

    def take_over(self, other: "Hazards", other_own: Pose, metres: float) -> None:
        """Go on in another's local frame, which sees this one's at a pose, with what it has felt.

        It began to count when so many metres had been driven.
        """
        for hazard in self.felt:
            hazard.points = other_own.transform(hazard.points)
        for hazard in other.felt:
            hazard.travelled += metres
        self.felt += other.felt

    def forget(self, travelled: float) -> None:
        """Let go what was felt too long ago, in metres driven."""
        self.felt = [
            h for h in self.felt if h.lasting or travelled - h.travelled < self._config.memory_m
        ]

    @property
    def points(self) -> Array:
        """All of them (N, 2), local frame, virtual walls as well."""
        return np.concatenate([*(h.points for h in self.felt), self.virtual_walls])

    @property
    def doubtful(self) -> Array:
        """Those that were felt only once (N, 2), local frame."""
        once = (h.points for h in self.felt if not h.lasting)
        return np.concatenate([np.empty((0, 2)), *once])


def _rim(local_base: Pose, bearings: Sequence[float], reach: float) -> Array:
    angles = np.add.outer(np.array(bearings), [-_SPREAD_RAD, 0.0, _SPREAD_RAD]).ravel()
    return local_base.transform(reach * np.stack([np.cos(angles), np.sin(angles)], axis=1))
