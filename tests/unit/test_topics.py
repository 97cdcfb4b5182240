"""What the types that travel say of themselves."""

import math

import msgspec
import pytest

from tests.unit.test_telemetry import EXAMPLE


def test_sigma_is_the_half_axis_of_the_ellipse_whatever_its_direction() -> None:
    c, s = math.cos(0.6), math.sin(0.6)
    xx, xy, yy = 9 * c * c + s * s, 8 * c * s, 9 * s * s + c * c  # half axes 3 and 1, turned
    turned = msgspec.structs.replace(EXAMPLE, covariance=(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 1.0))
    assert turned.position_sigma == pytest.approx(3.0)
