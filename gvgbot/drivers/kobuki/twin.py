"""A simulated Kobuki base that speaks the real one's bytes, joined to a body that moves."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Annotated, Protocol

import numpy as np

from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    Extra,
    GetGain,
    GpOutput,
    RequestExtra,
    SetGain,
    decode_commands,
)
from gvgbot.drivers.kobuki.frames import BadFrame, FrameParser, encode_frame
from gvgbot.drivers.kobuki.instruments import Instruments
from gvgbot.drivers.kobuki.mishaps import Mishap, MishapConfig, Mishaps
from gvgbot.drivers.kobuki.odometry_error import PROFILES, ErringSensors, OdometryProfile
from gvgbot.drivers.kobuki.payloads import (
    ControllerInfo,
    DockIr,
    FeedbackPart,
    FirmwareVersion,
    HardwareVersion,
    Udid,
    Version,
    encode_feedback,
)
from gvgbot.drivers.kobuki.wheel_odometry import KOBUKI, DriveGeometry
from gvgbot.drivers.link_faults import LinkFaultConfig
from gvgbot.geometry import STANDSTILL, Pose, Twist, wrap_angle
from gvgbot.ranges import Range

_PERIOD_MS = 20
_PERIOD = _PERIOD_MS / 1000  # s
_SLIP_TRAVEL = 0.05  # m that a wheel spins in a slip
_FACTORY_GAINS = ControllerInfo(0, 100_000, 100, 2_000)
_EARLY = 1e-9  # s: a command this much too late for its cycle still counts


@dataclass(frozen=True, slots=True, kw_only=True)
class KobukiTwinConfig:
    """The simulated base: what it says it is, and how it errs."""

    odometry: OdometryProfile = "kobuki"
    command_timeout_s: Annotated[float, Range(0.1, 60.0)] = 1.5
    has_command_timeout: bool = True  # false: drives on for ever on its last command
    max_wheel_speed_mps: Annotated[float, Range(0.1, 5.0)] = 0.7
    motor_power_delay_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # first motion after standing
    dead_time_s: Annotated[float, Range(0.0, 1.0)] = 0.06  # from a command to its first effect
    battery_v: Annotated[float, Range(0.0, 25.5)] = 16.1
    battery_drain_v_per_h: Annotated[float, Range(0.0, 10.0)] = 0.5
    hardware_version: str = "1.0.4"
    firmware_version: str = "1.2.0"
    mishaps: MishapConfig = field(default_factory=MishapConfig)
    link: LinkFaultConfig = field(default_factory=LinkFaultConfig)


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
    """A base without I/O. It streams from its first `advance`, which is when it is powered on."""

    def __init__(
        self,
        config: KobukiTwinConfig,
        body: Body,
        seed: int,
        geometry: DriveGeometry = KOBUKI,
    ) -> None:
        rng = np.random.default_rng(seed)
        self._config = config
        self._body = body
        self._geometry = geometry
        self._mishaps = Mishaps(config.mishaps, seed)
        self._dock_ir = DockIr(0, 0, 0)
        self._sensors = ErringSensors(PROFILES[config.odometry], rng)
        self._instruments = Instruments(rng, geometry.tick)
        self._udid = Udid(tuple(rng.integers(1, 2**32, 3).tolist()))
        self._parser = FrameParser()
        self._pending: deque[tuple[float, Twist]] = deque()
        self._commanded = -math.inf
        self._moving = False
        self._replies: dict[type, FeedbackPart] = {}  # one of a kind, that they fit into a frame
        self._gains = _FACTORY_GAINS
        self._output = 0
        self._power_on: float | None = None
        self._new_at = 0.0  # when it was first switched on, s
        self._cycles = 0
        self._true = (body.left_travel, body.right_travel, body.pose.theta)

    @property
    def output(self) -> int:
        """The general-purpose output word last received."""
        return self._output

    @property
    def sensors(self) -> ErringSensors:
        """The errors drawn for this base."""
        return self._sensors

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

    def show_dock(self, *, left: int, centre: int, right: int) -> None:
        """Let the dock's beams fall on the receivers, one bit per beam."""
        self._dock_ir = DockIr(right, centre, left)

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
            self._power_on = self._new_at = now
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
        self._parser, self._replies, self._output = FrameParser(), {}, 0

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
        replies, self._replies = self._replies.values(), {}
        parts = self._instruments.read(
            self._stamp_ms, self._body.bumper, self._volts(due), self._dock_ir
        )
        self._cycles += 1
        return encode_frame(encode_feedback(self._mishaps.spoil([*parts, *replies])))

    @property
    def _stamp_ms(self) -> int:
        return _PERIOD_MS * self._cycles

    def _volts(self, now: float) -> float:
        hours = (now - self._new_at) / 3600.0
        return self._config.battery_v - hours * self._config.battery_drain_v_per_h

    def _obey(self, command: Command, now: float) -> None:
        match command:
            case BaseControl():
                self._obey_motion(command.twist_on(1000 * self._geometry.wheel_base), now)
            case RequestExtra(flags):
                self._reply(self._extras(flags))
            case SetGain(kind, p, i, d):
                self._gains = ControllerInfo(kind, p, i, d) if kind else _FACTORY_GAINS
            case GetGain():
                self._reply([self._gains])
            case GpOutput(flags):
                self._output = flags
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

    def _reply(self, parts: list[FeedbackPart]) -> None:
        self._replies |= {type(part): part for part in parts}

    def _extras(self, flags: int) -> list[FeedbackPart]:
        parts: list[FeedbackPart] = []
        if flags & Extra.HARDWARE:
            parts.append(HardwareVersion(_version(self._config.hardware_version)))
        if flags & Extra.FIRMWARE:
            parts.append(FirmwareVersion(_version(self._config.firmware_version)))
        if flags & Extra.UDID:
            parts.append(self._udid)
        return parts

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


def _version(text: str) -> Version:
    major, minor, patch = map(int, text.split("."))
    return Version(major, minor, patch)
