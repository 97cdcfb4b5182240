"""Which points of two sets belong together, and the turn and shift that lay one on the other."""

import numpy as np

from gvgbot.geometry import Array, Pose

SAME_M = 0.6  # vertices of a building nearer to each other are one
SAME_RAD = 0.7  # departures from a vertex nearer to each other are one
AHEAD_M = 0.8  # along an edge, its direction is taken
_LEAST_VARIANCE_M2 = 1e-4  # of points: that they lie on each other exactly may be by chance
_LEAST_SPREAD_M2 = 1e-6  # squared distance from their middle: one point alone has none


def assigned(distances: Array, within: float) -> list[tuple[int, int]]:
    """Rows and columns of distances (N, M) that belong together, each once, in the order of rows.

    All pairs are nearer than `within`, and the sum of distances is least, where whoever stays
    alone counts as so far away.
    """
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(np.minimum(distances, within))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, j) for i, j in pairs if distances[i, j] < within]


def rigid_fit(a: Array, b: Array) -> tuple[Pose, Array]:
    """The pose of b's frame in a's that lays points b (N, 2), m, on a (N, 2) best; its covariance.

    Least squares, which have a closed form: Umeyama, "Least-squares estimation of transformation
    parameters between two point patterns", IEEE PAMI 13(4), 1991. In the plane points are complex
    numbers and the turn is the direction of their covariance. One point alone tells no turn: 0.

    The covariance (3, 3) of x, y, theta in m^2, m rad and rad^2 is by how far the points stay
    apart. It does not shrink with their number: they need not err independently.
    """
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.vdot(v - v.mean(), u - u.mean())
    turn = turn / abs(turn) if turn else 1.0
    shift = u.mean() - v.mean() * turn
    pose = Pose(float(shift.real), float(shift.imag), float(np.angle(turn)))
    off = a - pose.transform(b)
    variance = max(float((off**2).sum() / max(1, 2 * len(a) - 3)), _LEAST_VARIANCE_M2)
    spread = max(float((np.abs(v - v.mean()) ** 2).mean()), _LEAST_SPREAD_M2)
    middle = pose.transform(b).mean(axis=0)
    lever = np.array([middle[1] - pose.y, -(middle[0] - pose.x)])  # of the origin by the turn
    of_turn = variance / spread
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = variance * np.eye(2) + of_turn * np.outer(lever, lever)
    covariance[:2, 2] = covariance[2, :2] = of_turn * lever
    covariance[2, 2] = of_turn
    return pose, covariance
