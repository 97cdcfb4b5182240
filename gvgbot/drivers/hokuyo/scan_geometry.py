"""From a scan's readings in millimetres and error codes to the HAL's Scan."""

from dataclasses import dataclass

import numpy as np

from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan


@dataclass(frozen=True, slots=True)
class ScanGeometry:
    """What is the same in every scan of a stream: frames, limits (mm) and times (s)."""

    base_laser: Pose
    angle_min: float
    angle_increment: float
    time_increment: float
    first_beam_delay: float  # step 0 to the first beam
    arrival_delay: float  # step 0 to the first byte
    shortest_mm: int
    longest_mm: int
    nothing_code: int | None

    def scan(self, readings: Values, arrival: float) -> Scan:
        """The scan whose first byte would arrive at `arrival` (s) on an undelayed link."""
        return Scan(
            stamp=arrival - self.arrival_delay + self.first_beam_delay,
            ranges=self._ranges(readings),
            angle_min=self.angle_min,
            angle_increment=self.angle_increment,
            range_min=self.shortest_mm / 1000.0,
            range_max=self.longest_mm / 1000.0,
            time_increment=self.time_increment,
            base_laser=self.base_laser,
        )

    def _ranges(self, readings: Values) -> Array:
        ranges = readings.astype(np.float64) / 1000.0
        ranges[readings < self.shortest_mm] = np.nan  # SCIP sends error codes as small ranges
        ranges[readings > self.longest_mm] = np.inf
        if self.nothing_code is not None:
            ranges[readings == self.nothing_code] = np.inf
        return ranges
