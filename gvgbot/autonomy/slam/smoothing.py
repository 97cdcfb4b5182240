"""The whole trajectory and all vertices at once: a pose graph over keyframes and vertices.

The EKF is the measure of uncertainty while driving; this corrects the past by what was learnt
later. Gauss-Newton on relative SE(2) poses, solved sparsely. Constraints that may be mistakes count
the less the more the others disagree with them, as if their errors had Cauchy's distribution.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from gvgbot.geometry import Array, Pose, rows_of, seen_from, wrap_angles

Index = NDArray[np.intp]

_ITERATIONS = 15
_DOUBT = 3.0  # squared Mahalanobis distance at which a doubtful constraint counts half
_CONVERGED = 1e-5  # metres and radians
_TOGETHER = 8  # poses whose covariances are solved for at a time: the columns are long
_FIXED = 1e12  # information that holds the first pose in place


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Pose `b` seen from pose `a`, with its information matrix (3, 3) in a's frame."""

    a: int
    b: int
    a_b: Pose
    information: Array
    doubtful: bool = False


class PoseGraph:
    """Constraints as arrays."""

    def __init__(self, constraints: list[Constraint]) -> None:
        self._a = np.array([c.a for c in constraints], np.intp)
        self._b = np.array([c.b for c in constraints], np.intp)
        self._z = rows_of(c.a_b for c in constraints)
        self._W = np.array([c.information for c in constraints]).reshape(-1, 3, 3)
        self._doubtful = np.array([c.doubtful for c in constraints], np.bool_)

    def solve(self, poses: Array, within: float = _CONVERGED) -> Array:
        """The poses (N, 3) that agree best with all constraints, the first one staying in place.

        As well as that can be told when a step moves none by more than `within`, m and rad.
        """
        x = poses.copy()
        if not len(self._a):
            return x
        blocks = _Blocks.of(self._a, self._b, len(x))
        for iteration in range(_ITERATIONS):
            H, g = self._normal_equations(x, blocks, trusting=iteration == 0)
            change = -_factors(H).solve(g).reshape(-1, 3)
            x += change
            x[:, 2] = wrap_angles(x[:, 2])
            if np.abs(change).max() < within and iteration > 0:
                break
        return x

    def covariances(self, poses: Array, wanted: list[int]) -> Array:
        """Covariances (K, 3, 3) of K of the solved poses (N, 3), against the first, m and rad."""
        if not wanted:
            return np.empty((0, 3, 3))
        blocks = _Blocks.of(self._a, self._b, len(poses))
        H, _ = self._normal_equations(poses, blocks, trusting=False)
        factors, parts = _factors(H), range(0, len(wanted), _TOGETHER)
        return np.concatenate([_inverse_blocks(factors, wanted[i : i + _TOGETHER]) for i in parts])

    def _normal_equations(
        self, x: Array, blocks: "_Blocks", *, trusting: bool
    ) -> tuple[csc_array, Array]:
        """Information matrix H (3N, 3N) and gradient g (3N,); trusting, nothing is doubted."""
        r, A, B = _residuals(x, self._a, self._b, self._z)
        W = self._W if trusting else self._W * self._weights(r)[:, None, None]
        AW, BW = A.swapaxes(1, 2) @ W, B.swapaxes(1, 2) @ W
        ab = AW @ B
        H = blocks.matrix(np.concatenate([AW @ A, BW @ B, ab, ab.swapaxes(1, 2)]))
        g = np.zeros((len(x), 3))
        np.add.at(g, self._a, (AW @ r[:, :, None])[:, :, 0])
        np.add.at(g, self._b, (BW @ r[:, :, None])[:, :, 0])
        return H, g.ravel()

    def _weights(self, r: Array) -> Array:
        """How much each constraint counts (K,), by its residuals (K, 3)."""
        distance = np.einsum("ki,kij,kj->k", r, self._W, r)
        return np.where(self._doubtful, 1.0 / (1.0 + distance / _DOUBT), 1.0)


class _Blocks(NamedTuple):
    """Where values of a sparse matrix lie that come as blocks (3, 3), of which some coincide.

    They come in the order aa, bb, ab, ba for all pairs of poses a and b, after that which holds the
    first pose in place.
    """

    place: Index  # in the matrix's data, of every value
    rows: NDArray[np.intc]
    starts: NDArray[np.intc]  # of the columns

    @classmethod
    def of(cls, a: Index, b: Index, n: int) -> Self:
        """The blocks of pairs (K,) of N poses."""
        row, column = np.concatenate([[0], a, b, a, b]), np.concatenate([[0], a, b, b, a])
        k = np.arange(3)
        rows, columns = (3 * row[:, None] + k)[:, :, None], (3 * column[:, None] + k)[:, None, :]
        kept, place = np.unique((3 * n * columns + rows).ravel(), return_inverse=True)
        starts = np.searchsorted(kept, 3 * n * np.arange(3 * n + 1))
        return cls(place, (kept % (3 * n)).astype(np.intc), starts.astype(np.intc))

    def matrix(self, values: Array) -> csc_array:
        """The matrix of blocks (4K, 3, 3), those at the same place added up."""
        all_values = np.concatenate([(_FIXED * np.eye(3)).ravel(), values.ravel()])
        data = np.bincount(self.place, all_values, minlength=len(self.rows))
        n = len(self.starts) - 1
        return csc_array((data, self.rows, self.starts), (n, n))


def _factors(H: csc_array) -> SuperLU:
    """H, which is symmetric and positive, made ready to be solved by."""
    return splu(
        H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def _inverse_blocks(factors: SuperLU, poses: list[int]) -> Array:
    """The blocks (K, 3, 3) of some poses on the diagonal of the inverse of what was factored."""
    rows = 3 * np.array(poses)[:, None] + np.arange(3)
    columns = np.zeros((factors.shape[0], rows.size))
    columns[rows.ravel(), np.arange(rows.size)] = 1.0
    P = factors.solve(columns).reshape(len(columns), len(poses), 3)
    found: Array = np.array([P[row, i] for i, row in enumerate(rows)])
    found += found.swapaxes(1, 2).copy()  # rounding has made it a little less than symmetrical
    return found / 2


def _residuals(x: Array, a: Index, b: Index, z: Array) -> tuple[Array, Array, Array]:
    """Expected minus measured relative poses r (K, 3), and Jacobians by both poses (K, 3, 3)."""
    expected = seen_from(x[a], x[b])
    r = expected - z
    r[:, 2] = wrap_angles(r[:, 2])
    c, s = np.cos(x[a, 2]), np.sin(x[a, 2])
    A = np.zeros((len(a), 3, 3))
    A[:, 0, 0], A[:, 0, 1], A[:, 0, 2] = -c, -s, expected[:, 1]
    A[:, 1, 0], A[:, 1, 1], A[:, 1, 2] = s, -c, -expected[:, 0]
    A[:, 2, 2] = -1.0
    B = np.zeros((len(a), 3, 3))
    B[:, 0, 0], B[:, 0, 1] = c, s
    B[:, 1, 0], B[:, 1, 1] = -s, c
    B[:, 2, 2] = 1.0
    return r, A, B
