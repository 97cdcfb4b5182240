"""What is packed comes back to the last bit, and takes two bytes for each beam."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.geometry import Array, Pose
from gvgbot.hal.deskew import deskewed
from gvgbot.hal.messages import Scan
from gvgbot.hal.packed_scan import PackedScan, Sweep

MOTIONS = st.builds(Pose, *[st.floats(-0.1, 0.1)] * 3) | st.just(Pose())
MILLIMETRES = st.integers(20, 65533).map(lambda mm: mm / 1000.0)  # as drivers have it
RANGES = st.lists(MILLIMETRES | st.sampled_from([math.nan, math.inf]), min_size=2, max_size=50)


def a_scan(ranges: Array) -> Scan:
    mount = Pose(0.1, -0.02, 0.3)
    return Scan(7.25, ranges, -2.1, 4.2 / len(ranges), 0.02, 60.0, 1e-4, mount)


def is_same(one: Scan, other: Scan) -> bool:
    rest = [replace(scan, ranges=np.empty(0)) for scan in (one, other)]
    return repr(rest[0]) == repr(rest[1]) and one.ranges.tobytes() == other.ranges.tobytes()


@given(RANGES, MOTIONS, st.data())
def test_a_sweep_comes_back_as_it_was_deskewed_without_what_was_left_out(
    ranges: list[float], motion: Pose, data: st.DataObject
) -> None:
    raw = a_scan(np.array(ranges))
    seen = deskewed(raw, motion)
    left_out = data.draw(st.lists(st.booleans(), min_size=len(ranges), max_size=len(ranges)))
    sifted = replace(seen, ranges=np.where(left_out, np.nan, seen.ranges))
    assert is_same(PackedScan(sifted, Sweep.of(raw, motion)).unpacked(), sifted)
    assert is_same(PackedScan(seen, Sweep.of(raw, motion)).unpacked(), seen)
    assert is_same(PackedScan(raw).unpacked(), raw)


@pytest.mark.parametrize("odd", [1.0 / 3.0, 65.534, 65.535, 65.537, 80.0, 0.0015])
def test_what_is_no_whole_millimetre_or_too_far_comes_back_too(odd: float) -> None:
    scan = a_scan(np.array([1.0, odd, math.nan, math.inf]))
    assert is_same(PackedScan(scan).unpacked(), scan)


def test_two_bytes_are_kept_for_each_beam() -> None:
    raw, motion = a_scan(np.round(np.linspace(1.0, 9.0, 1000), 3)), Pose(0.02, 0.0, 0.03)
    sweep = Sweep.of(raw, motion)
    tracemalloc.start()
    packed = PackedScan(sweep.deskewed, sweep)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert packed.stamp == 7.25
    assert 2000 < kept < 3000
