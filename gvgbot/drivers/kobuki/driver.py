"""The Kobuki base behind the HAL: it is listened to, driven, and stopped when anything is amiss."""

import asyncio
import contextlib
import math
from dataclasses import dataclass
from typing import Annotated

from gvgbot.clock import Clock, on_loop
from gvgbot.drivers.kobuki.commands import (
    ALL_POWER,
    NO_OUTPUT,
    BaseControl,
    Command,
    Extra,
    GpOutput,
    Melody,
    Output,
    RequestExtra,
    SoundSequence,
    encode_commands,
)
from gvgbot.drivers.kobuki.feedback import FeedbackReader, Identity, LinkStatistics
from gvgbot.drivers.kobuki.limits import Accelerations, ramped, slowed
from gvgbot.drivers.kobuki.signs import LAMPS, SIGNS
from gvgbot.drivers.kobuki.wheel_odometry import TICK_ANGLE, WHEEL_BASE, DriveGeometry, Heading
from gvgbot.drivers.transport import ByteStream
from gvgbot.errors import DeviceLost, DeviceRefused
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.latest import Latest
from gvgbot.hal.messages import Battery, Contact, Odometry, Sign
from gvgbot.ranges import Range

_STOP_REPEAT_S = 0.1  # while the base is to stand, it is told so again this often
_HUNG_S = 0.1  # so late, it was the host that was busy, and not the base that was silent
_IDENTITY_RETRY_S = 0.5
_ALL_EXTRAS = Extra.HARDWARE | Extra.FIRMWARE | Extra.UDID
_NO_GYRO = (
    "the gyro has told of no turn while the wheels made more than one: "
    "switch the base off and on, or set base.heading=wheels"
)
_STOP = BaseControl(0, 0)
STANDSTILL_FRAME = encode_commands([_STOP])


@dataclass(frozen=True, slots=True, kw_only=True)
class KobukiConfig:
    """The link to the base, its limits, and when silence is dangerous."""

    port: str = "/dev/gvgbot-base"  # as the udev rules name it
    baud: Annotated[int, Range(9600, 1_000_000)] = 115_200  # a Kobuki knows no other
    heading: Heading = "gyro"  # what tells how far the base has turned
    wheel_base_m: Annotated[float, Range(0.05, 2.0)] = WHEEL_BASE  # from wheel to wheel
    wheel_radius_m: Annotated[float, Range(0.01, 0.5)] = 0.035  # turns ticks into metres
    max_speed_mps: Annotated[float, Range(0.01, 2.0)] = 0.7  # of the faster wheel
    # a faster turn is slowed down on its arc
    max_turn_rate_radps: Annotated[float, Range(0.01, math.pi)] = math.pi
    max_acceleration_mps2: Annotated[float, Range(0.05, 100.0)] | None = None  # None: no ramp
    # None: no ramp; not below robot.limits.max_braking_mps2, and a stop is never put off
    max_braking_mps2: Annotated[float, Range(0.05, 100.0)] | None = None
    # None: no ramp; not below that of robot.limits
    max_angular_acceleration_radps2: Annotated[float, Range(0.1, 1000.0)] | None = None
    deadman_s: Annotated[float, Range(0.05, 2.0)] = 0.5  # without drive(): stop
    # without feedback: stop; the guard, which is not asked meanwhile, allows for as long
    silence_stop_s: Annotated[float, Range(0.05, 2.0)] = 0.25
    silence_lost_s: Annotated[float, Range(0.1, 10.0)] = 1.0  # without feedback: give up
    link_delay_s: Annotated[float, Range(0.0, 0.1)] = 0.0  # from measuring to arrival, at best
    sounds: bool = True  # a tune when it is done, and one when it needs somebody
    identity_attempts: Annotated[int, Range(0, 100)] = 10  # to learn version and serial number

    @property
    def geometry(self) -> DriveGeometry:
        """The wheels."""
        return DriveGeometry(self.wheel_base_m, TICK_ANGLE * self.wheel_radius_m)

    @property
    def accelerations(self) -> Accelerations:
        """The limits of the ramps; inf where there is none."""
        return Accelerations(
            self.max_acceleration_mps2 or math.inf,
            self.max_braking_mps2 or math.inf,
            self.max_angular_acceleration_radps2 or math.inf,
        )


class KobukiBase:
    """A base on a byte stream. `run` serves the link; everything else may be used beside it."""

    def __init__(
        self,
        stream: ByteStream,
        config: KobukiConfig,
        clock: Clock,
        feedback: FeedbackReader | None = None,
    ) -> None:
        """With the `feedback` of a driver whose link was lost, the odometry goes on from its end.

        The base's counters go on by themselves, so that motion in the meantime is not lost.
        """
        self._stream = stream
        self._config = config
        self._clock = clock
        self._feedback = feedback or FeedbackReader(
            config.heading, config.link_delay_s, config.geometry
        )
        self._newest = Latest[Odometry]()
        self._identity_asked = 0
        self._identity_due = -math.inf
        self._output = ALL_POWER
        self._shown: Sign = "off"
        self._started = clock.now()
        self._accelerations = config.accelerations
        self._driven = -math.inf
        self._twist = STANDSTILL
        self._stopped = -math.inf
        self._is_excused = False  # silent, but perhaps only because nobody listened

    async def run(self) -> None:
        """Serve the link until cancelled.

        Raises DeviceLost when the base is silent or gone, DeviceRefused if its gyro is of no use.
        """
        self._started = self._clock.now()
        try:
            due = self._started
            while True:
                self._watch(due)
                due = self._next_watch()
                await self._listen(until=due)
        finally:
            self._send(_STOP)
            self.show("off")

    async def next_odometry(self) -> Odometry:
        """The newest odometry not handed out before; waits for one."""
        return await self._newest.next()

    def drive(self, twist: Twist) -> Twist:
        """Send the twist now, within the limits; the twist that the bytes really stand for.

        While the base is silent it is told to stand whatever is asked. It never raises: a link that
        is gone is for `run` to report.
        """
        before, self._driven = self._driven, self._clock.now()
        if self._driven >= self._heard + self._config.silence_stop_s:
            twist = STANDSTILL
        wheel_base_mm = 1000 * self._config.wheel_base_m
        control = BaseControl.from_twist(self._permitted(twist, before), wheel_base_mm)
        self._twist = control.twist_on(wheel_base_mm) if self._send(control) else STANDSTILL
        return self._twist

    def show(self, sign: Sign) -> None:
        """Show people what the robot is about, by lamps and, unless muted, by tunes."""
        if sign == self._shown or self._feedback.heard < self._started:
            return
        self._shown = sign
        lamps, melody = SIGNS[sign]
        self.switch(on=lamps, off=LAMPS & ~lamps)
        if melody is not None and self._config.sounds:
            self.play(melody)

    def play(self, melody: Melody) -> None:
        """Play one of the base's tunes."""
        self._send(SoundSequence(melody))

    def switch(self, *, on: Output = NO_OUTPUT, off: Output = NO_OUTPUT) -> None:
        """Switch outputs, power and LEDs; all others stay as they are, power on from the start."""
        self._output = (self._output | on) & ~off
        self._send(GpOutput(self._output))

    @property
    def contact(self) -> Contact | None:
        """The newest contact state, None before the first."""
        return self._feedback.contact

    @property
    def battery(self) -> Battery | None:
        """The newest battery state, None before the first."""
        return self._feedback.battery

    @property
    def identity(self) -> Identity:
        """What the base has answered so far about itself."""
        return self._feedback.identity

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the link."""
        return self._feedback.statistics

    def _permitted(self, twist: Twist, last_driven: float) -> Twist:
        config = self._config
        twist = slowed(twist, config.max_speed_mps, config.max_turn_rate_radps, config.wheel_base_m)
        return ramped(twist, self._twist, self._driven - last_driven, self._accelerations)

    @property
    def _heard(self) -> float:
        return max(self._started, self._feedback.heard)

    def _watch(self, due: float) -> None:
        """Stop the base if that is due; give up if it has been silent for too long.

        When the host was too busy to watch when it was `due` (s), what has come is read first.
        """
        now = self._clock.now()
        is_silent = now >= self._lost_due()
        if is_silent and (self._is_excused or now < due + _HUNG_S):
            raise DeviceLost(self._loss())
        self._is_excused = is_silent
        if now >= self._stop_due():
            self._stopped, self._twist = now, STANDSTILL
            self._send(_STOP)

    def _loss(self) -> str:
        config = self._config
        if self._feedback.spoke > self._heard:
            if config.heading == "gyro" and self._feedback.has_no_gyro:
                return f"the base tells of no gyro: set base.heading=wheels ({config.port})"
            return (
                f"the base talks, but has told nothing new of its wheels and gyro for "
                f"{config.silence_lost_s:g} s: switch it off and on ({config.port})"
            )
        return (
            f"no feedback from the base for {config.silence_lost_s:g} s: "
            "check that it is switched on, its cable is plugged in, and base.port is its port "
            f"({config.port})"
        )

    def _next_watch(self) -> float:
        return self._stop_due() if self._is_excused else min(self._stop_due(), self._lost_due())

    def _stop_due(self) -> float:
        deadman = self._driven + self._config.deadman_s
        silence = self._heard + self._config.silence_stop_s
        return max(min(deadman, silence), self._stopped + _STOP_REPEAT_S)

    def _lost_due(self) -> float:
        return self._heard + self._config.silence_lost_s

    def _ask_identity(self) -> None:
        """Ask now and then, from the first frame on, until all is answered or it seems useless."""
        now = self._clock.now()
        if self._feedback.heard < self._started or now < self._identity_due:
            return
        if self._identity_asked < self._config.identity_attempts and not self.identity.is_complete:
            self._identity_asked += 1
            self._identity_due = now + _IDENTITY_RETRY_S
            self._send(RequestExtra(_ALL_EXTRAS))

    async def _listen(self, until: float) -> None:
        """Take what the base sends; a timer for each frame would cost more than its reading."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(on_loop(self._clock, until)):
                while True:
                    self._take(await self._stream.read())

    def _take(self, data: bytes) -> None:
        odometry = self._feedback.take(data, self._clock.now())
        if self._feedback.lacks_gyro:
            raise DeviceRefused(_NO_GYRO)
        if odometry is not None:
            self._newest.put(odometry)
        self._ask_identity()

    def _send(self, command: Command) -> bool:
        try:
            self._stream.write(encode_commands([command]))
        except DeviceLost:
            return False
        return True
