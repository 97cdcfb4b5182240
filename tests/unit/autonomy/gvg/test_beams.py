"""What is taken for a mixed pixel, against walls that scans were cast at."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.beams import is_lone, without_mixed_pixels
from gvgbot.drivers.hokuyo.twin_readings import with_mixed_pixels
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import carved, sweep

ROOM_BY_CORRIDOR = carved([(-8.0, -1.0, 8.0, 1.0), (-0.5, 1.0, 0.5, 1.2), (-3.0, 1.2, 3.0, 5.0)])
PLACES = [(-2.0, -0.4), (-0.5, 0.0), (0.0, 0.0), (1.0, 0.3), (0.0, 1.1), (0.0, 3.0), (2.0, 4.0)]
NAN = math.nan


def scan_of(*ranges: float) -> Scan:
    """Beams side by side, a quarter of a degree apart."""
    return Scan(0.0, np.array(ranges), 0.0, math.radians(0.25), 0.1, 30.0)


def off_the_walls(scan: Scan, true: Scan) -> Array:
    """Metres (N,) from where beams end to the next end of any true one; NaN if they failed."""
    off, told = np.full(len(scan.ranges), NAN), ~np.isnan(scan.ranges)
    ends, walls = (one.ranges[:, None] * one.directions for one in (scan, true))
    off[told] = cKDTree(walls).query(ends[told])[0]
    return off


def test_what_floats_between_near_and_far_is_left_out_and_no_wall() -> None:
    floating = left_over = lost = beams = 0
    for seed, place in enumerate(PLACES * 10):
        rng = np.random.default_rng(seed)
        true = sweep(ROOM_BY_CORRIDOR, Pose(*place, 0.0))
        noise = 0.01 * rng.standard_normal(len(true.ranges))
        scan = replace(true, ranges=with_mixed_pixels(true.ranges, 0.3, rng) + noise)
        left, off = without_mixed_pixels(scan), off_the_walls(scan, true)
        floating += int((off > 0.2).sum())
        left_over += int((off_the_walls(left, true) > 0.2).sum())
        lost += int((np.isnan(left.ranges) & (off < 0.05)).sum())
        beams += len(off)
    assert floating > 40
    assert left_over < 0.1 * floating
    assert lost < 0.002 * beams


@pytest.mark.parametrize("increment", [0.25, 0.3515625])
@pytest.mark.parametrize("sigma", [0.01, 0.03])
def test_a_wall_seen_at_a_low_angle_is_no_mixed_pixel(sigma: float, increment: float) -> None:
    """A metre aside, out to where it is seen at 3 degrees: 19 m away, steps of up to 1.5 m."""
    rng, step = np.random.default_rng(1), math.radians(increment)
    angles = np.arange(math.radians(3.0), math.radians(60.0), step)
    scan = Scan(0.0, 1.0 / np.sin(angles), angles[0], step, 0.1, 30.0)
    left_out = 0
    for _ in range(50):
        noisy = scan.ranges + sigma * rng.standard_normal(len(angles))
        left_out += int(np.isnan(without_mixed_pixels(replace(scan, ranges=noisy)).ranges).sum())
    assert left_out <= 0.002 * 50 * len(angles)


@pytest.mark.parametrize(
    ("ranges", "expected"),
    [
        pytest.param((1.0, 1.0, 2.0, 3.0, 3.0), (1.0, 1.0, NAN, 3.0, 3.0), id="beside an edge"),
        pytest.param(
            (1.0, 1.0, NAN, 2.0, 3.0, 3.0),
            (1.0, 1.0, NAN, NAN, 3.0, 3.0),
            id="beside one that failed",
        ),
        pytest.param(
            (1.0, 1.0, 2.0, math.inf, math.inf),
            (1.0, 1.0, NAN, math.inf, math.inf),
            id="before nothing",
        ),
        pytest.param(
            (1.0, 1.0, 2.0, 1.0, 1.0), (1.0, 1.0, NAN, 1.0, 1.0), id="through glass, ends behind it"
        ),
        pytest.param(
            (1.0, 6.0, 2.0, 6.0, 1.0), (1.0, 6.0, 2.0, 6.0, 1.0), id="beside one that floats"
        ),
        pytest.param((3.0, 3.0, 1.0, 3.0, 3.0), (3.0, 3.0, 1.0, 3.0, 3.0), id="a post"),
        pytest.param((3.0, 3.0, 1.0, 4.0, 4.0), (3.0, 3.0, 1.0, 4.0, 4.0), id="a post at an edge"),
        pytest.param((1.0, 1.0, 3.0, 3.0), (1.0, 1.0, 3.0, 3.0), id="an edge"),
        pytest.param((1.0,), (1.0,), id="one beam"),
        pytest.param((NAN, NAN), (NAN, NAN), id="blind"),
    ],
)
def test_readings_between_a_near_and_a_far_thing_are_dropped_and_no_others(
    ranges: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    np.testing.assert_array_equal(without_mixed_pixels(scan_of(*ranges)).ranges, expected)


@pytest.mark.parametrize(
    "ranges", [(3.0, 1.0, 3.0), (3.0, NAN, 1.0, 3.0), (math.inf, NAN, NAN, 1.0, NAN, 3.0)]
)
def test_one_echo_among_beams_that_go_on_is_alone_whatever_failed(
    ranges: tuple[float, ...],
) -> None:
    expected = [at == 1.0 for at in ranges]
    np.testing.assert_array_equal(is_lone(np.array(ranges)), expected)
