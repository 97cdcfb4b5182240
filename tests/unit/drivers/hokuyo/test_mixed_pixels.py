"""Beams of a simulated laser that meet two things at once."""

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.scip import ScipParser
from gvgbot.drivers.hokuyo.scip_messages import ScanReply
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.hokuyo.twin_readings import with_mixed_pixels

EDGE = np.repeat([1.0, 3.0], 100)


def test_one_beam_at_the_edge_on_either_side_lies_anywhere_between_near_and_far() -> None:
    rng = np.random.default_rng(1)
    scans = np.array([with_mixed_pixels(EDGE, 1.0, rng) for _ in range(1000)])
    scan, beam = np.nonzero(scans != EDGE)
    assert np.array_equal(scan, np.arange(1000))
    near_side, far_side = (np.count_nonzero(beam == at) for at in (99, 100))
    assert near_side + far_side == 1000
    assert near_side == pytest.approx(500, abs=5 * np.sqrt(1000 * 0.25))
    at_edge = np.sort(scans[scan, beam])
    uniform = 1.0 + 2.0 * (np.arange(1000) + 0.5) / 1000
    assert np.abs(at_edge - uniform).max() < 2.0 * 0.06  # Kolmogorov and Smirnov, p < 0.002


@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_the_fraction_is_that_of_the_edges(fraction: float) -> None:
    fence = np.tile([1.0, 1.0, 2.0, 2.0], 5000)
    mixed = with_mixed_pixels(fence, fraction, np.random.default_rng(2)) != fence
    assert mixed.sum() == pytest.approx(9_999 * fraction, abs=5 * np.sqrt(9_999 * 0.25))
    assert fraction not in (0.0, 1.0) or mixed.sum() == 9_999 * fraction


def test_a_smooth_wall_and_the_rim_of_nothing_stay_as_they_are() -> None:
    wall = np.concatenate((np.linspace(1.0, 8.0, 100), np.full(50, np.inf), np.full(50, 2.0)))
    assert np.array_equal(with_mixed_pixels(wall, 1.0, np.random.default_rng(3)), wall)


@pytest.mark.parametrize("increment", [0.25, 0.3515625])
def test_a_straight_wall_seen_at_a_low_angle_has_no_edges(increment: float) -> None:
    """A metre aside, out to where it is seen at 3 degrees: steps of up to 2 m, either way."""
    wall = 1.0 / np.sin(np.radians(np.arange(3.0, 90.0, increment)))
    assert np.abs(np.diff(wall)).max() > 1.0
    for ranges in (wall, wall[::-1]):
        mixed = with_mixed_pixels(ranges, 1.0, np.random.default_rng(4))
        assert np.array_equal(mixed, ranges)


def test_the_laser_sends_mixed_pixels_if_told_to() -> None:
    config = HokuyoTwinConfig(range_sigma_m=0.0, dropout_fraction=0.0, mixed_pixel_fraction=1.0)
    twin = HokuyoTwin(config, lambda *_: np.repeat([1.0, 3.0], [540, 541]), 0)
    twin.receive(b"MD0000108001001\n", 0.0)
    (scan,) = [
        message
        for message in ScipParser().feed(twin.advance(1.0))
        if isinstance(message, ScanReply) and len(message.ranges)
    ]
    assert np.isin(scan.ranges[:539], 1000).all()
    assert np.isin(scan.ranges[541:], 3000).all()
    near, far = scan.ranges[539:541]
    assert (1000 < near < 3000) != (1000 < far < 3000)
