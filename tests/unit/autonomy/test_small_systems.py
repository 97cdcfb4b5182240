"""Equations put together from their solutions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.autonomy.small_systems import inverse, solved


@given(seed=st.integers(0, 1000), n=st.integers(1, 3), width=st.sampled_from([(), (1,), (7,)]))
def test_it_finds_what_equations_were_made_of(seed: int, n: int, width: tuple[int, ...]) -> None:
    rng = np.random.default_rng(seed)
    A, x = rng.normal(size=(n, n)) + 4.0 * np.eye(n), rng.normal(size=(n, *width))
    np.testing.assert_allclose(solved(A, A @ x), x, atol=1e-9)
    np.testing.assert_allclose(inverse(A) @ A, np.eye(n), atol=1e-9)


def test_what_has_no_solution_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        solved(np.ones((2, 2)), np.ones(2))
