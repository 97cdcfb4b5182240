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
