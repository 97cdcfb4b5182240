"""The whole trajectory and all vertices at once: a pose graph over keyframes and vertices.

The EKF is the measure of uncertainty while driving; this corrects the past by what was learnt
later. Gauss-Newton on relative SE(2) poses, solved sparsely.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from gvgbot.geometry import Array, Pose

Index = NDArray[np.intp]

_ITERATIONS = 8
_CONVERGED = 1e-5  # metres and radians
_FIXED = 1e12  # information that holds the first pose in place


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Pose `b` seen from pose `a`, with its information matrix (3, 3) in a's frame."""

    a: int
    b: int
    a_b: Pose
    information: Array


def smooth(poses: Array, constraints: list[Constraint]) -> Array:
    """The poses (N, 3) that agree best with all constraints, the first one staying where it is."""
    x = poses.copy()
    if not constraints:
        return x
    a = np.array([c.a for c in constraints])
    b = np.array([c.b for c in constraints])
    z = np.array([(c.a_b.x, c.a_b.y, c.a_b.theta) for c in constraints])
    W = np.array([c.information for c in constraints])
    for _ in range(_ITERATIONS):
        change = _step(x, a, b, z, W)
        x += change
        x[:, 2] = np.remainder(x[:, 2] + np.pi, 2 * np.pi) - np.pi
        if np.abs(change).max() < _CONVERGED:
            break
    return x


def _step(x: Array, a: Index, b: Index, z: Array, W: Array) -> Array:
    """One Gauss-Newton step (N, 3)."""
    r, A, B = _residuals(x, a, b, z)
    blocks = [
        (p, q, np.einsum("kji,kjl,klm->kim", P, W, Q))
        for p, P in ((a, A), (b, B))
        for q, Q in ((a, A), (b, B))
    ]
    n = 3 * len(x)
    k = np.arange(3)
    rows = [
        np.broadcast_to((3 * p[:, None] + k)[:, :, None], h.shape).ravel() for p, _, h in blocks
    ]
    cols = [
        np.broadcast_to((3 * q[:, None] + k)[:, None, :], h.shape).ravel() for _, q, h in blocks
    ]
    values = [h.ravel() for _, _, h in blocks]
    rows.append(k)
    cols.append(k)
    values.append(np.full(3, _FIXED))
    H = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), (n, n))
    g = np.zeros((len(x), 3))
    np.add.at(g, a, np.einsum("kji,kjl,kl->ki", A, W, r))
    np.add.at(g, b, np.einsum("kji,kjl,kl->ki", B, W, r))
    return -np.asarray(spsolve(H.tocsc(), g.ravel())).reshape(-1, 3)


def _residuals(x: Array, a: Index, b: Index, z: Array) -> tuple[Array, Array, Array]:
    """Expected minus measured relative poses r (K, 3), and Jacobians by both poses (K, 3, 3)."""
    c, s = np.cos(x[a, 2]), np.sin(x[a, 2])
    d = x[b] - x[a]
    expected = np.stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]], axis=1)
    r = expected - z
    r[:, 2] = np.remainder(r[:, 2] + np.pi, 2 * np.pi) - np.pi
    A = np.zeros((len(a), 3, 3))
    A[:, 0, 0], A[:, 0, 1], A[:, 0, 2] = -c, -s, expected[:, 1]
    A[:, 1, 0], A[:, 1, 1], A[:, 1, 2] = s, -c, -expected[:, 0]
    A[:, 2, 2] = -1.0
    B = np.zeros((len(a), 3, 3))
    B[:, 0, 0], B[:, 0, 1] = c, s
    B[:, 1, 0], B[:, 1, 1] = -s, c
    B[:, 2, 2] = 1.0
    return r, A, B
