"""A simulated Hokuyo laser that speaks SCIP 2: bytes in, bytes out, told the time."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from gvgbot.drivers.hokuyo.clock_sync import WRAP_MS
from gvgbot.drivers.hokuyo.models import MODELS, Identity
from gvgbot.drivers.hokuyo.scip import encode_reply, encode_scan
from gvgbot.drivers.hokuyo.scip_codec import encode_number
from gvgbot.drivers.hokuyo.scip_messages import (
    ACCEPTED,
    SCAN_DATA,
    Reply,
    ScanReply,
    ScanRequest,
    parse_request,
)
from gvgbot.drivers.hokuyo.twin_commands import CommandReader, scan_fault, string_fault
from gvgbot.drivers.hokuyo.twin_readings import LARGEST_TWO_CHARACTERS, clustered, noisy_readings
from gvgbot.geometry import Array
from gvgbot.ranges import Range

DENIED = "10"
UNDEFINED = "0E"
ALREADY_ON = "02"
ALREADY_OFF = "03"
ROUNDING = 1e-6  # of a scan or a millisecond, so that whole numbers stay whole


@dataclass(frozen=True, slots=True, kw_only=True)
class HokuyoTwinConfig:
    """Which laser is simulated, and its imperfections."""

    model: Literal["UTM-30LX", "URG-04LX"] = "UTM-30LX"
    range_sigma_m: Annotated[float, Range(0.0, 1.0)] = 0.01
    dropout_fraction: Annotated[float, Range(0.0, 1.0)] = 0.005
    bad_checksum_fraction: Annotated[float, Range(0.0, 1.0)] = 0.0  # of the scans
    processing_latency_s: Annotated[float, Range(0.0, 0.1)] = 0.00475  # last beam to first byte
    clock_drift_ppm: Annotated[float, Range(-1000.0, 1000.0)] = 50.0
    clock_start_ms: Annotated[int, Range(0, WRAP_MS - 1)] = 0


@dataclass(frozen=True, slots=True)
class _Standby:
    """Laser off."""


@dataclass(frozen=True, slots=True)
class _LaserOn:
    """Measuring, but sending only on demand."""


@dataclass(frozen=True, slots=True)
class _TimeMode:
    """Laser off, answering with the time."""


@dataclass(slots=True)
class _Streaming:
    """Sending scans; `frames` are the ones measured but not yet sent, each with its time."""

    request: ScanRequest
    scan_number: int
    is_complete: bool = False
    frames: deque[tuple[float, bytes]] = field(default_factory=deque)


_Phase = _Standby | _LaserOn | _TimeMode | _Streaming


class HokuyoTwin:
    """A laser without I/O, on a given world.

    `sense(stamp)` gives the true ranges (m) at a time, one per step from the model's first to its
    last, inf where there is nothing. It is asked once per scan sent, when that time has come.
    """

    def __init__(
        self, config: HokuyoTwinConfig, sense: Callable[[float], Array], seed: int
    ) -> None:
        self._config = config
        self._model = MODELS[config.model]
        self._sense = sense
        self._rng = np.random.default_rng(seed)
        self._reader = CommandReader()
        self._phase: _Phase = _Standby()
        self._clock_rate = 1000.0 * (1.0 + config.clock_drift_ppm * 1e-6)  # ms per s
        self._clock_start_ms = float(config.clock_start_ms)

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host; the replies to the commands they complete."""
        return b"".join(self._answer(text, now) for text in self._reader.feed(data))

    def next_due(self) -> float:
        """When the next scan is measured or sent; inf when none is."""
        phase = self._phase
        if not isinstance(phase, _Streaming):
            return math.inf
        return min(self._next_stamp(phase), phase.frames[0][0] if phase.frames else math.inf)

    def advance(self, now: float) -> bytes:
        """Measure and send what is due; the bytes of the scans sent."""
        sent = []
        while isinstance(phase := self._phase, _Streaming) and self.next_due() <= now:
            if self._next_stamp(phase) <= self.next_due():
                self._measure(phase)
            else:
                sent.append(self._send(phase))
        return b"".join(sent)

    def _next_stamp(self, phase: _Streaming) -> float:
        return math.inf if phase.is_complete else phase.scan_number * self._model.parameters.period

    def _measure(self, phase: _Streaming) -> None:
        stamp = self._next_stamp(phase)
        if phase.request.count:
            phase.request = replace(phase.request, count=phase.request.count - 1)
            phase.is_complete = phase.request.count == 0
        frame = self._spoil(self._scan(phase.request, SCAN_DATA, stamp))
        phase.frames.append((stamp + self._latency(phase.request), frame))
        phase.scan_number += phase.request.skip + 1

    def _send(self, phase: _Streaming) -> bytes:
        _, frame = phase.frames.popleft()
        if phase.is_complete and not phase.frames:
            self._phase = _Standby()
        return frame

    def _latency(self, request: ScanRequest) -> float:
        """From step 0 of a scan to the first byte of its frame, s."""
        sweep = request.end * self._model.parameters.step_time
        return sweep + self._config.processing_latency_s

    def _scan(self, request: ScanRequest, status: str, stamp: float) -> bytes:
        first, shortest = self._model.parameters.first_step, self._model.parameters.range_min_mm
        ranges = self._sense(stamp)[request.start - first : request.end - first + 1]
        config = self._config
        readings = noisy_readings(
            ranges, self._model, config.range_sigma_m, config.dropout_fraction, self._rng
        )
        if request.width == 2:
            readings = np.minimum(readings, LARGEST_TWO_CHARACTERS)
        values = clustered(readings, request.group, shortest)
        return encode_scan(ScanReply(request, status, self._device_ms(stamp), values))

    def _spoil(self, frame: bytes) -> bytes:
        if self._rng.random() >= self._config.bad_checksum_fraction:
            return frame
        middle = len(frame) // 2
        return frame[:middle] + bytes((frame[middle] ^ 1,)) + frame[middle + 1 :]

    def _device_ms(self, now: float) -> int:
        return math.floor(now * self._clock_rate + self._clock_start_ms + ROUNDING) % WRAP_MS

    def _answer(self, text: str, now: float) -> bytes:
        command, _, string = text.partition(";")
        fault = string_fault(string)
        if fault is not None:
            return _status(text, fault)
        if command[:2] in {"MD", "MS", "GD", "GS"}:
            return self._answer_scan(text, command, now)
        if isinstance(self._phase, _TimeMode) and command in {"PP", "II", "BM", "QT"}:
            return _status(text, DENIED)
        lines = self._information(command, now)
        if lines is not None:
            return _key_lines(text, lines)
        return self._answer_state(text, command, now)

    def _information(self, command: str, now: float) -> Mapping[str, str] | None:
        parameters = self._model.parameters
        match command:
            case "VV":
                return Identity(
                    "Hokuyo Automatic Co.,Ltd.",
                    self._model.product,
                    "1.0.0",
                    "SCIP 2.0",
                    "H0000001",
                ).lines()
            case "PP":
                return parameters.lines()
            case "II":
                return {
                    "MODL": parameters.model,
                    "LASR": "ON" if isinstance(self._phase, _LaserOn | _Streaming) else "OFF",
                    "SCSP": f"Initial({parameters.rpm}[rpm])",
                    "MESM": "CLASSIC",
                    "SBPS": "USB Full Speed",
                    "TIME": f"{self._device_ms(now):06X}",
                    "STAT": "Sensor works well.",
                }
        return None

    def _answer_state(self, text: str, command: str, now: float) -> bytes:
        match command, self._phase:
            case "BM", _LaserOn() | _Streaming():
                return _status(text, ALREADY_ON)
            case "BM", _:
                self._phase = _LaserOn()
            case "QT", _:
                self._phase = _Standby()
            case "RS", _:
                self._phase = _Standby()
                self._clock_start_ms = -now * self._clock_rate
            case "TM0" | "TM1" | "TM2", _:
                return self._answer_time(text, command, now)
            case _:
                return _status(text, UNDEFINED)
        return _status(text, ACCEPTED)

    def _answer_time(self, text: str, command: str, now: float) -> bytes:
        match command, self._phase:
            case "TM0", _TimeMode():
                return _status(text, ALREADY_ON)
            case "TM0", _Streaming():
                return _status(text, DENIED)
            case "TM0", _:
                self._phase = _TimeMode()
            case "TM2", _TimeMode():
                self._phase = _Standby()
            case "TM2", _:
                return _status(text, ALREADY_OFF)
            case _:
                time = encode_number(self._device_ms(now), 4).decode("ascii")
                return encode_reply(Reply(text, ACCEPTED, (time,)))
        return _status(text, ACCEPTED)

    def _answer_scan(self, text: str, command: str, now: float) -> bytes:
        fault = scan_fault(command, self._model.parameters)
        if fault is not None:
            return _status(text, fault)
        request = parse_request(text.encode("ascii"))
        if request is None:
            return _status(text, UNDEFINED)
        if request.is_single_shot:
            return self._answer_single(request, text, now)
        if isinstance(self._phase, _TimeMode):
            return _status(text, DENIED)
        scans_so_far = now / self._model.parameters.period
        self._phase = _Streaming(request, math.ceil(scans_so_far - ROUNDING))
        return _status(text, ACCEPTED)

    def _answer_single(self, request: ScanRequest, text: str, now: float) -> bytes:
        if not isinstance(self._phase, _LaserOn | _Streaming):
            return _status(text, DENIED)
        period = self._model.parameters.period
        latest = math.floor((now - self._latency(request)) / period + ROUNDING)
        return self._scan(request, ACCEPTED, max(0, latest) * period)


def _status(echo: str, status: str) -> bytes:
    return encode_reply(Reply(echo, status))


def _key_lines(echo: str, lines: Mapping[str, str]) -> bytes:
    return encode_reply(
        Reply(echo, ACCEPTED, tuple(f"{key}:{value}" for key, value in lines.items()))
    )
