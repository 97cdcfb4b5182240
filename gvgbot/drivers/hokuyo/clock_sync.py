"""From the laser's clock, 24 bits of milliseconds, to the host's clock."""

from dataclasses import dataclass

WRAP_MS = 1 << 24
MEAN_TRUNCATION = 0.0005  # s; the laser's clock counts whole milliseconds
LARGEST_DRIFT = 1e-4  # of two quartz clocks against each other
RESET_LEAD = 1.0  # s; a stamp so far ahead of its arrival is of another clock


@dataclass(frozen=True, slots=True)
class ClockMap:
    """Where the laser's clock stands against the host's.

    `stamp_ms` is the last stamp on the wire, `elapsed` the laser's time since the map began (s),
    `offset` the least delay seen between a stamp and its arrival, as host minus laser time (s).
    """

    stamp_ms: int
    elapsed: float
    offset: float
    resets: int = 0

    @property
    def host_stamp(self) -> float:
        """The last stamp on the host's clock, later by the least delay of the link (s)."""
        return self.elapsed + MEAN_TRUNCATION + self.offset


def follow(clock_map: ClockMap | None, stamp_ms: int, arrival: float) -> ClockMap:
    """The map after a scan with this stamp began to arrive at host time `arrival` (s).

    Delays only ever add, so the offset follows the lower envelope of arrival minus stamp; it
    rises no faster than two clocks can drift. A clock that jumped starts a new map: taken for an
    advance, a jump to either side puts the stamp far ahead of its arrival.
    """
    if clock_map is None:
        return ClockMap(stamp_ms, 0.0, arrival)
    advance_ms = (stamp_ms - clock_map.stamp_ms) % WRAP_MS
    elapsed = clock_map.elapsed + advance_ms / 1000.0
    latest_offset = arrival - elapsed
    if latest_offset < clock_map.offset - RESET_LEAD:
        return ClockMap(stamp_ms, 0.0, arrival, clock_map.resets + 1)
    highest_offset = clock_map.offset + LARGEST_DRIFT * advance_ms / 1000.0
    return ClockMap(stamp_ms, elapsed, min(latest_offset, highest_offset), clock_map.resets)
