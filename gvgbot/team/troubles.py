"""What befalls a simulated team, drawn from the seed: silence, a late start, a breakdown."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.ranges import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class TroublesConfig:
    """Troubles of robots that explore a simulated world together; the seed draws whose."""

    silent_s: Annotated[float, Range(0.0, 3600.0)] = 0.0  # one hears and tells nothing for so long
    late_s: Annotated[float, Range(0.0, 3600.0)] = 0.0  # one sets out so much later than the others
    breaks_down: bool = False  # one stands still from some moment on, and tells nothing any more
    within_s: Annotated[float, Range(1.0, 36_000.0)] = 120.0  # when silence or breakdown begins


class Troubles:
    """Which of `count` robots have which trouble when, in s since the first ones set out."""

    def __init__(self, config: TroublesConfig, count: int, seed: int) -> None:
        rng = np.random.default_rng(np.random.SeedSequence([seed, count]))
        self._config = config
        self._silent, self._late = (int(robot) for robot in rng.permutation(count)[:2])
        self._broken = int(rng.integers(count))
        self._silent_from, self._broken_from = rng.uniform(0.0, config.within_s, 2).tolist()

    def is_silent(self, robot: int, seconds: float) -> bool:
        """Whether the network is cut off for a robot."""
        since = seconds - self._silent_from
        return robot == self._silent and 0.0 <= since < self._config.silent_s

    def sets_out_s(self, robot: int) -> float:
        """When a robot begins."""
        return self._config.late_s if robot == self._late else 0.0

    def breaks_down_s(self, robot: int) -> float:
        """When it stops for good; inf: never."""
        is_broken = self._config.breaks_down and robot == self._broken
        return self._broken_from if is_broken else math.inf
