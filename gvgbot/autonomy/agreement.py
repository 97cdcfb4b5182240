"""Whether measurements of what ought to be 0 agree that it is, or that it is not."""

import math

import numpy as np

_MEASURED = 5  # that have to agree as a rule
_MOST = 3.0  # times as far; what seems to be more is no scale: wheels spin, or somebody walks


class Agreement:
    """Adds up measurements: one by itself may be wrong, and several have to say the same."""

    def __init__(self, tolerance: float, measured: int = _MEASURED) -> None:
        """What is off by less does no harm; so many measurements have to agree."""
        self._tolerance, self._measured, self._values = tolerance, measured, np.empty(0)
        self.is_settled = False  # it is as it should be

    @property
    def off(self) -> float | None:
        """How far it is off; None if it may be right."""
        values = self._values
        if len(values) < self._measured or self.is_settled:
            return None
        is_off = values.min() > self._tolerance or values.max() < -self._tolerance
        return float(np.median(values)) if is_off else None

    def note(self, value: float) -> None:
        """Account for one more."""
        self._values = np.append(self._values[1 - self._measured :], value)
        is_right = abs(np.median(self._values)) < self._tolerance / 2
        self.is_settled |= len(self._values) == self._measured and bool(is_right)

    def note_scale(self, moved: float, told: float) -> None:
        """Account for a motion and what was told of it, by the logarithm of their ratio."""
        if 1.0 / _MOST < moved / told < _MOST:
            self.note(math.log(moved / told))
