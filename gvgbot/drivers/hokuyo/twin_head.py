"""The measuring half of a simulated laser: its clock, its motor, and the scans it makes."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gvgbot.drivers.hokuyo.clock_sync import WRAP_MS
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.scip import encode_scan
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig
from gvgbot.drivers.hokuyo.twin_readings import (
    LARGEST_TWO_CHARACTERS,
    clustered,
    intensities_of,
    noisy_readings,
    picks,
    with_mixed_pixels,
    with_thin_things,
)
from gvgbot.geometry import Array

LESS_DROPOUTS = 0.8  # with high sensitivity, which detects a fifth more
ROUNDING = 1e-6  # of a scan or a millisecond, so that whole numbers stay whole


class Head:
    """Turns the world into frames, on the grid of its motor and the stamps of its clock."""

    def __init__(
        self,
        config: HokuyoTwinConfig,
        sense: Callable[[float, int], Array],
        seed: int,
        on_since: float,
    ) -> None:
        """`on_since` is when its clock showed what it does at power-up, s."""
        self.model = MODELS[config.model]
        self.period = self.model.parameters.period * (1.0 + config.motor_error_ppm * 1e-6)
        self.is_sensitive = False
        self._full_speed_period = self._former_period = self.period
        self._reference = (0, 0.0)  # number and time (s) of a scan, from which all others count
        self._config = config
        self._sense = sense
        self._rng = np.random.default_rng(seed)
        self._rate = 1000.0 * (1.0 + config.clock_drift_ppm * 1e-6)  # ms per s
        # of a millisecond that is gone at power-up: no clock ticks as a turn of the motor begins
        self._fraction = float(np.random.default_rng((seed, 7)).random())
        self._start_ms = config.clock_start_ms + self._fraction - on_since * self._rate

    def device_ms(self, now: float) -> int:
        """The laser's clock at a time (s)."""
        return math.floor(now * self._rate + self._start_ms + ROUNDING) % WRAP_MS

    def reset_clock(self, now: float) -> None:
        """Let the clock begin again from zero."""
        self._start_ms = self._fraction - now * self._rate

    def set_speed(self, share: float, now: float) -> None:
        """Turn at this share of the full speed, from the next scan on."""
        number = self.next_scan(now)
        self._reference = number, self.scan_start(number)
        self._former_period, self.period = self.period, self._full_speed_period / share

    def scan_start(self, number: int) -> float:
        """When the scan of this number begins, s."""
        known, start = self._reference
        period = self.period if number >= known else self._former_period
        return start + (number - known) * period

    def next_scan(self, now: float) -> int:
        """The number of the first scan that begins from now on."""
        return math.ceil(self._turns(now) - ROUNDING)

    def turn_end(self, now: float) -> float:
        """When the turn that is under way is over, s."""
        return self.scan_start(math.floor(self._turns(now) + ROUNDING) + 1)

    def _turns(self, now: float) -> float:
        """Scans up to now, the one under way in part."""
        known, start = self._reference
        return known + (now - start) / self.period

    def latest_scan(self, request: ScanRequest, now: float) -> int:
        """The number of the last scan that is finished by now."""
        return max(0, math.floor(self._turns(now - self.latency(request)) + ROUNDING))

    def latency(self, request: ScanRequest) -> float:
        """From step 0 of a scan to the first byte of its frame, s."""
        sweep = request.end * self.period / self.model.parameters.steps_per_turn
        return sweep + self._config.processing_latency_s

    def frame(
        self, request: ScanRequest, status: str, number: int, *, is_blind: bool = False
    ) -> bytes:
        """The message with the scan of this number, measured now."""
        stamp = self.scan_start(number)
        config, model = self._config, self.model
        first = model.parameters.first_step
        steps = request.end - first + 1
        ranges = self._sense(stamp, steps)[request.start - first : steps]
        dropouts = config.dropout_fraction * (LESS_DROPOUTS if self.is_sensitive else 1.0)
        ranges = with_mixed_pixels(ranges, config.mixed_pixel_fraction, self._rng)
        dropouts = 1.0 if is_blind else dropouts
        farther = config.range_sigma_share * np.fmin(ranges, model.usable_mm / 1000.0)
        sigma = np.maximum(config.range_sigma_m, farther)
        readings = noisy_readings(ranges, model, sigma, dropouts, self._rng)
        scan = ScanReply(request, status, self.device_ms(stamp), readings)
        return self._spoil(encode_scan(self._filled(scan, readings)))

    def _filled(self, scan: ScanReply, readings: Values) -> ScanReply:
        """The scan with what its command asks for: clusters, echoes, intensities."""
        request, shortest = scan.request, self.model.parameters.range_min_mm
        if request.width == 2:
            readings = np.minimum(readings, LARGEST_TWO_CHARACTERS)
        if request.numbers == 1 and not request.is_multi_echo:
            return replace(scan, ranges=clustered(readings, request.group, shortest))
        strengths = intensities_of(readings, shortest)
        chosen = picks(readings, request.group, shortest)
        readings, strengths = readings[chosen], strengths[chosen]
        if not request.is_multi_echo:
            return replace(scan, ranges=readings, intensities=strengths)
        echoes = with_thin_things(
            readings, strengths, shortest, self._config.double_echo_fraction, self._rng
        )
        wanted = echoes.intensities if request.numbers == 2 else None
        return replace(scan, ranges=echoes.readings, intensities=wanted, echoes=echoes.counts)

    def _spoil(self, frame: bytes) -> bytes:
        if self._rng.random() >= self._config.bad_checksum_fraction:
            return frame
        middle = len(frame) // 2
        return frame[:middle] + bytes((frame[middle] ^ 1,)) + frame[middle + 1 :]

    def is_lucky(self, fraction: float) -> bool:
        """Whether something that happens to this fraction happens now."""
        return fraction > 0.0 and bool(self._rng.random() < fraction)
