"""Linear equations with a few unknowns, by LAPACK's own routine.

NumPy's functions around the same one take four times as long for those.
"""

import numpy as np
from scipy.linalg.lapack import dgesv

from gvgbot.geometry import Array


def solved(A: Array, b: Array) -> Array:
    """The x for which A x = b (N,) or (N, M)."""
    x: Array
    _, _, x, failure = dgesv(A, b)
    if failure:
        raise np.linalg.LinAlgError("the matrix is singular")
    return np.ascontiguousarray(x)


def inverse(A: Array) -> Array:
    """The inverse of A (N, N)."""
    return solved(A, np.eye(len(A)))
