"""The base's millisecond counter on the host's clock: unwrapped, free of the link's jitter.

A frame can arrive late but never early, so the smallest difference of arrival and counter seen is
the true one. It is let grow slowly, since the two clocks do not run at quite the same speed. A base
that starts anew counts from nothing: after a silence, the counter then shows less than its length.
If that was not seen, all frames come late from then on, for longer than any link stalls; frames
that come together say nothing about that, for then it is the host that was late to read them.
"""

from dataclasses import dataclass, replace

_WRAP_MS = 65536
_DRIFT = 2e-4  # s/s that the envelope may rise: more than two cheap crystals differ,
_SLEW = 2e-3  # and while the host's clock is being set right little by little, as by NTP:
_BEHIND_S, _BEHIND_BELIEVED_S = 5e-3, 10.0  # then all frames are so late for so long
_RESET_S = 1.0  # a counter this far ahead of the host's clock has started anew
_GAP_S = 0.1  # a silence this much longer or shorter by the counter has seen a restart
_NEXT_S = 0.03  # the next frame of a link that stalled is no farther by the counter
_LATE_S = 0.1  # this much behind the envelope, a frame is late;
_LATE_BELIEVED_S = 2.0  # and the counter has started anew when all have been for so long
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
    late_since: float | None = None  # arrival of the first of the frames that are all late, s
    arrival: float = 0.0  # of the frame, s
    behind_since: float | None = None  # as `late_since`, of frames that are but a little late


def start_clock(raw_ms: int, arrival: float) -> DeviceClock:
    """The clock after the first frame, whose arrival (s) is all there is to go by."""
    return DeviceClock(raw_ms, offset=arrival, elapsed=0.0, stamp=arrival, arrival=arrival)


def advance_clock(
    clock: DeviceClock, raw_ms: int, arrival: float, *, is_prompt: bool = True
) -> DeviceClock:
    """The clock after a frame with this counter that arrived at `arrival` (s, host).

    `is_prompt` unless it came together with others, which had to wait to be read.
    """
    step = (raw_ms - clock.raw_ms) % _WRAP_MS / 1000
    elapsed = clock.elapsed + step
    late = arrival - elapsed - clock.offset if is_prompt else 0.0
    late_since = _since(clock.late_since, arrival, is_so=late > _LATE_S)
    behind_since = _since(clock.behind_since, arrival, is_so=late > _BEHIND_S)
    if (
        elapsed + clock.offset > arrival + _RESET_S
        or arrival - clock.arrival >= _WRAP_MS / 1000  # nobody knows how often it turned over
        or (step > _NEXT_S and _is_restart(raw_ms, step, silence=arrival - clock.arrival))
        or (late_since is not None and arrival - late_since > _LATE_BELIEVED_S)
    ):
        started = start_clock(raw_ms, max(arrival, clock.stamp + _SHORTEST_STEP_S))
        return replace(started, resets=clock.resets + 1)
    is_slewed = behind_since is not None and arrival - behind_since > _BEHIND_BELIEVED_S
    offset, stamp = clock.offset, clock.stamp
    if step > 0.0:  # a frame that is repeated tells nothing of the time
        highest = clock.offset + (_SLEW if is_slewed else _DRIFT) * step
        offset = min(highest, arrival - elapsed)
        stamp = max(elapsed + offset, clock.stamp + _SHORTEST_STEP_S)
    return DeviceClock(
        raw_ms, offset, elapsed, stamp, step, clock.resets, late_since, arrival, behind_since
    )


def _is_restart(raw_ms: int, step: float, silence: float) -> bool:
    """Whether a counter after a silence (s) began during it rather than going on through it."""
    return raw_ms / 1000 <= silence and abs(step - silence) > _GAP_S


def _since(before: float | None, arrival: float, *, is_so: bool) -> float | None:
    """Since when something has been so, with a frame that arrived at `arrival` (s)."""
    if not is_so:
        return None
    return arrival if before is None else before
