"""How the program itself is doing: whether its control loop keeps up, and what it costs."""

import resource
import time
from pathlib import Path

from gvgbot.topics import LATE_AFTER, Health, LinkHealth

_STATM = Path("/proc/self/statm")


class Vitals:
    """Counts and measures since the program began."""

    def __init__(self, began: float) -> None:
        """`began`: the robot's clock now."""
        self._began = began
        self.cycles = 0
        self._late, self._slowest = 0, 0.0
        self._used, self._used_at = _cpu_time(), time.perf_counter()

    def note_cycle(self, age: float) -> None:
        """Count a control cycle that acted on odometry of an age, s."""
        self.cycles += 1
        self._late += age > LATE_AFTER
        self._slowest = max(self._slowest, age)

    def uptime(self, now: float) -> float:
        """Seconds since the program began."""
        return now - self._began

    def health(self, now: float, *, unsent: int, laser: LinkHealth, base: LinkHealth) -> Health:
        """The report at `now`; what it says of the time since the last one begins anew."""
        slowest, self._slowest = self._slowest, 0.0
        return Health(
            stamp=now,
            uptime=self.uptime(now),
            cycles=self.cycles,
            late_cycles=self._late,
            slowest_cycle=slowest,
            cpu=self._cpu(),
            memory=_memory(),
            unsent=unsent,
            laser=laser,
            base=base,
        )

    def _cpu(self) -> float:
        """Cores kept busy since the last call, whatever the robot's clock says."""
        used, at = _cpu_time(), time.perf_counter()
        share = (used - self._used) / max(1e-3, at - self._used_at)
        self._used, self._used_at = used, at
        return share


def _cpu_time() -> float:
    """Seconds that all threads of this process have computed."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _memory() -> int:
    """Bytes of this process that are in the machine's memory."""
    resident = int(_STATM.read_text(encoding="ascii").split()[1])
    return resident * resource.getpagesize()
