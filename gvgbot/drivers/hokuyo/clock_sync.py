"""From the laser's clock, 24 bits of milliseconds, to the host's clock."""

from dataclasses import dataclass, replace

WRAP_MS = 1 << 24
MEAN_TRUNCATION = 0.0005  # s; the laser's clock counts whole milliseconds
LARGEST_DRIFT = 1e-4  # of two quartz clocks against each other,
LARGEST_SLEW = 2e-3  # and of one that is being set right little by little, as a host's by NTP
BEHIND = 0.005  # s; scans that are all so late
BEHIND_BELIEVED = 20.0  # for so long (s) show that it is
RESET_LEAD = 1.0  # s; a stamp so far ahead of its arrival is of another clock
LEARNING = 5.0  # s of scans in which the delay of the link is learnt after a synchronisation
LONGEST_GUESS = 0.5  # s; a longer delay than this was not measured but mistaken
EARLIEST = -0.002  # s; likewise for scans that arrive before they are measured


@dataclass(frozen=True, slots=True)
class TimeSample:
    """The laser was asked for its time at `sent`, and had answered `stamp_ms` by `received` (s)."""

    sent: float
    stamp_ms: int
    received: float


@dataclass(frozen=True, slots=True)
class Synchronisation:
    """At the laser's time `stamp_ms` the host's was `host` (s), wrong by at most `error` (s)."""

    stamp_ms: int
    host: float
    error: float


def synchronise(samples: list[TimeSample]) -> Synchronisation | None:
    """What samples taken within a few seconds say together; None if they contradict each other.

    Each one bounds the offset of the clocks from both sides, whatever the link's delays: the
    answer was written after the question went out and before the answer came.
    """
    if not samples:
        return None
    first = samples[0].stamp_ms
    ages = [((s.stamp_ms - first) % WRAP_MS) / 1000.0 for s in samples]
    lowest = max(s.sent - age - 0.001 for s, age in zip(samples, ages, strict=True))
    highest = min(s.received - age for s, age in zip(samples, ages, strict=True))
    if highest < lowest - 0.001:
        return None
    return Synchronisation(first, (lowest + highest) / 2, abs(highest - lowest) / 2)


@dataclass(frozen=True, slots=True)
class ClockMap:
    """Where the laser's clock stands against the host's.

    `stamp_ms` is the last stamp on the wire, `elapsed` the laser's time since the map began (s),
    `offset` the least delay seen between a stamp and its arrival, as host minus laser time (s).
    Of that, `delay` is the link's and the laser's own (s). After a synchronisation it is learnt
    for a while, in which `anchor` is the true offset (s); `least` is the smallest seen then. All
    scans have come late since the laser's time `behind_since` (s); None: not the last one.
    """

    stamp_ms: int
    elapsed: float
    offset: float
    delay: float = 0.0
    resets: int = 0
    anchor: float | None = None
    least: float = LONGEST_GUESS
    behind_since: float | None = None

    @property
    def host_stamp(self) -> float:
        """The last stamp on the host's clock (s)."""
        if self.anchor is not None:
            return self.elapsed + self.anchor
        return self.elapsed + MEAN_TRUNCATION + self.offset - self.delay

    @property
    def known_delay(self) -> float:
        """How late a scan arrives if nothing holds it up, as far as is known (s)."""
        return self.delay if self.anchor is None else self.least


def start(
    stamp_ms: int, arrival: float, *, delay: float, sync: Synchronisation | None = None
) -> ClockMap:
    """The map at a first scan that began to arrive at host time `arrival` (s).

    `delay` (s) is how long after its stamp a scan arrives if nothing holds it up; without a
    synchronisation it is all there is to know.
    """
    if sync is None:
        return ClockMap(stamp_ms, 0.0, arrival, delay)
    age = ((stamp_ms - sync.stamp_ms) % WRAP_MS) / 1000.0
    anchor = sync.host + age + MEAN_TRUNCATION
    least = arrival - anchor + MEAN_TRUNCATION
    if not EARLIEST < least < LONGEST_GUESS:
        return ClockMap(stamp_ms, 0.0, arrival, delay)
    return ClockMap(stamp_ms, 0.0, arrival, delay, anchor=anchor, least=least)


def follow(clock_map: ClockMap, stamp_ms: int, arrival: float) -> ClockMap:
    """The map after a scan with this stamp began to arrive at host time `arrival` (s).

    Delays only ever add, so the offset follows the lower envelope of arrival minus stamp; it
    rises no faster than two clocks can drift, and faster only while not one scan keeps up with it.
    A clock that jumped starts a new map: taken for an advance, a jump to either side puts the stamp
    far ahead of its arrival.
    """
    advance_ms = (stamp_ms - clock_map.stamp_ms) % WRAP_MS
    elapsed = clock_map.elapsed + advance_ms / 1000.0
    latest_offset = arrival - elapsed
    if latest_offset < clock_map.offset - RESET_LEAD:
        return ClockMap(stamp_ms, 0.0, arrival, clock_map.known_delay, clock_map.resets + 1)
    since = _behind_since(clock_map, elapsed, latest_offset)
    is_slewed = since is not None and elapsed - since > BEHIND_BELIEVED
    drift = LARGEST_SLEW if is_slewed else LARGEST_DRIFT
    moved = replace(
        clock_map,
        stamp_ms=stamp_ms,
        elapsed=elapsed,
        offset=min(latest_offset, clock_map.offset + drift * advance_ms / 1000.0),
        behind_since=since,
    )
    return moved if moved.anchor is None else _learnt(moved, latest_offset)


def _behind_since(clock_map: ClockMap, elapsed: float, latest_offset: float) -> float | None:
    """Since when all scans have come late, with one that suggests this offset (s)."""
    if latest_offset - clock_map.offset <= BEHIND:
        return None
    return elapsed if clock_map.behind_since is None else clock_map.behind_since


def _learnt(clock_map: ClockMap, latest_offset: float) -> ClockMap:
    """The map that knows more about the link's delay, and trusts it once it knows enough.

    A scan that comes before it was measured proves the synchronisation mistaken.
    """
    assert clock_map.anchor is not None
    least = min(clock_map.least, latest_offset - clock_map.anchor + MEAN_TRUNCATION)
    if least < EARLIEST:
        return replace(clock_map, anchor=None)
    if clock_map.elapsed < LEARNING:
        return replace(clock_map, least=least)
    return replace(clock_map, delay=least, anchor=None, least=least)
