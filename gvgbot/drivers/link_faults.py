"""A bad link between a twin and its driver: delays, damage, silence, and a cable that is pulled."""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from gvgbot.drivers.fault_schedule import FaultSchedule, PerHour, Rate
from gvgbot.drivers.serial_line import SerialLine
from gvgbot.drivers.transport import TwinDevice
from gvgbot.ranges import Range

_CHIP_BYTES = 62  # a USB serial converter sends at once when it has gathered this many
_BACKLOG = 0.5  # s: a device leaves messages out when the line is so far behind
PerThousand = Annotated[float, Range(0.0, 1000.0)]
Moment = Annotated[float, Range(0.0, 86_400.0)]  # s
LinkFault = Literal["silence", "unplug"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFaultConfig:
    """What is wrong with the link. Damage and bit rate apply to bytes both ways."""

    latency_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # towards the host
    jitter_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # at most, beyond the latency
    command_latency_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # towards the device
    baud: Annotated[int, Range(0, 4_000_000)] = 0  # bit/s; 0: so fast that it does not matter
    chip_timer_s: Annotated[float, Range(0.0, 0.255)] = (
        0.0  # an FTDI's latency timer; usually 16 ms
    )
    flipped_bits_per_kb: PerThousand = 0.0  # damaged bytes
    lost_bytes_per_kb: PerThousand = 0.0  # bytes that never arrive
    inserted_bytes_per_kb: PerThousand = 0.0  # bytes that nobody sent
    cut_messages_per_k: PerThousand = 0.0  # messages whose end is missing
    silences_per_h: PerHour = 0.0  # nothing comes for a while
    silence_s: Annotated[float, Range(0.0, 3600.0)] = 2.0  # so long
    unplugs_per_h: PerHour = 0.0  # the cable is pulled
    unplugs_at_s: tuple[Moment, ...] = ()  # since the twin was first served
    unplugged_s: Annotated[float, Range(0.0, 86_400.0)] = 3.0  # until it is plugged in again


class FaultyLink:
    """A twin behind a bad link: a twin itself, as seen from the host. Same seed, same faults.

    Twins in one world are in each other's `company`: what a busy computer lets wait is done by all
    of them in the order in which it was due, each at its time, so that they see the same motion.
    """

    def __init__(
        self,
        device: TwinDevice,
        config: LinkFaultConfig,
        seed: int,
        plug: Callable[[bool], None] = lambda _: None,
    ) -> None:
        """`plug` is told when the cable is pulled (False) and plugged in again (True)."""
        self._device, self._config, self._plug = device, config, plug
        self._damage = _Damage(config, np.random.default_rng((seed, 1)))
        self._jitter = np.random.default_rng((seed, 2))
        rates = {
            "silence": Rate(config.silences_per_h, config.silence_s),
            "unplug": Rate(config.unplugs_per_h, config.unplugged_s, config.unplugs_at_s),
        }
        self._schedule = FaultSchedule(rates, np.random.default_rng((seed, 3)))
        self._commands, self._wire = SerialLine(config.baud), SerialLine(config.baud)
        self._lost: Counter[str] = Counter()
        self._under_way: deque[tuple[float, bytes]] = deque()
        self._chip, self._chip_due = b"", math.inf
        self._is_plugged = True
        self._lived = math.inf  # until when, s; not before it is served
        self.company: list[FaultyLink] = [self]

    @property
    def device(self) -> TwinDevice:
        """The device at the other end of the link."""
        return self._device

    @property
    def counts(self) -> Counter[str]:
        """How often each kind of fault has happened."""
        return self._schedule.counts + self._damage.counts + self._lost

    def inject(self, fault: LinkFault, duration: float) -> None:
        """Let the device fall silent, or pull its cable, for so long (s)."""
        self._schedule.inject(fault, duration)

    def change(self, config: LinkFaultConfig) -> None:
        """Delay and damage what is sent from now on so; the rates of other faults stay."""
        self._config = self._damage.config = config
        self._commands.baud = self._wire.baud = config.baud

    def is_on(self, fault: LinkFault) -> bool:
        """Whether nothing gets through for this reason."""
        return self._schedule.is_on(fault)

    def receive(self, data: bytes, now: float) -> bytes:
        """Take the host's bytes; those that the device answers at once and that arrive at once."""
        self._live(now)
        if self._is_plugged:
            late = now + self._config.command_latency_s
            self._commands.put(self._damage.done_to(data), late)
            self._deliver(now)
        return self._arrived(now)

    def advance(self, now: float) -> bytes:
        """What arrives at the host up to now."""
        if self._lived == math.inf:
            self.live_until(now)
        self._live(now)
        return self._arrived(now)

    def next_due(self) -> float:
        """When something arrives, or the device or a fault is due."""
        return min(self._due(), self._under_way[0][0] if self._under_way else math.inf)

    def own_due(self, now: float) -> float:
        """When the device, the link or a fault next has something to do; inf until it is served.

        What is due for longer than the link has lived was asked for `now`.
        """
        due = math.inf if self._lived == math.inf else self._due()
        return due if due >= self._lived else now

    def live_until(self, now: float) -> None:
        """Do what is due by then."""
        self._lived = now
        self._schedule.advance(now)
        if self._is_plugged == self._schedule.is_on("unplug"):
            self._is_plugged = not self._is_plugged
            for way in (self._commands, self._wire, self._under_way):
                way.clear()
            self._chip, self._chip_due = b"", math.inf
            self._plug(self._is_plugged)
        self._deliver(now)
        if self._device.next_due() <= now:
            self._post(self._device.advance(now), now)
        self._convert(now)
        if self._chip_due <= now:
            self._send(self._chip, self._chip_due)
            self._chip, self._chip_due = b"", math.inf

    def _live(self, now: float) -> None:
        """Do what has become due here and in the company."""
        while True:
            first, due = self, math.inf
            for link in self.company:
                own = link.own_due(now)
                if own < due:
                    first, due = link, own
            if due > now:
                return
            first.live_until(due)

    def _due(self) -> float:
        return min(
            self._device.next_due(),
            self._schedule.next_due(),
            self._chip_due,
            self._commands.next_due(),
            self._wire.next_due(),
        )

    def _deliver(self, now: float) -> None:
        """Hand the device what has come through to it."""
        data = self._commands.out(now)
        if data:
            self._post(self._device.receive(data, now), now)

    def _post(self, message: bytes, now: float) -> None:
        """Send a message on its way, unless nothing gets through just now."""
        if not message or not self._is_plugged or self._schedule.is_on("silence"):
            return
        if self._wire.free_at > now + _BACKLOG:
            self._lost["dropped message"] += 1
            return
        self._wire.put(self._damage.done_to(self._damage.cut(message)), now)
        self._convert(now)

    def _convert(self, now: float) -> None:
        """Let the serial converter take what has come over the wire."""
        message, timer = self._wire.out(now), self._config.chip_timer_s
        if timer == 0.0 or not message:
            self._send(message, now)
            return
        self._chip += message
        whole = len(self._chip) - len(self._chip) % _CHIP_BYTES
        self._send(self._chip[:whole], now)
        self._chip = self._chip[whole:]
        self._chip_due = (math.floor(now / timer) + 1) * timer if self._chip else math.inf

    def _send(self, data: bytes, now: float) -> None:
        """Hand bytes to the wire, on which nothing overtakes."""
        if data:
            jitter = self._config.jitter_s
            late = self._config.latency_s + (self._jitter.uniform(0.0, jitter) if jitter else 0.0)
            last = self._under_way[-1][0] if self._under_way else -math.inf
            self._under_way.append((max(now + late, last), data))

    def _arrived(self, now: float) -> bytes:
        self._convert(now)
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            arrived.append(self._under_way.popleft()[1])
        return b"".join(arrived)


class _Damage:
    """Bytes in, damaged bytes out."""

    def __init__(self, config: LinkFaultConfig, rng: np.random.Generator) -> None:
        self.counts: Counter[str] = Counter()
        self.config = config
        self._rng = rng

    def cut(self, message: bytes) -> bytes:
        """The message, or now and then only its beginning."""
        share = self.config.cut_messages_per_k / 1000
        if share == 0.0 or self._rng.random() >= share:
            return message
        self.counts["cut message"] += 1
        return message[: int(self._rng.integers(len(message)))]

    def done_to(self, data: bytes) -> bytes:
        """The bytes with bits flipped, bytes lost and bytes put in."""
        config = self.config
        rates = (config.flipped_bits_per_kb, config.lost_bytes_per_kb, config.inserted_bytes_per_kb)
        if not any(rates) or not data:
            return data
        flipped, lost, inserted = (self._struck(rate, len(data)) for rate in rates)
        if flipped == lost == inserted == 0:
            return data
        return self._struck_at(data, flipped, lost, inserted)

    def _struck(self, per_kb: float, size: int) -> int:
        """How many of so many bytes a fault hits."""
        return int(self._rng.binomial(size, per_kb / 1000)) if per_kb > 0.0 else 0

    def _struck_at(self, data: bytes, flipped: int, lost: int, inserted: int) -> bytes:
        """The bytes with so many of these faults, anywhere."""
        self.counts += Counter(
            {"flipped bit": flipped, "lost byte": lost, "inserted byte": inserted}
        )
        wire = np.frombuffer(data, np.uint8).copy()
        hit = self._rng.choice(len(wire), flipped, replace=False)
        wire[hit] ^= (1 << self._rng.integers(0, 8, flipped)).astype(np.uint8)
        wire = np.delete(wire, self._rng.choice(len(wire), lost, replace=False))
        places = self._rng.integers(0, len(wire) + 1, inserted)
        return np.insert(
            wire, places, self._rng.integers(0, 256, inserted).astype(np.uint8)
        ).tobytes()
