"""The base's millisecond counter on the host's clock: unwrapped, free of the link's jitter.

A frame can arrive late but never early, so the smallest difference of arrival and counter seen is
the true one. It is let grow slowly, since the two clocks do not run at quite the same speed.
"""

from dataclasses import dataclass, replace

_WRAP_MS = 65536
_DRIFT = 2e-4  # s/s that the envelope may rise: more than two cheap crystals differ
_RESET_S = 1.0  # a counter this far ahead of the host's clock has started anew
_SHORTEST_STEP_S = 1e-3  # stamps on the host's clock rise at least by this


@dataclass(frozen=True, slots=True)
class DeviceClock:
    """What one frame's counter means.

    `stamp` is on the host's clock (s), `step` the base's own time since the frame before (s; 0 for
    the first frame, a repeated one, and after a reset), `resets` how often the base started anew.
    """

    raw_ms: int
    offset: float
    elapsed: float
    stamp: float
    step: float = 0.0
    resets: int = 0


def start_clock(raw_ms: int, arrival: float) -> DeviceClock:
    """The clock after the first frame, whose arrival (s) is all there is to go by."""
    return DeviceClock(raw_ms, offset=arrival, elapsed=0.0, stamp=arrival)


def advance_clock(clock: DeviceClock, raw_ms: int, arrival: float) -> DeviceClock:
    """The clock after a frame with this counter that arrived at `arrival` (s, host)."""
    step = (raw_ms - clock.raw_ms) % _WRAP_MS / 1000
    elapsed = clock.elapsed + step
    if elapsed + clock.offset > arrival + _RESET_S:
        started = start_clock(raw_ms, max(arrival, clock.stamp + _SHORTEST_STEP_S))
        return replace(started, resets=clock.resets + 1)
    offset = min(clock.offset + _DRIFT * step, arrival - elapsed)
    stamp = elapsed + offset
    if step > 0.0:
        stamp = max(stamp, clock.stamp + _SHORTEST_STEP_S)
    return DeviceClock(raw_ms, offset, elapsed, stamp, step, clock.resets)
