"""From a scan's readings in millimetres and error codes to the HAL's Scan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gvgbot.drivers.hokuyo.config import Echo, HokuyoConfig
from gvgbot.drivers.hokuyo.models import Parameters, find_model, nothing_code
from gvgbot.drivers.hokuyo.modes import LONGEST_IN_TWO_CHARACTERS
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan


@dataclass(frozen=True, slots=True)
class ScanGeometry:
    """What is the same in every scan of a stream: frames, limits (mm) and times (s).

    A reading up to `longest_mm` is a range. Where nothing is hit, the way is free for `free_mm`, as
    the maker guarantees: only what reflects well is seen from farther off.

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
    free_mm: int
    nothing_code: int | None
    is_reversed: bool = False
    group: int = 1  # steps per beam

    def scan(self, readings: Values, stamp: float) -> Scan:
        """The scan whose step 0 was at `stamp` (s), of readings (N,) in the order of the steps."""
        return Scan(
            stamp=stamp + self.first_beam_delay,
            ranges=self._ranges(readings[::-1] if self.is_reversed else readings),
            angle_min=self.angle_min,
            angle_increment=self.angle_increment,
            range_min=self.shortest_mm / 1000.0,
            range_max=self.free_mm / 1000.0,
            time_increment=self.time_increment,
            base_laser=self.base_laser,
        )

    def _ranges(self, readings: Values) -> Array:
        ranges = readings.astype(np.float64) / 1000.0
        ranges[readings < self.shortest_mm] = np.nan  # SCIP sends error codes as small ranges
        ranges[readings > self.longest_mm] = np.inf
        if self.nothing_code is not None:
            ranges[readings == self.nothing_code] = np.inf
        if self.group > 1:
            ranges = in_the_middle(ranges, self.group).round(3)  # mm, as all others
            ranges[ranges > self.longest_mm / 1000.0] = np.inf
        return ranges


def in_the_middle(ranges: Array, group: int) -> Array:
    """What is due in the middle of each group of steps, of the least range (N,) in each.

    On a slanted wall that was measured at one end of the group. Along a wall 1/r is next to linear;
    where it is another one on one side, the smaller of both steps tells how it is slanted.
    """
    with np.errstate(divide="ignore"):
        nearness = 1.0 / ranges
        before, after = np.diff(nearness[:-1]), np.diff(nearness[1:])
        slant = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
        nearness[1:-1] -= (group - 1) / (2 * group) * slant
        return np.asarray(1.0 / nearness, np.float64)


def scan_geometry(
    config: HokuyoConfig, parameters: Parameters, request: ScanRequest
) -> ScanGeometry:
    """The geometry of the requested scans; what a laser says of its reach holds in any case.

    Old firmware of a listed model may reach less far than its maker says today.
    """
    longest_mm = min(parameters.range_max_mm, round(config.max_range_m * 1000))
    if request.width == 2:
        longest_mm = min(longest_mm, LONGEST_IN_TWO_CHARACTERS)
    model = find_model(parameters.model)
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
        longest_mm=longest_mm,
        free_mm=longest_mm if model is None else min(longest_mm, model.usable_mm),
        nothing_code=nothing_code(parameters),
        is_reversed=config.upside_down,
        group=request.group,
    )


def arrival_delay(config: HokuyoConfig, parameters: Parameters, request: ScanRequest) -> float:
    """From step 0 of a scan to its first byte on an undelayed link, s."""
    return request.end * parameters.step_time + config.processing_latency_s


def one_per_step(
    reply: ScanReply, echo: Echo, parameters: Parameters
) -> tuple[Values, Values | None]:
    """Ranges (steps,) and intensities, if there are any, of the chosen echo of each step.

    An error code is chosen only where a step has nothing else.
    """
    if reply.echoes is None:
        return reply.ranges, reply.intensities
    longest, shortest = parameters.range_max_mm, parameters.range_min_mm
    is_code = (reply.ranges < shortest) | (reply.ranges > longest)
    chosen = _chosen(reply.echoes, is_code, _demerits(reply, echo))
    intensities = None if reply.intensities is None else reply.intensities[chosen]
    return reply.ranges[chosen], intensities


def _demerits(reply: ScanReply, echo: Echo) -> Values:
    """What speaks against each echo: the least of a step is the echo of choice."""
    if echo == "strongest" and reply.intensities is not None:
        return -reply.intensities
    places = np.arange(len(reply.ranges), dtype=np.int32)
    return -places if echo == "last" else places


def _chosen(echoes: Values, is_code: NDArray[np.bool_], demerits: Values) -> NDArray[np.intp]:
    """Where each step's echo of choice stands among all."""
    steps = np.repeat(np.arange(len(echoes)), echoes)
    best_first = np.lexsort((demerits, is_code, steps))
    chosen: NDArray[np.intp] = best_first[np.cumsum(echoes) - echoes]
    return chosen
