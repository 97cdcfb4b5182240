"""Round other robots and people: the GVG leads over where they are, for they drive on."""

import math
from collections.abc import Callable

import numpy as np

from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.on_bodies import Disc
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, resampled, stations_of

_PASSES_M = (0.32, 0.22, 0.17)  # between two bodies: the more, the more room there is
_TOO_NEAR_M = 0.14  # between two bodies: one does not pass the other
_TURNS_ASIDE_M = 0.8  # before a body, and as far behind it, it is on its line
_KEEP_RIGHT_RAD = 1.0  # so much farther round, one passes on the right all the same
_WIDENS_RAD = 0.3  # round a body that it is too near to, after which it is far enough
_BEHIND_M = 1.5  # a body
_SPACING_M, _ARC_RAD = 0.1, 0.15


def led_round(
    track: Track,
    bodies: list[Disc],
    view: View,
    radius: float,
    margin: float,
    *,
    is_hidden: bool,
) -> Track:
    """The track led round bodies on it where there is room, by a robot of a radius, m.

    `is_hidden` if a body hides how it goes on at its end: then to where that is to be seen.
    """
    if not bodies:
        return track
    walls = view.obstacles()

    def is_free(way: Array) -> bool:
        room = np.asarray(walls.query(way)[0])
        narrow = room < min(radius + margin, float(room[0]))  # where it stands, it may stand close
        return bool(not narrow.any() and view.local_map.known(way).all())

    line = detour(track.polyline, bodies, radius, is_free)
    line = stepping_off(line, view.local_base.position, bodies, radius, is_free)
    if is_hidden:
        line = peek(line, bodies, radius, is_free)
    if line is track.polyline:
        return track
    return Track.of(line, np.asarray(walls.query(line)[0]))


def stepping_off(
    line: Array, base: Array, bodies: list[Disc], radius: float, is_free: Callable[[Array], bool]
) -> Array:
    """A step (N, 2) from the base (2,) away from a body that is too near to pass; see `detour`.

    The line itself if there is none. Looking ahead on what comes after it, one would not turn.
    """
    for number, (centre, size) in enumerate(bodies):
        away = max(math.dist(base, centre), 1e-6)
        if away >= radius + size + _TOO_NEAR_M:
            continue
        others = bodies[:number] + bodies[number + 1 :]
        for gap in _PASSES_M:
            off = centre + (base - centre) * (radius + size + gap) / away
            step = resampled(np.stack([base, off]), _SPACING_M)
            if len(step) > 1 and is_free(step) and _keeps_off(step, others, radius, line):
                return step
    return line


def detour(
    line: Array, bodies: list[Disc], radius: float, is_free: Callable[[Array], bool]
) -> Array:
    """The line (N, 2), led round all bodies on it that there is a way round, for a robot's radius.

    `is_free` tells whether one can drive along points (M, 2). Who ends beside a body, goes there.
    """
    along = sorted(bodies, key=lambda one: int(np.hypot(*(line - one[0]).T).argmin()))
    for number, (centre, size) in enumerate(along):
        others = along[:number] + along[number + 1 :]
        for gap in _PASSES_M:
            if not _blocks(line, centre, radius + size + _PASSES_M[-1]):
                break
            ways = _ways_round(line, centre, radius + size + gap)
            free = (w for w in ways if is_free(w) and _keeps_off(w, others, radius, line))
            line = next(free, line)
    return line


def peek(line: Array, bodies: list[Disc], radius: float, is_free: Callable[[Array], bool]) -> Array:
    """The line (N, 2), led on beside the body that hides how it goes on; see `detour`.

    Where there is no room beside it, the line is led on towards it as far as that is free.
    """
    end = line[-1]
    centre, size = min(bodies, key=lambda one: math.dist(one[0], end))
    onwards = (centre - end) / max(math.dist(centre, end), 1e-6)
    towards = resampled(np.stack([end, centre, centre + _BEHIND_M * onwards]), _SPACING_M)
    through = np.concatenate([line, towards[1:]])
    for gap in _PASSES_M:
        for way in _ways_round(through, centre, radius + size + gap):
            is_beside = np.hypot(*(way - centre).T) < radius + size + _PASSES_M[0] + _SPACING_M
            passed = np.flatnonzero(is_beside & ((way - centre) @ onwards > 0.0))
            beside = way[: int(passed[0])] if len(passed) else way[:0]
            if len(beside) > 1 and is_free(beside) and _keeps_off(beside, bodies, radius, way[:1]):
                return beside
    before = np.hypot(*(through - centre).T) < radius + size + _PASSES_M[-1]
    count = int(np.argmax(before))
    while count > len(line) and not is_free(through[:count]):
        count -= 1
    return through[:count] if count > len(line) else line


def _blocks(line: Array, centre: Array, reach: float) -> bool:
    away = np.hypot(*(line - centre).T)
    return bool(away.min() < reach <= away[-1])


def _keeps_off(way: Array, bodies: list[Disc], radius: float, line: Array) -> bool:
    """Whether a way blocks no body, or comes no nearer to it than a line (N, 2) does."""
    return not any(
        _blocks(way, centre, min(radius + size + _PASSES_M[-1], _distance(line, centre)))
        for centre, size in bodies
    )


def _distance(line: Array, point: Array) -> float:
    return float(np.hypot(*(line - point).T).min())


def _ways_round(line: Array, centre: Array, reach: float) -> list[Array]:
    """The line led round a disc on either side, the better one first."""
    away = np.hypot(*(line - centre).T)
    inside = np.flatnonzero(away < reach)
    if not len(inside) or inside[-1] == len(line) - 1:
        return []
    stations = stations_of(line)
    first = int(stations.searchsorted(stations[inside[0]] - _TURNS_ASIDE_M))
    last = int(stations.searchsorted(stations[inside[-1]] + _TURNS_ASIDE_M))
    last = min(last, len(line) - 1)
    ways = []
    for turn in (1.0, -1.0):
        swept, arc = _arc(line[first] - centre, line[last] - centre, reach, turn)
        corners = np.concatenate([line[first : first + 1], centre + arc, line[last : last + 1]])
        way = np.concatenate([line[:first], resampled(corners, _SPACING_M), line[last + 1 :]])
        ways.append((swept - _KEEP_RIGHT_RAD * (turn > 0.0), way))
    return [way for _, way in sorted(ways, key=lambda one: one[0])]


def _arc(start: Array, end: Array, reach: float, turn: float) -> tuple[float, Array]:
    """How far round its middle, rad, and points (N, 2) of the arc that is tangent from both ends.

    It is no farther off than its start at first, if that is within reach.
    """
    (x, y), (u, v) = start, end
    d, e = (max(math.hypot(*place), 1e-6) for place in (start, end))
    alpha, beta = math.atan2(y, x), math.atan2(v, u)
    swept = (turn * (beta - alpha)) % math.tau
    before, behind = math.acos(min(1.0, reach / d)), math.acos(min(1.0, reach / e))
    angles = np.arange(0.0, max(0.0, swept - before - behind), _ARC_RAD)
    radii = np.minimum(reach, d + (reach - d) * angles / _WIDENS_RAD) if d < reach else reach
    bearings = alpha + turn * (before + angles)
    return swept, np.stack([radii * np.cos(bearings), radii * np.sin(bearings)], axis=1)
