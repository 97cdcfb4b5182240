"""How much a stretch of a scan speaks for a leg or a body, and how much for walls and corners.

Two explanations compete for where the beams end: a circle as wide as people, and two straight
lines. What each leaves unexplained, by the noise of the laser, makes a log-likelihood, and those of
several looks add up: they tell together what no single one does.
"""

import math

import numpy as np

from gvgbot.autonomy.small_systems import solved
from gvgbot.geometry import Array

SURE = 3.0  # of the log-likelihood: twenty to one
_RADII_M = (0.05, 0.4)  # of a leg, and of somebody in a coat
_SURFACE_M = 0.005  # r.m.s., by which even without noise nothing is a circle or a line
_ROUND = 0.06  # of its radius: a body strays from a circle by no more than this and the noise
_SPARE = 1.5  # of the log-likelihood: what two lines gain by mere noise, having more freedom
_MOST = 8.0  # that one look can tell: whatever hides a part of somebody is not known either
_FADING = 0.8  # of the evidence is left at the next look: looks from one place err alike
_STEPS = 5
_NEGLIGIBLE_M = 1e-4
_DAMPING = 1e-9 * np.eye(3)  # far less than what noise does, far more than rounding
_LEAST_BEAMS = 5  # that tell where a body of known radius is
_LOOSE_M = 0.03  # by which beams that end on such a body stray, and its width


def round_evidence(
    ends: Array, eye: Array, noise: float, *, only_sure: bool = False
) -> tuple[float, Array, float]:
    """Log-likelihood ratio of a circle to two lines; the circle's centre (2,) and radius, m.

    `ends` (N, 2), in the order of their beams, were seen from `eye` (2,) with this noise, m. With
    `only_sure` it is 0 where lines explain them so well that even a perfect circle is not SURE.
    """
    off_lines = _off_two_lines(ends)
    if only_sure and _likelier(off_lines, noise) <= SURE:
        return 0.0, ends.mean(axis=0), 0.0
    centre, radius = _circle(ends, eye)
    stray = np.hypot(*(ends - centre).T) - radius
    evidence = _likelier(off_lines - float(stray @ stray), noise)
    if np.std(stray) > math.hypot(_ROUND * radius, noise):  # it is neither
        evidence = min(evidence, 0.0)
    return max(-_MOST, min(evidence, _MOST)), centre, radius


def body_of(ends: Array, eye: Array, radius: float) -> Array | None:
    """The centre (2,) of a body of known radius, m, that is all of what is seen; None if it is not.

    `ends` (N, 2), in the order of their beams, were seen from `eye` (2,). Too few to tell a circle
    from a wall tell where one is, if they are as far apart as it is wide, but for a beam or two.
    """
    if len(ends) < _LEAST_BEAMS:
        return None
    width = float(np.hypot(*(ends[-1] - ends[0])))
    between = width / (len(ends) - 1)
    if not 2.0 * (radius - between) - _LOOSE_M < width < 2.0 * radius + _LOOSE_M:
        return None
    middle = ends.mean(axis=0)
    centre = middle + radius * (middle - eye) / np.hypot(*(middle - eye))
    for _ in range(_STEPS):
        to_centre = ends - centre
        distance = np.hypot(*to_centre.T)
        slopes = to_centre / distance[:, None]
        centre = centre + _least_squares(np.ascontiguousarray(slopes.T), distance - radius)
    stray = np.hypot(*(ends - centre).T) - radius
    return centre if float(np.sqrt(np.mean(stray**2))) < _LOOSE_M else None


def _likelier(gain: float, noise: float) -> float:
    """How much a circle is likelier, by how much less it leaves of the squared distances, m²."""
    variance = noise**2 + _SURFACE_M**2
    return gain / (2.0 * variance) + _SPARE * noise**2 / variance


def with_look(evidence: float, look: float) -> float:
    """The evidence of some looks, and now of one more."""
    return _FADING * evidence + look


def _circle(ends: Array, eye: Array) -> tuple[Array, float]:
    """Centre (2,) and radius, m, of the nearest circle to ends (N, 2) that bulges to the eye.

    Gauss-Newton, from the algebraic fit of Kåsa: |p|² = 2 c·p + r² - |c|².
    """
    middle = ends.mean(axis=0)
    px, py = (ends - middle).T
    square = px * px + py * py
    x, y = _least_squares(np.array([2.0 * px, 2.0 * py]), square)
    radius = _possible(math.sqrt(float(square.mean()) + x * x + y * y))
    away = (middle - eye) / np.hypot(*(middle - eye))
    if x * away[0] + y * away[1] <= 0.0 or math.hypot(x, y) > radius:
        x, y = (radius * away).tolist()
    A = np.ones((3, len(ends)))  # by how much distances shrink with x, y and the radius
    for _ in range(_STEPS):
        dx, dy = px - x, py - y
        distance = np.hypot(dx, dy)
        A[0], A[1], stray = dx / distance, dy / distance, distance - radius
        u, v, wider = _least_squares(A, stray)
        if _possible(radius + wider) != radius + wider:
            wider = _possible(radius + wider) - radius
            u, v = _least_squares(A[:2], stray - wider)
        shorter = 1.0 / max(1.0, math.hypot(u, v) / radius)
        x, y, radius = x + shorter * u, y + shorter * v, radius + shorter * wider
        if shorter * max(abs(u), abs(v), abs(wider)) < _NEGLIGIBLE_M:
            break
    return middle + np.array([x, y]), radius


def _least_squares(A: Array, b: Array) -> list[float]:
    """The x (M,) for which A' x is nearest to b (N,), by A (M, N): the normal equations.

    They are damped a little, so that there is an x if all beams end on one ray.
    """
    x: list[float] = solved(A @ A.T + _DAMPING[: len(A), : len(A)], A @ b).tolist()
    return x


def _possible(radius: float) -> float:
    return min(max(radius, _RADII_M[0]), _RADII_M[1])


def _off_two_lines(ends: Array) -> float:
    """Sum of the squared distances, m², of ends (N, 2) to two lines, the first ones to one."""
    x, y = (ends - ends.mean(axis=0)).T
    moments = np.array([np.ones(len(x)), x, y, x * x, y * y, x * y]).cumsum(axis=1)
    ahead, whole = moments[:, :-1], moments[:, -1:]
    return float((_off_line(ahead) + _off_line(whole - ahead)).min())


def _off_line(moments: Array) -> Array:
    """Squared distances (M,), m², of points to their nearest line, by their moments (6, M)."""
    n, x, y, xx, yy, xy = moments
    xx, yy, xy = xx - x * x / n, yy - y * y / n, xy - x * y / n
    off: Array = np.maximum((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy), 0.0)
    return off
