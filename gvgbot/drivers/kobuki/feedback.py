"""The base's byte stream made into HAL messages, without I/O: bytes and their arrival time in."""

import math
from dataclasses import dataclass, replace

from gvgbot.drivers.kobuki.device_clock import DeviceClock, advance_clock, start_clock
from gvgbot.drivers.kobuki.frames import BadFrame, FrameParser
from gvgbot.drivers.kobuki.payloads import (
    DIAGNOSTICS,
    CoreSensors,
    FeedbackPart,
    FirmwareVersion,
    HardwareVersion,
    Inertia,
    Udid,
    decode_feedback,
)
from gvgbot.drivers.kobuki.sub_payloads import Truncated, Unknown
from gvgbot.drivers.kobuki.wheel_odometry import (
    DriveGeometry,
    Heading,
    WheelOdometry,
    WheelReading,
    advance_odometry,
    doubt,
    start_odometry,
    turned,
    wheel_travels,
)
from gvgbot.geometry import wrap_angle
from gvgbot.hal.messages import Battery, Contact, Odometry

FRAME_PERIOD = 0.02  # s, of the base's stream
_PROMPT = 2  # frames that come together at most if none had to wait to be read
_FELT_S = 0.1  # so long a touch is told of, however short: frames may come together, or late
_JUMP_M = 0.25  # a wheel does not go this far between two frames,
_JUMP_SPEED = 2.0  # m/s, nor this fast over a longer gap
_JUMP_TURN = 0.35  # rad between two frames that no base turns,
_JUMP_TURN_RATE = 6.0  # rad/s, nor this fast over a longer gap
_SLIP_RATE, _GRIP_RATE = 0.2, 0.1  # rad/s: a slip begins above the one and ends below the other
_JUMPS_BELIEVED = 3  # readings in a row that agree against the old one


@dataclass(frozen=True, slots=True)
class Identity:
    """Who the base says it is; None where it has not answered."""

    hardware: str | None = None
    firmware: str | None = None
    udid: str | None = None

    @property
    def is_complete(self) -> bool:
        """Whether the base has answered everything."""
        return None not in (self.hardware, self.firmware, self.udid)


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """What came over the link since the driver started.

    `missed_frames` are gaps in the base's own counter, `malformed` frames with a right checksum
    and a wrong inside, `doubted` readings of the encoders too far off to be used. `slips` are the
    times that gyro and wheels began to disagree.
    """

    frames: int = 0
    bad_frames: int = 0
    skipped_bytes: int = 0
    missed_frames: int = 0
    malformed: int = 0
    unknown_parts: int = 0
    doubted: int = 0
    resets: int = 0
    slips: int = 0


@dataclass(frozen=True, slots=True)
class FeedbackMemory:
    """What a later reader must know to go on counting: wheels and gyro turn without us."""

    odometry: WheelOdometry
    elapsed: float  # s of the base's time at its reading
    clock: DeviceClock


class FeedbackReader:
    """What the base has reported so far: contact, battery, identity, counters, odometry."""

    def __init__(self, heading: Heading, link_delay: float, geometry: DriveGeometry) -> None:
        """`link_delay` (s) is the least time from measuring to arrival."""
        self._heading = heading
        self._geometry = geometry
        self._link_delay = link_delay
        self._parser = FrameParser()
        self._clock: DeviceClock | None = None
        self._odometry: WheelOdometry | None = None
        self._odometry_elapsed = 0.0  # s of the base's time at the last reading used,
        self._odometry_resets: int | None = None  # and how often the base had started anew
        self._extras: dict[type, str] = {}
        self._missed = self._malformed = self._unknown = self._doubted = 0
        self.contact: Contact | None = None
        self.battery: Battery | None = None
        self._slips = 0
        self._is_slipping = False
        self._has_gyro = False  # a frame has told of one
        self._felt: list[tuple[float, CoreSensors]] = []  # what the last frames felt, and when
        self.spoke = -math.inf  # arrival of the last frame, s
        self.heard = -math.inf  # and of the last one that told how far the wheels have turned
        self._breaks = 0  # times that motion may have been missed since `recall`

    def take(self, data: bytes, arrival: float) -> Odometry | None:
        """The newest odometry that these bytes complete, if any.

        Of frames that come together, each was made at least a period before the next.
        """
        newest: Odometry | None = None
        self._felt = [felt for felt in self._felt if arrival - felt[0] < _FELT_S]
        frames = [frame for frame in self._parser.feed(data) if not isinstance(frame, BadFrame)]
        for later, frame in zip(reversed(range(len(frames))), frames, strict=True):
            self.spoke = made_by = arrival - later * FRAME_PERIOD
            parts = decode_feedback(frame.payload, unread=DIAGNOSTICS)
            is_prompt = len(frames) <= _PROMPT
            newest = self._take_parts(parts, made_by, is_prompt=is_prompt) or newest
        return newest

    @property
    def identity(self) -> Identity:
        """What the base has answered so far about itself."""
        known = self._extras
        return Identity(known.get(HardwareVersion), known.get(FirmwareVersion), known.get(Udid))

    @property
    def memory(self) -> FeedbackMemory | None:
        """What a reader after this one needs; None before the base was heard."""
        if self._odometry is None or self._clock is None:
            return None
        return FeedbackMemory(self._odometry, self._odometry_elapsed, self._clock)

    def recall(self, memory: FeedbackMemory, *, counting: bool) -> None:
        """Go on from where an earlier reader ended, before anything was read.

        `counting`: clock and counters have gone on meanwhile. Otherwise the pose alone is taken
        over, as of a base that has started anew.
        """
        self._odometry = memory.odometry
        if counting:
            self._clock, self._odometry_elapsed = memory.clock, memory.elapsed
            self._odometry_resets = memory.clock.resets

    @property
    def lacks_gyro(self) -> bool:
        """Whether the heading is to be the gyro's, which tells nothing while the wheels turn."""
        state = self._odometry
        return self._heading == "gyro" and state is not None and state.unfelt > math.tau

    @property
    def has_no_gyro(self) -> bool:
        """Whether the base tells of its wheels, and has never told of a gyro."""
        return self.contact is not None and not self._has_gyro

    @property
    def is_unbroken(self) -> bool:
        """Whether no motion has been missed since `recall`."""
        return self._breaks == 0

    @property
    def clock_offset(self) -> float | None:
        """The host's clock minus the time that the base has counted (s); None before a frame."""
        return None if self._clock is None else self._clock.offset

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the link."""
        return LinkStatistics(
            frames=self._parser.frames,
            bad_frames=self._parser.bad_frames,
            skipped_bytes=self._parser.skipped_bytes - self._parser.leading_bytes,
            missed_frames=self._missed,
            malformed=self._malformed,
            unknown_parts=self._unknown,
            doubted=self._doubted,
            resets=0 if self._clock is None else self._clock.resets,
            slips=self._slips,
        )

    def _take_parts(
        self, parts: list[FeedbackPart], arrival: float, *, is_prompt: bool
    ) -> Odometry | None:
        if parts and isinstance(parts[-1], Truncated):
            self._malformed += 1
            return None
        core: CoreSensors | None = None
        inertia: Inertia | None = None
        for part in parts:
            match part:
                case CoreSensors():
                    core = part
                case Inertia():
                    inertia = part
                    self._has_gyro = True
                case HardwareVersion(version) | FirmwareVersion(version):
                    self._extras[type(part)] = str(version)
                case Udid():
                    self._extras[Udid] = str(part)
                case Unknown():
                    self._unknown += 1
                case _:
                    pass
        if core is None:
            return None
        clock = self._clock_at(core.stamp_ms, arrival - self._link_delay, is_prompt=is_prompt)
        return self._take_core(core, inertia, arrival, clock)

    def _clock_at(self, raw_ms: int, arrival: float, *, is_prompt: bool) -> DeviceClock:
        """The base's clock at a frame with this counter that arrived then (s)."""
        if self._clock is None:
            return start_clock(raw_ms, arrival)
        return advance_clock(self._clock, raw_ms, arrival, is_prompt=is_prompt)

    def _take_core(
        self, core: CoreSensors, inertia: Inertia | None, arrival: float, clock: DeviceClock
    ) -> Odometry | None:
        self._clock = clock
        self._missed += max(0, round(clock.step / FRAME_PERIOD) - 1)
        if core.feels:
            self._felt.append((arrival, core))
        self.contact = _contact([felt for _, felt in self._felt], core, clock.stamp)
        self.battery = _battery(core, clock.stamp)
        if inertia is None and self._heading == "gyro":
            return None
        reading = self._reading(core, inertia)
        is_new = clock.resets != self._odometry_resets  # a frame before may have told of no motion
        if is_new or clock.elapsed > self._odometry_elapsed:
            self.heard = arrival
        return self._take_reading(reading, clock, is_new=is_new)

    def _reading(self, core: CoreSensors, inertia: Inertia | None) -> WheelReading:
        """What a frame tells of motion; one without a gyro's angle, as if it had turned alike."""
        left, right = core.left_encoder, core.right_encoder
        if inertia is not None:
            return WheelReading(left, right, inertia.angle, inertia.rate)
        before = WheelReading(left, right, 0.0, 0.0)
        if self._odometry is not None:
            before = self._odometry.reading
        now = replace(before, left_encoder=left, right_encoder=right)
        by_wheels = turned(before, now, "wheels", self._geometry)
        return replace(now, angle=wrap_angle(before.angle + by_wheels), rate=0.0)

    def _take_reading(
        self, reading: WheelReading, clock: DeviceClock, *, is_new: bool
    ) -> Odometry | None:
        state = self._odometry
        if state is None or is_new or state.implausible >= _JUMPS_BELIEVED:
            self._odometry = start_odometry(reading, None if state is None else state.odom_base)
            self._breaks += state is not None
            self._odometry_elapsed, self._odometry_resets = clock.elapsed, clock.resets
            return None
        dt = clock.elapsed - self._odometry_elapsed
        if dt <= 0.0:
            return None
        if self._is_absurd(state.reading, reading, dt):
            self._doubted += 1
            self._odometry = doubt(state)
            return None
        state = advance_odometry(state, reading, dt, self._heading, self._geometry)
        self._odometry, self._odometry_elapsed = state, clock.elapsed
        self._watch_slip(abs(state.slip_rate))
        return Odometry(clock.stamp, state.odom_base, state.twist, self._breaks)

    def _watch_slip(self, rate: float) -> None:
        """Count the slips, by how much gyro and wheels disagree (rad/s)."""
        if rate > _SLIP_RATE and not self._is_slipping:
            self._slips += 1
        self._is_slipping = rate > (_GRIP_RATE if self._is_slipping else _SLIP_RATE)

    def _is_absurd(self, before: WheelReading, after: WheelReading, dt: float) -> bool:
        """Whether no base gets from one reading to the other in dt seconds."""
        travels = wheel_travels(before, after, self._geometry.tick)
        turn = turned(before, after, self._heading, self._geometry)
        return max(map(abs, travels)) > max(_JUMP_M, _JUMP_SPEED * dt) or (
            abs(turn) > max(_JUMP_TURN, _JUMP_TURN_RATE * dt)
        )


def _contact(felt: list[CoreSensors], newest: CoreSensors, stamp: float) -> Contact:
    """What was felt in any of some frames, and whether the cable is plugged in by the newest."""
    bumper = cliff = wheel_drop = over_current = 0
    for core in felt:
        bumper |= core.bumper
        cliff |= core.cliff
        wheel_drop |= core.wheel_drop
        over_current |= core.over_current
    return Contact(
        stamp,
        bumper_left=bool(bumper & 4),
        bumper_centre=bool(bumper & 2),
        bumper_right=bool(bumper & 1),
        cliff_left=bool(cliff & 4),
        cliff_centre=bool(cliff & 2),
        cliff_right=bool(cliff & 1),
        wheel_drop_left=bool(wheel_drop & 2),
        wheel_drop_right=bool(wheel_drop & 1),
        over_current=over_current != 0,
        charger_cable=newest.has_adapter,
    )


def _battery(core: CoreSensors, stamp: float) -> Battery:
    """Charge from the voltage alone, along the line between nearly empty and full."""
    low_v, low_fraction, full_v = 13.2, 0.05, 16.5
    slope = (1.0 - low_fraction) / (full_v - low_v)
    fraction = low_fraction + slope * (core.voltage - low_v)
    return Battery(stamp, core.voltage, min(1.0, max(0.0, fraction)), core.charging)
