"""What is matched of a scan."""

import numpy as np

from gvgbot.autonomy.slam.sampling import sampled
from gvgbot.hal.messages import Scan


def test_a_scan_is_sampled_along_walls_and_not_across_the_gaps_between_them() -> None:
    """Half of the beams hit a wall at 2 m, the others one at 20 m, and nothing lies between."""
    ranges = np.repeat([2.0, 20.0], 200)
    points = sampled(Scan(0.0, ranges, -1.0, 0.005, 0.1, 30.0), 100)
    assert 80 <= len(points) <= 101  # had the gap its share, it would be 64
