"""The keyframes to draw: the new ones, or all again from better places after loops were closed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy import events
from gvgbot.autonomy.estimate import smoothed_keyframes, still_past
from gvgbot.autonomy.keyframes import Keyframe, Step
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.geometry import Pose, rows_of, wrap_angles

# after which the past may be known better
CORRECTIONS = events.LoopClosed | events.DoubtSettled | events.ClosureRevoked | events.Finished
TOLERANCE_M = 0.05  # by which what is drawn may be wrong: a cell of the grid
_WALLS_M = 4.0  # about so far off they are: a turn moves them by so much times its angle
_REST_S = 0.02  # for each keyframe, between drawing all again and the next time


class Portion(NamedTuple):
    """Keyframes to draw, as they are known now; instead of all before, or after those.

    `breaks` are those of them to which no way leads from the one before; the first `lent` came with
    another's map, and the robot has not been there.
    """

    keyframes: Sequence[Keyframe]
    is_all: bool
    breaks: frozenset[int] = frozenset()
    lent: int = 0


class LivePast:
    """What somebody has drawn of the robot's past, and whether it still is the truth."""

    def __init__(self) -> None:
        self._drawn: list[Pose] = []  # map_base of each keyframe
        self._taken = 0  # keyframes
        self._first: Keyframe | None = None  # of those
        self._is_doubtful = True  # what an earlier life has left may have been corrected since
        self._rests_until = -float("inf")  # stamp

    def doubt(self, *, at_last: bool = False) -> None:
        """Note that the past may be known better by now; `at_last` there is no later update."""
        self._is_doubtful = True
        if at_last:
            self._rests_until = -float("inf")

    def update(self, pipeline: Pipeline, stamp: float) -> Callable[[], Portion] | None:
        """A function that finds what is to be drawn, in a thread or later; None: nothing.

        Call each such function before asking for the next. Where somebody else drives, only what is
        new is found: the best estimate takes too long there.
        """
        past, solved = pipeline.past, None
        if not past.keyframes:
            return None
        if self._taken > len(past.keyframes):  # the latest of a long way was all that stayed
            self._taken = len(past.keyframes)
            self._drawn[self._taken - 1 :] = [past.keyframes[-1].map_base]
        is_other = self._first is not None and self._first is not past.keyframes[0]
        self._first = past.keyframes[0]
        if is_other:  # another map has begun
            self._taken, self._drawn = 0, []
        new = past.keyframes[self._taken :]
        breaks = _breaks(past.steps, self._taken, len(past.keyframes))
        lent = max(0, past.lent - self._taken)
        self._taken += len(new)
        if self._is_doubtful and stamp >= self._rests_until and not pipeline.led:
            self._is_doubtful, solved = False, still_past(pipeline)
        if not new and solved is None:
            return None
        return partial(self._portion, Portion(new, is_other, breaks, lent), solved, stamp)

    def _portion(self, new: Portion, pipeline: Pipeline | None, stamp: float) -> Portion:
        self._drawn += [keyframe.map_base for keyframe in new.keyframes]
        if pipeline is None:
            return new
        best, past = smoothed_keyframes(pipeline), pipeline.past
        if _farthest(self._drawn, best) < TOLERANCE_M:
            return new
        self._drawn, self._rests_until = best, stamp + _REST_S * len(best)
        moved = zip(past.keyframes, best, strict=True)
        keyframes = [replace(old, map_base=pose) for old, pose in moved]
        return Portion(keyframes, True, _breaks(past.steps, 0, len(best)), past.lent)


def _breaks(steps: Sequence[Step], first: int, end: int) -> frozenset[int]:
    """Which of the keyframes from a first one on, counted from there, no known step leads to."""
    leading = enumerate(steps[: max(0, end - 1)], start=1)
    return frozenset(i - first for i, step in leading if i >= first and step.is_unknown)


def _farthest(drawn: Sequence[Pose], best: Sequence[Pose]) -> float:
    """How far (m) walls seen from poses move, at most, when these are corrected."""
    dx, dy, turn = (rows_of(best) - rows_of(drawn)).T
    return float((np.hypot(dx, dy) + _WALLS_M * np.abs(wrap_angles(turn))).max())
