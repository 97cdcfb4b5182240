"""How much a stretch of a scan speaks for a leg or a body, and how much for walls and corners.

Two explanations compete for where the beams end: a circle as wide as people, and two straight
lines. What each leaves unexplained, by the noise of the laser, makes a log-likelihood, and those of
several looks add up: they tell together what no single one does.
"""

import math

import numpy as np

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
        step, *_ = np.linalg.lstsq(to_centre / distance[:, None], distance - radius)
        centre = centre + step
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
    about = ends - middle
    equations = np.ones((len(ends), 3))
    equations[:, :2] = 2.0 * about
    (x, y, rest), *_ = np.linalg.lstsq(equations, (about**2).sum(axis=1))
    centre, radius = np.array([x, y]), _possible(math.sqrt(rest + x**2 + y**2))
    away = (middle - eye) / np.hypot(*(middle - eye))
    if centre @ away <= 0.0 or np.hypot(x, y) > radius:
        centre = radius * away
    slopes = np.ones((len(ends), 3))
    for _ in range(_STEPS):
        to_centre = about - centre
        distance = np.hypot(to_centre[:, 0], to_centre[:, 1])
        slopes[:, :2] = to_centre / distance[:, None]
        step, *_ = np.linalg.lstsq(slopes, distance - radius)
        if _possible(radius + step[2]) != radius + step[2]:
            wider = _possible(radius + step[2]) - radius
            moved, *_ = np.linalg.lstsq(slopes[:, :2], distance - radius - wider)
            step = np.array([*moved, wider])
        step /= max(1.0, float(np.hypot(*step[:2])) / radius)
        centre, radius = centre + step[:2], radius + float(step[2])
        if np.abs(step).max() < _NEGLIGIBLE_M:
            break
    return middle + centre, radius


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
