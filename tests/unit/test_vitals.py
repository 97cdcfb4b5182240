"""What the program says of itself, held against what the operating system says."""

import resource
import time
from pathlib import Path

import pytest

from gvgbot.topics import Health
from gvgbot.vitals import Vitals
from tests.unit.test_telemetry import EXAMPLE


def health(vitals: Vitals, now: float) -> Health:
    return vitals.health(now, unsent=3, laser=EXAMPLE.laser, base=EXAMPLE.base)


def test_late_cycles_are_counted_and_the_slowest_is_that_of_the_last_period() -> None:
    vitals = Vitals(began=10.0)
    for age in (0.01, 0.09, 0.11, 0.5, 0.02):
        vitals.note_cycle(age)
    first = health(vitals, 12.0)
    assert (first.cycles, first.late_cycles, first.slowest_cycle) == (5, 2, 0.5)
    assert (first.stamp, first.uptime, first.unsent) == (12.0, 2.0, 3)
    vitals.note_cycle(0.03)
    second = health(vitals, 13.0)
    assert (second.cycles, second.late_cycles, second.slowest_cycle) == (6, 2, 0.03)
    assert health(vitals, 14.0).slowest_cycle == 0.0


def test_computing_takes_cores_and_waiting_takes_none() -> None:
    vitals = Vitals(began=0.0)
    begin, used = time.perf_counter(), time.process_time()
    while time.process_time() < used + 0.2:
        pass
    told = health(vitals, 1.0)
    assert told.cpu == pytest.approx(0.2 / (time.perf_counter() - begin), rel=0.2)


def test_the_memory_is_what_the_kernel_says() -> None:
    (line,) = [x for x in Path("/proc/self/status").read_text().split("\n") if "VmRSS" in x]
    told = health(Vitals(began=0.0), 0.0).memory
    assert told == pytest.approx(1024 * int(line.split()[1]), rel=0.1)
    assert told <= 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1.01
