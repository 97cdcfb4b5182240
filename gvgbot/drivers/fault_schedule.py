"""When a twin's faults happen: drawn at random, at set times, or injected by call."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.ranges import Range

PerHour = Annotated[float, Range(0.0, 36_000.0)]
_HOUR = 3600.0  # s


@dataclass(frozen=True, slots=True)
class Rate:
    """How often a fault begins, and how long it lasts, s.

    It also begins so many seconds after the first `advance`, each of `at`.
    """

    per_h: float
    duration: float
    at: tuple[float, ...] = ()


class FaultSchedule:
    """Which faults are on. `counts` tells how often each has begun."""

    def __init__(self, rates: Mapping[str, Rate], rng: np.random.Generator) -> None:
        self.counts: Counter[str] = Counter()
        self._rates = rates
        self._rng = rng
        self._starts: dict[str, float] | None = None  # drawn when the time is first known
        self._ends: dict[str, float] = {}
        self._planned: list[tuple[float, str]] = []  # set times still to come, earliest first
        self._injected: list[tuple[str, float]] = []
        self._due = math.inf

    def inject(self, name: str, duration: float) -> None:
        """Let a fault begin at the next `advance`, for so long (s)."""
        self._injected.append((name, duration))
        self._due = -math.inf

    def advance(self, now: float) -> list[str]:
        """The faults that have begun up to now (s), in order of name."""
        if self._starts is not None and now < self._due:
            return []
        began = self._begin(now)
        self._due = self._earliest()
        return began

    def _begin(self, now: float) -> list[str]:
        if self._starts is None:
            self._starts = {name: self._next_start(name, now) for name in self._rates}
            self._planned = sorted(
                (now + late, name) for name, rate in self._rates.items() for late in rate.at
            )
        self._ends = {name: end for name, end in self._ends.items() if end > now}
        began = {name: self._rates[name].duration for name in _due(self._starts, now)}
        for name, duration in began.items():
            self._starts[name] = self._next_start(name, now + duration)
        while self._planned and self._planned[0][0] <= now:
            _, name = self._planned.pop(0)
            began[name] = self._rates[name].duration
        began |= dict(self._injected)
        self._injected.clear()
        for name, duration in began.items():
            self._ends[name] = max(now + duration, self._ends.get(name, now))
        self.counts.update(began.keys())
        return sorted(began)

    def is_on(self, name: str) -> bool:
        """Whether a fault was on at the last `advance`."""
        return name in self._ends

    @property
    def any_is_on(self) -> bool:
        """Whether any fault was on at the last `advance`."""
        return bool(self._ends)

    def next_due(self) -> float:
        """When the next fault begins or ends, s; inf if never."""
        return self._due

    def _earliest(self) -> float:
        starts = () if self._starts is None else self._starts.values()
        planned = (stamp for stamp, _ in self._planned[:1])
        return min((*starts, *planned, *self._ends.values()), default=math.inf)

    def _next_start(self, name: str, since: float) -> float:
        per_h = self._rates[name].per_h
        return since + float(self._rng.exponential(_HOUR / per_h)) if per_h > 0.0 else math.inf


def _due(starts: Mapping[str, float], now: float) -> list[str]:
    return [name for name, start in starts.items() if start <= now]
