"""A simulated Kobuki base that speaks the real one's bytes, joined to a body that moves."""

import math
from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    GetGain,
    GpOutput,
    RequestExtra,
    SetGain,
    Sound,
    SoundSequence,
    decode_commands,
)
from gvgbot.drivers.kobuki.dock import Dock
from gvgbot.drivers.kobuki.frames import BadFrame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.instruments import Instruments
from gvgbot.drivers.kobuki.mishaps import Mishap, Mishaps
from gvgbot.drivers.kobuki.odometry_error import PROFILES, ErringSensors
from gvgbot.drivers.kobuki.payloads import (
    DockIr,
    Udid,
    encode_feedback,
)
from gvgbot.drivers.kobuki.power import Power
from gvgbot.drivers.kobuki.twin_answers import Answers
from gvgbot.drivers.kobuki.twin_config import KobukiTwinConfig
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI, DriveGeometry
from gvgbot.geometry import STANDSTILL, Pose, Twist, wrap_angle

__all__ = ["KobukiTwin", "KobukiTwinConfig"]

_PERIOD_MS = 20
_PERIOD = _PERIOD_MS / 1000  # s
_SLIP_TRAVEL = 0.05  # m that a wheel spins in a slip
_SOUNDS_KEPT = 32
_EARLY = 1e-9  # s: a command this much too late for its cycle still counts


class Body(Protocol):
    """What the twin moves: a differential-drive robot in some world."""

    def advance(self, now: float) -> None:
        """Move up to `now` (s) as commanded; a time already passed changes nothing."""

    def command(self, linear: float, angular: float) -> None:
        """Head for this twist (m/s, rad/s), within the body's own accelerations."""

    @property
    def left_travel(self) -> float:
        """Metres that the left wheel has turned, signed, since the body was made."""

    @property
    def right_travel(self) -> float:
        """Metres that the right wheel has turned, signed, since the body was made."""

    @property
    def pose(self) -> Pose:
        """True pose, world_base."""

    @property
    def bumper(self) -> tuple[bool, bool, bool]:
        """Which bumpers are pressed: left, centre, right."""


class KobukiTwin:
    """A base without I/O. It streams from its first `advance`, which is when it is powered on.

    `played` are the last sounds it was told to play.
    """

    def __init__(
        self,
        config: KobukiTwinConfig,
        body: Body,
        seed: int,
        geometry: DriveGeometry = KOBUKI,
        look: Callable[[float], float] = lambda _: math.inf,
    ) -> None:
        """`look(bearing)` is the distance (m) from the body to the next wall (rad, its frame)."""
        rng = np.random.default_rng(seed)
        self._config = config
        self._body = body
        self._geometry = geometry
        self._mishaps = Mishaps(config.mishaps, seed)
        self._dock = None if config.dock is None else Dock(Pose(*config.dock))
        self._look = look
        self._power = Power(
            config.battery_v, config.battery_drain_v_per_h, config.battery_charge_v_per_h
        )
        self._has_adapter = config.has_adapter
        self.played: deque[Sound | SoundSequence] = deque(maxlen=_SOUNDS_KEPT)
        self._sensors = ErringSensors(PROFILES[config.odometry], rng)
        self._instruments = Instruments(rng, geometry.tick)
        udid = Udid(tuple(rng.integers(1, 2**32, 3).tolist()))
        self._answers = Answers(config.hardware_version, config.firmware_version, udid)
        self._parser = FrameParser()
        self._pending: deque[tuple[float, Twist]] = deque()
        self._commanded = -math.inf
        self._moving = False
        self._output = 0
        self._power_on: float | None = None
        self._cycles = 0
        self._true = (body.left_travel, body.right_travel, body.pose.theta)

    @property
    def output(self) -> int:
        """The general-purpose output word last received: outputs, power, and LEDs."""
        return self._output

    @property
    def received(self) -> FrameParser:
        """The parser of the host's bytes, with its counters."""
        return self._parser

    @property
    def mishaps(self) -> Mishaps:
        """What has befallen the base."""
        return self._mishaps

    def inject(self, mishap: Mishap, duration: float) -> None:
        """Let a mishap begin with the next frame, for so long (s)."""
        self._mishaps.inject(mishap, duration)

    def hold_buttons(self, bits: int) -> None:
        """Hold the buttons down whose bits are set (B0 is bit 0), and let go of the others."""
        self._instruments.buttons = bits

    def plug_adapter(self, is_plugged: bool) -> None:
        """Plug in the charger's cable, or pull it out."""
        self._has_adapter = is_plugged

    def receive(self, data: bytes, now: float) -> bytes:
        """Take the host's bytes. The base answers within its stream, so never at once."""
        if self._power_on is not None and now < self._power_on:
            return b""
        for frame in self._parser.feed(data):
            if not isinstance(frame, BadFrame):
                for command in decode_commands(frame.payload):
                    self._obey(command, now)
        return b""

    def next_due(self) -> float:
        """When the next frame leaves (s); at once before the first."""
        return 0.0 if self._power_on is None else self._power_on + self._cycles * _PERIOD

    def advance(self, now: float) -> bytes:
        """The one frame that is due, if one is."""
        if self._power_on is None:
            self._power_on = now
        due = self.next_due()
        if now < due:
            return b""
        for mishap in self._mishaps.advance(due):
            self._suffer(mishap, due)
        return self._frame(due) if due == self.next_due() else b""

    def _suffer(self, mishap: str, now: float) -> None:
        """Let the sudden mishaps have their effect; the lasting ones have theirs on the frames."""
        match mishap:
            case "slip":
                self._sensors.slip(self._cycles % 2, _SLIP_TRAVEL)
            case "over-current":
                self._halt()
            case "reboot":
                self._reboot(now)

    def _reboot(self, now: float) -> None:
        """Forget everything, stand, and start anew after a while."""
        self._halt()
        self._power_on, self._cycles = now + self._config.mishaps.boot_s, 0
        self._instruments.restart()
        self._parser, self._output = FrameParser(), 0
        self._answers.take()

    def _halt(self) -> None:
        """Cut the motors, whatever was commanded."""
        self._pending.clear()
        self._moving = False
        self._body.command(0.0, 0.0)

    def _frame(self, due: float) -> bytes:
        if self._cycles == 0:  # nothing was felt before
            self._body.advance(due)
            self._true = self._truth()
        self._move(due)
        replies = self._answers.take()
        self._charge()
        parts = self._instruments.read(
            self._stamp_ms, self._body.bumper, self._power, self._dock_beams()
        )
        self._cycles += 1
        if not self._mishaps.is_on("no replies"):
            parts += replies
        return encode_frame(encode_feedback(self._mishaps.spoil(parts)))

    @property
    def _stamp_ms(self) -> int:
        return _PERIOD_MS * self._cycles

    def _charge(self) -> None:
        """Let the battery feel this cycle."""
        is_docked = self._dock is not None and self._dock.holds(self._body.pose)
        self._power.source = "adapter" if self._has_adapter else "dock" if is_docked else None
        self._power.advance(_PERIOD)

    def _dock_beams(self) -> DockIr:
        if self._dock is None:
            return DockIr(0, 0, 0)
        return self._dock.shines_on(self._body.pose, self._look)

    def _obey(self, command: Command, now: float) -> None:
        match command:
            case BaseControl():
                self._obey_motion(command.twist_on(1000 * self._geometry.wheel_base), now)
            case RequestExtra() | SetGain() | GetGain():
                self._answers.hear(command)
            case GpOutput(flags):
                self._output = flags
            case Sound() | SoundSequence():
                self.played.append(command)
            case _:
                pass

    def _obey_motion(self, twist: Twist, now: float) -> None:
        """Take a command in its turn; motors that stand get their power a little later."""
        self._commanded = now
        if self._mishaps.is_on("over-current"):
            return
        due = now + self._config.dead_time_s
        is_idle = not self._moving and all(each == STANDSTILL for _, each in self._pending)
        if is_idle and twist != STANDSTILL:
            due += self._config.motor_power_delay_s
        last = self._pending[-1][0] if self._pending else due
        self._pending.append((max(due, last), self._limited(twist)))

    def _move(self, now: float) -> None:
        """Let the body move through this cycle and feel what it did, then heed commands."""
        self._body.advance(now)
        before, self._true = self._true, self._truth()
        left, right = self._true[0] - before[0], self._true[1] - before[1]
        turn = wrap_angle(self._true[2] - before[2])
        left, right, turn = self._sensors.feel(left, right, turn, _PERIOD)
        self._instruments.turn(left, right, turn, _PERIOD)
        self._heed(now)

    def _heed(self, now: float) -> None:
        """Pass on what became due in this cycle, and stop if the host has been silent too long."""
        while self._pending and self._pending[0][0] <= now + _EARLY:
            _, twist = self._pending.popleft()
            self._moving = twist != STANDSTILL
            self._body.command(twist.linear, twist.angular)
        late = now > self._commanded + self._config.command_timeout_s
        if self._moving and late and self._config.has_command_timeout:
            self._moving = False
            self._body.command(0.0, 0.0)

    def _truth(self) -> tuple[float, float, float]:
        return self._body.left_travel, self._body.right_travel, self._body.pose.theta

    def _limited(self, twist: Twist) -> Twist:
        """The twist on the same arc, slowed until the faster wheel can follow."""
        fast_wheel = abs(twist.linear) + abs(twist.angular) * self._geometry.wheel_base / 2
        share = max(1.0, fast_wheel / self._config.max_wheel_speed_mps)
        return Twist(twist.linear / share, twist.angular / share)
