"""The robot knows when it is back where it started, and only then."""

import numpy as np
import pytest

from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.start_edge import is_at_start


def belief(x: float, y: float, sigma: float) -> Belief:
    return Belief(np.array([x, y, 0.3]), np.diag([sigma**2, sigma**2, 0.01]))


@pytest.mark.parametrize(
    ("x", "y", "sigma", "clearance", "there"),
    [
        (0.0, 0.0, 0.1, 1.0, True),
        (0.3, 0.2, 0.1, 1.0, True),
        (0.3, 0.2, 0.1, 0.3, False),  # a wall may stand between here and there
        (0.9, 0.0, 2.0, 3.0, False),  # a robot that is lost is not everywhere
        (0.78, 0.0, 0.01, 3.0, False),  # 3 sigmas of 0.25 m away: somewhere else
    ],
)
def test_the_start_is_near_within_the_disc_and_within_the_uncertainty(
    *, x: float, y: float, sigma: float, clearance: float, there: bool
) -> None:
    start = np.array([2.0, -1.0])
    here = belief(2.0 + x, -1.0 + y, sigma)
    assert is_at_start(here, start, clearance) == there
