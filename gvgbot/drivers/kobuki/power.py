"""Battery and charger of a simulated base."""

from typing import Literal

FULL_V = 16.7  # of four cells of lithium ions

Source = Literal["dock", "adapter"]
_CHARGED = {"dock": 2, "adapter": 18}
_CHARGING = {"dock": 6, "adapter": 22}


class Power:
    """The voltage goes down at one rate and, on a charger, up at another until it is full."""

    def __init__(self, volts: float, drain_v_per_h: float, charge_v_per_h: float) -> None:
        self.volts = volts
        self.source: Source | None = None
        self._drain, self._charge = drain_v_per_h, charge_v_per_h

    def advance(self, dt: float) -> None:
        """Let so many seconds pass."""
        rate = -self._drain if self.source is None else self._charge
        after = self.volts + rate * dt / 3600.0
        self.volts = after if self.source is None else max(self.volts, min(after, FULL_V))

    @property
    def charger(self) -> int:
        """The state of the charger, as the base reports it."""
        if self.source is None:
            return 0
        return (_CHARGED if self.volts >= FULL_V else _CHARGING)[self.source]
