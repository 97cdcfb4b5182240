"""From a scan's readings in millimetres and error codes to the HAL's Scan."""

from dataclasses import dataclass

import numpy as np

from gvgbot.drivers.hokuyo.config import Echo, HokuyoConfig
from gvgbot.drivers.hokuyo.models import Parameters, find_model
from gvgbot.drivers.hokuyo.modes import LONGEST_IN_TWO_CHARACTERS
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan


@dataclass(frozen=True, slots=True)
class ScanGeometry:
    """What is the same in every scan of a stream: frames, limits (mm) and times (s).

    Beams count anticlockwise seen from above. A laser that hangs upside down turns the other way:
    its first beam is its last step, and `time_increment` is negative.
    """

    base_laser: Pose
    angle_min: float
    angle_increment: float
    time_increment: float
    first_beam_delay: float  # step 0 to the first beam
    shortest_mm: int
    longest_mm: int
    nothing_code: int | None
    is_reversed: bool = False

    def scan(self, readings: Values, stamp: float) -> Scan:
        """The scan whose step 0 was at `stamp` (s), of readings (N,) in the order of the steps."""
        return Scan(
            stamp=stamp + self.first_beam_delay,
            ranges=self._ranges(readings[::-1] if self.is_reversed else readings),
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


def scan_geometry(
    config: HokuyoConfig, parameters: Parameters, request: ScanRequest
) -> ScanGeometry:
    """The geometry of the requested scans; models outside the catalogue get their own limits."""
    model = find_model(parameters.model)
    usable_mm = parameters.range_max_mm if model is None else model.usable_mm
    if request.width == 2:
        usable_mm = min(usable_mm, LONGEST_IN_TWO_CHARACTERS)
    lowest = request.start + (request.group - 1) / 2
    highest = lowest + (request.values - 1) * request.group
    first = highest if config.upside_down else lowest
    sign = -1.0 if config.upside_down else 1.0
    return ScanGeometry(
        base_laser=config.base_laser,
        angle_min=sign * parameters.bearing(first),
        angle_increment=request.group * parameters.step_angle,
        time_increment=sign * request.group * parameters.step_time,
        first_beam_delay=first * parameters.step_time,
        shortest_mm=max(parameters.range_min_mm, round(config.min_range_m * 1000)),
        longest_mm=min(usable_mm, round(config.max_range_m * 1000)),
        nothing_code=None if model is None else model.nothing_code,
        is_reversed=config.upside_down,
    )


def arrival_delay(config: HokuyoConfig, parameters: Parameters, request: ScanRequest) -> float:
    """From step 0 of a scan to its first byte on an undelayed link, s."""
    return request.end * parameters.step_time + config.processing_latency_s


def one_per_step(reply: ScanReply, echo: Echo) -> tuple[Values, Values | None]:
    """Ranges (steps,) and intensities, if there are any, of the chosen echo of each step."""
    if reply.echoes is None:
        return reply.ranges, reply.intensities
    chosen = _chosen(reply.echoes, reply.intensities, echo)
    intensities = None if reply.intensities is None else reply.intensities[chosen]
    return reply.ranges[chosen], intensities


def _chosen(echoes: Values, intensities: Values | None, echo: Echo) -> Values:
    """Where each step's echo of choice stands among all."""
    firsts: Values = (np.cumsum(echoes) - echoes).astype(np.int32)
    if echo == "last":
        return firsts + echoes - 1
    if echo != "strongest" or intensities is None:
        return firsts
    steps = np.repeat(np.arange(len(echoes)), echoes)
    by_strength = np.lexsort((-intensities, steps))
    return by_strength[firsts].astype(np.int32)
