"""What a message tells beside what it holds."""

import math

import numpy as np
import pytest

from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan


def test_a_beam_ends_where_it_hits_and_without_a_hit_nowhere() -> None:
    ranges = np.array([1.0, math.nan, 2.0, math.inf, 3.0])
    scan = Scan(0.0, ranges, -math.pi / 2, math.pi / 4, 0.1, 30.0)
    right, ahead, left = scan.ends
    assert right == pytest.approx([0.0, -1.0])
    assert ahead == pytest.approx([2.0, 0.0])
    assert left == pytest.approx([0.0, 3.0])


def test_a_laser_that_is_turned_on_its_base_looks_to_the_side() -> None:
    scan = Scan(0.0, np.ones(181), -math.pi / 2, math.pi / 180, 0.1, 30.0, 0.0, Pose(theta=0.5))
    assert scan.field_of_view == pytest.approx((0.5 - math.pi / 2, 0.5 + math.pi / 2))


@pytest.mark.parametrize(
    ("first_deg", "beams", "yaw_deg", "is_so"),
    [
        (-90, 181, 0.0, True),
        (-90, 181, 59.0, True),
        (-90, 181, -59.0, True),
        (-90, 181, 61.0, False),
        (-90, 181, 180.0, False),
        (-135, 271, 180.0, False),
        (0, 181, 0.0, False),
        (0, 360, 0.0, True),
        (-29, 59, 0.0, False),
    ],
)
def test_a_laser_looks_ahead_if_it_sees_30_degrees_to_either_side(
    first_deg: int, beams: int, yaw_deg: float, *, is_so: bool
) -> None:
    """A degree from beam to beam; the one that begins ahead sees all around."""
    mount, step = Pose(theta=math.radians(yaw_deg)), math.radians(1.0)
    scan = Scan(0.0, np.ones(beams), first_deg * step, step, 0.1, 30.0, 0.0, mount)
    assert scan.looks_ahead is is_so
