"""Distances over the cells of a grid, by looking at every pair of cells."""

import numpy as np
import pytest

from gvgbot.maps.distances import cells_to


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (130, 3), (64, 20), (65, 20)])
def test_each_cell_is_as_far_as_the_nearest_of_all(shape: tuple[int, int]) -> None:
    area = np.random.default_rng(4).random(shape) < 0.1
    area[-1, 0] = True
    everywhere, there = np.indices(shape).reshape(2, -1), np.argwhere(area).T
    away = np.hypot(*(everywhere[:, :, None] - there[:, None, :])).min(axis=1)
    np.testing.assert_allclose(cells_to(area), away.reshape(shape))
