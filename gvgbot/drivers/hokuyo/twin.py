"""A simulated Hokuyo laser that speaks SCIP 2: bytes in, bytes out, told the time."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gvgbot.drivers.fault_schedule import FaultSchedule
from gvgbot.drivers.hokuyo.scip_messages import SCAN_DATA
from gvgbot.drivers.hokuyo.twin_answers import Answers, LaserOn, Standby, Streaming, status_reply
from gvgbot.drivers.hokuyo.twin_commands import CommandReader, repeated
from gvgbot.drivers.hokuyo.twin_config import HokuyoTwinConfig, LaserMishap, LaserMishapConfig
from gvgbot.drivers.hokuyo.twin_head import Head
from gvgbot.drivers.hokuyo.twin_settings import BROKEN
from gvgbot.drivers.serial_line import SerialLine
from gvgbot.geometry import Array

__all__ = ["HokuyoTwin", "HokuyoTwinConfig", "LaserMishapConfig"]

UNSTABLE = "0M"
REPEATED = "0B"


class HokuyoTwin:
    """A laser without I/O, on a given world.

    `sense(stamp, steps)` gives the true ranges (m) of a sweep that begins then, one for each of so
    many steps from the model's first on, inf where there is nothing; more do no harm. It is asked
    once per scan sent, when the last of them has been seen.
    """

    def __init__(
        self,
        config: HokuyoTwinConfig,
        sense: Callable[[float, int], Array],
        seed: int,
        plug: Callable[[bool], None] = lambda _: None,
        on_since: float = 0.0,
    ) -> None:
        """`plug` is told when the laser leaves its link to reboot (False), and returns (True).

        `on_since` is when it was switched on, s.
        """
        self._config = config
        self._head = Head(config, sense, seed, on_since)
        self._answers = Answers(config, self._head)
        self._reader = CommandReader()
        self._line = SerialLine(config.serial_baud)
        self._mishaps = FaultSchedule(config.mishaps.rates, np.random.default_rng((seed, 6)))
        self._plug = plug
        self._awake_at = on_since + config.boot_s
        self._is_down = False
        self._heard_early = b""
        self._newest: tuple[float, bytes] | None = None  # frame that waits for a busy line
        self._last_frame = b""

    @property
    def baud(self) -> int:
        """The bit rate that the laser listens and sends at; 0 where there is none."""
        return self._line.baud

    @property
    def counts(self) -> Counter[str]:
        """How often each mishap has happened."""
        return self._mishaps.counts

    def inject(self, mishap: LaserMishap, duration: float = 0.0) -> None:
        """Let it happen at the next moment the laser does something, for so long (s)."""
        self._mishaps.inject(mishap, duration)

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host; the replies to the commands they complete, and what is due."""
        self._suffer(now)
        if now < self._awake_at:
            if not self._is_down:
                self._heard_early += data
            return b""
        self._wake(now)
        self._listen(data, now)
        return self._out(now)

    def advance(self, now: float) -> bytes:
        """Do what is due; the bytes that have gone out."""
        self._suffer(now)
        if now < self._awake_at:
            return b""
        self._wake(now)
        while isinstance(phase := self._answers.phase, Streaming) and self._scan_due(phase) <= now:
            self._send(phase)
        self._send_newest(now)
        return self._out(now)

    def _out(self, now: float) -> bytes:
        """The bytes that have gone out; only after the last one a new bit rate takes effect."""
        sent = self._line.out(now)
        if self._line.next_due() == math.inf:
            self._line.baud = self._answers.settings.baud
        return sent

    def next_due(self) -> float:
        """When the laser next does something by itself; inf if never."""
        phase, dues = self._answers.phase, [self._mishaps.next_due(), self._line.next_due()]
        if self._is_down or self._heard_early:
            return min(self._awake_at, dues[0])
        if self._answers.restarts_at is not None:
            dues.append(self._answers.restarts_at)
        if self._newest is not None:
            dues.append(max(self._newest[0], self._line.free_at))
        if isinstance(phase, Streaming):
            dues.append(self._scan_due(phase))
        return min(dues)

    # -- power -------------------------------------------------------------------------------------

    def _suffer(self, now: float) -> None:
        """Let the mishaps happen that are due, and the reboot that was asked for."""
        began = self._mishaps.advance(now)
        self._answers.is_unstable = self._mishaps.is_on("unstable")
        if "abnormal" in began:
            self._answers.is_abnormal = True
            self._answers.phase = Standby()
        asked = self._answers.restarts_at
        if not self._is_down and ("reboot" in began or (asked is not None and asked <= now)):
            self._go_down(now)

    def _go_down(self, now: float) -> None:
        self._is_down, self._awake_at = True, now + self._config.reboot_s
        self._heard_early, self._newest = b"", None
        self._line.clear()
        self._answers.power_up(now)
        self._plug(False)

    def _wake(self, now: float) -> None:
        """Come back from a reboot, and answer what was asked while the laser booted."""
        if self._is_down:
            self._is_down = False
            self._head.reset_clock(self._awake_at)
            self._plug(True)
        if self._heard_early:
            early, self._heard_early = self._heard_early, b""
            for text in self._reader.feed(early):
                self._serve(text, now)

    def _listen(self, data: bytes, now: float) -> None:
        texts = self._reader.feed(data)
        for text, is_repeated in zip(texts, repeated(texts), strict=True):
            if is_repeated:
                self._line.put(status_reply(text, REPEATED), self._answer_due(now))
            else:
                self._serve(text, now)

    def _serve(self, text: str, now: float) -> None:
        due = self._answer_due(now)
        self._line.put(self._answers.answer(text, now), due)
        if not isinstance(self._answers.phase, Streaming):
            self._newest = None

    def _answer_due(self, now: float) -> float:
        measures = isinstance(self._answers.phase, Streaming | LaserOn)
        if not (measures and self._config.answers_once_per_turn):
            return now
        return self._head.turn_end(now)

    # -- scans -------------------------------------------------------------------------------------

    def _scan_due(self, phase: Streaming) -> float:
        return self._head.scan_start(phase.scan_number) + self._head.latency(phase.request)

    def _send(self, phase: Streaming) -> None:
        """Put a frame on the line; on a busy one it takes the place of another that waits."""
        due, number = self._scan_due(phase), phase.scan_number
        phase.scan_number += phase.request.skip + 1
        if self._mishaps.is_on("stalled"):
            return
        is_last = phase.request.count == 1
        if phase.request.count:
            phase.request = replace(phase.request, count=phase.request.count - 1)
        frame = self._frame(phase, number)
        if frame and self._line.free_at > due:
            self._newest = (due, frame)
        elif frame:
            self._line.put(frame, due)
        if is_last or self._answers.settings.is_broken:
            self._answers.phase = Standby()

    def _frame(self, phase: Streaming, number: int) -> bytes:
        """What goes out for a scan, as the laser is just now."""
        status = self._answers.settings.instead_of_scan()
        if status == BROKEN:
            self._answers.settings.is_broken = True
        if self._mishaps.is_on("unstable"):
            status = UNSTABLE
        if status is not None:
            return status_reply(phase.request.text(), status) if status else b""
        if not (self._mishaps.is_on("frozen") and self._last_frame):
            self._last_frame = self._head.frame(
                phase.request, SCAN_DATA, number, is_blind=self._mishaps.is_on("blind")
            )
        return self._last_frame

    def _send_newest(self, now: float) -> None:
        if self._newest is not None and self._line.free_at <= now:
            due, frame = self._newest
            self._newest = None
            self._line.put(frame, max(due, self._line.free_at))
