"""What odometry scatters by is found from corrections that are drawn with a known scatter."""

import numpy as np
import pytest

from gvgbot.autonomy.slam.spread import Spread
from gvgbot.geometry import Array, Pose

Q = np.array([[2.5e-4, 0.0, 0.0], [0.0, 5e-7, 3e-6], [0.0, 3e-6, 3e-5]])
NO_NOISE = np.zeros((3, 3))


def after(along: float, turn: float, walls: Array, steps: int = 400) -> Spread:
    """The spread after corrections by walls of this information, odometry scattering so much."""
    rng, spread = np.random.default_rng(3), Spread()
    C = np.linalg.inv(np.linalg.inv(Q) + walls)
    gain = np.eye(3) - C @ np.linalg.inv(Q)
    by_walls = gain @ C
    sigma = np.diag(np.sqrt([along, turn, turn]))
    off = rng.multivariate_normal(np.zeros(3), sigma @ Q @ sigma, steps) @ gain.T
    off += rng.multivariate_normal(np.zeros(3), (by_walls + by_walls.T) / 2, steps)
    for change in off:
        spread.learn(Pose.from_array(change), Q, gain, by_walls)
    return spread


@pytest.mark.parametrize(("along", "turn"), [(1.0, 1.0), (0.3, 0.1), (4.0, 0.5), (9.0, 9.0)])
def test_the_scatter_is_found(along: float, turn: float) -> None:
    """Of 200 squares the mean is known to a tenth, and to three of those with certainty."""
    found = after(along, turn, np.diag([1e5, 1e5, 1e6])).factors
    assert found == pytest.approx([along, turn], rel=0.4)


def test_walls_that_say_nothing_of_the_way_along_change_nothing_there() -> None:
    along, turn = after(4.0, 0.2, np.diag([0.0, 1e5, 1e6])).factors
    assert along == pytest.approx(1.0, abs=0.05)
    assert turn == pytest.approx(0.2, rel=0.4)


def test_the_covariance_of_a_step_scales_with_what_was_found() -> None:
    spread = Spread()
    assert np.allclose(spread.honest(Q), Q)
    spread.factors = np.array([4.0, 0.25])
    assert np.allclose(np.diag(spread.honest(Q)), np.diag(Q) * [4.0, 0.25, 0.25])
    assert np.linalg.eigvalsh(spread.honest(Q)).min() > 0.0


def test_one_wild_correction_does_not_make_odometry_worthless() -> None:
    """A robot that was carried a metre tells as much as one that slipped by five sigma."""
    spread = Spread()
    for _ in range(100):
        spread.learn(Pose(np.sqrt(Q[0, 0]), 0.0, np.sqrt(Q[2, 2])), Q, np.eye(3), NO_NOISE)
    spread.learn(Pose(1.0, 0.0, 0.0), Q, np.eye(3), NO_NOISE)
    assert spread.factors[0] < 1.0 + 25.0 / 50.0
