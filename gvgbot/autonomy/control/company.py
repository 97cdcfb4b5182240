"""Driving among other robots: never nearer than both need to stop, and out of each other's way."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from gvgbot.autonomy.gvg.local import Branch, LocalGvg, Place
from gvgbot.autonomy.on_bodies import Disc
from gvgbot.geometry import Array, Pose, Twist, length_of, stations_of
from gvgbot.hal.sweep import free_distance

_KEPT_M = 0.12  # between two bodies, always,
_BLUR_M = 0.09  # and so much more where there is room
_AT_LEAST_M, _SLACK_M = 0.13, 0.01  # where there is less, and by which it may become less
_ROOM_FOR_BOTH_M = 0.3  # between two robots, before either has to be slow
_BOTH_BRAKE_MPS2 = 0.5  # of each, so that two that come towards each other stop
_CREEP_MPS = 0.02  # slower than this is a stop
_FACING_M = 1.6  # from middle to middle: who is as near may be held up by the other
_SOONER, _LATER = 0.3, 2.0  # shares of the usual patience
_ABREAST_M = 0.75  # from a wall on either side: with less, two cannot pass each other
_ONE_WAY_M = 0.5  # from middle to middle: courses so near to each other lead over one place
_OVER = 4  # points of a line, to either side, tell its direction
_EQUAL_M = 1.0  # who is nearer by less than this is not nearer for sure
_CLEAR_OF_IT_M = 0.6  # before a narrow place, there is room to come out of it
_NEAR_M = 4.0  # so far a robot goes that waits, to be in nobody's way
_ASTRAY_M = 0.05  # a way that leads away from a robot may come so much nearer to it
_ASIDE_M = 0.5  # beyond the disc of a vertex, another robot can pass it


@dataclass(frozen=True, slots=True, eq=False)
class Companion:
    """Another robot: where it is, and what it drives along (N, 2), m; both in one frame.

    `radius` is that of its body, m. Of one that `is_silent` nothing has been heard for long: it had
    finished there.
    """

    name: str
    pose: Pose
    goes_first: bool  # by a rule that both know
    course: Array = field(default_factory=lambda: np.empty((0, 2)))
    radius: float = field(kw_only=True)
    is_silent: bool = field(default=False, kw_only=True)


@dataclass(frozen=True, slots=True, eq=False)
class BodiesSeen:
    """A look around: its stamp, s, where the robot was, and round bodies that it saw.

    `bodies` (N, 3) are centres, m, in the map frame as believed then, and radii, m.
    """

    stamp: float
    map_base: Pose
    bodies: Array


def moved(companion: Companion, pose: Pose) -> Companion:
    """The companion in the frame in which its frame has this pose."""
    course = pose.transform(companion.course)
    return replace(companion, pose=pose.compose(companion.pose), course=course)


def careful(twist: Twist, discs: list[Disc], radius: float, least_speed: float) -> Twist:
    """The twist, slow enough to stop with room for whoever is ahead and comes as fast.

    `discs` are others by centre (2,), base frame, and radius, m. With room beside them it is not
    slower than `least_speed`, m/s; what leads closer to them than is safe is a stop.
    """
    if twist.linear <= 0.0 or not discs:
        return twist
    limit = min(_safe_speed(twist, centre, radius + r, least_speed) for centre, r in discs)
    if limit < _CREEP_MPS:
        return Twist(0.0, twist.angular)
    if twist.linear <= limit:
        return twist
    return Twist(limit, twist.angular * limit / twist.linear)


def _safe_speed(twist: Twist, centre: Array, touch: float, least_speed: float) -> float:
    """The speed at which the robot may pass one disc, whose middle it would touch at `touch` m."""
    x, y = centre[:1], centre[1:]
    if x[0] <= 0.0:
        return math.inf
    away = float(np.hypot(*centre))
    wanted = touch + _KEPT_M + _BLUR_M
    if away < wanted:  # it may pass, but hardly come nearer than it is
        wanted = max(touch + _AT_LEAST_M, away - _SLACK_M)
    free = free_distance((x, y), twist, radius=wanted, margin=0.0)
    gap = away - touch - _ROOM_FOR_BOTH_M
    slow = max(math.sqrt(_BOTH_BRAKE_MPS2 * max(0.0, gap)), least_speed)
    return min(slow, math.sqrt(_BOTH_BRAKE_MPS2 * free))


def free_metres(line: Array, from_walls: Array, company: list[Companion]) -> float:
    """How far to drive along a line (N, 2) before one has to wait for somebody to come through.

    `from_walls` (N,) is how far its points are from walls. Where that is little, one robot at a
    time drives: who is nearer, and of two that are equally near, who goes first anyway.
    """
    stations = stations_of(line)
    ends = (_end_of_way(line, stations, from_walls, one) for one in company)
    return min(ends, default=math.inf)


def _end_of_way(line: Array, stations: Array, from_walls: Array, other: Companion) -> float:
    course = other.course
    if len(line) < 2 or len(course) < 2:
        return math.inf
    away = np.hypot(*(line[:, None] - course[None]).transpose(2, 0, 1))
    nearest = away.argmin(axis=1)
    opposed = (_directions(line) * np.gradient(course, axis=0)[nearest]).sum(axis=1) < 0.0
    shared = opposed & (from_walls < _ABREAST_M) & (away.min(axis=1) < _ONE_WAY_M)
    if not shared.any():
        return math.inf
    mine = float(stations[shared].min())
    theirs = float(stations_of(course)[nearest[shared]].min())
    is_first = theirs < mine if abs(theirs - mine) > _EQUAL_M else other.goes_first
    return max(0.0, mine - _CLEAR_OF_IT_M) if is_first else math.inf


def _directions(line: Array) -> Array:
    """Which way a line (N, 2) leads at its points, over some of them: where it sets out it jitters.

    As vectors (N, 2) of any length.
    """
    ahead = np.minimum(np.arange(len(line)) + _OVER, len(line) - 1)
    behind = np.maximum(np.arange(len(line)) - _OVER, 0)
    directions: Array = line[ahead] - line[behind]
    return directions


def patience(local_base: Pose, company: list[Companion]) -> float:
    """How long to wait for what is in the way, as a share of the usual time.

    Of two that hold each other up, one tries another way soon, and the other one lets it.
    """
    near = [one for one in company if one.pose.distance(local_base) < _FACING_M]
    if not near:
        return 1.0
    return _SOONER if any(one.goes_first for one in near) else _LATER


def in_front(local_base: Pose, company: list[Companion]) -> Companion | None:
    """The nearest other robot, if it is so near that it may wait for this one to go."""
    near = [one for one in company if one.pose.distance(local_base) < _FACING_M]
    return min(near, key=lambda one: one.pose.distance(local_base), default=None)


def refuge(gvg: LocalGvg, place: Place, other: Array) -> tuple[Branch, ...] | None:
    """The way to the nearest side branch in which the robot lets another one (2,) pass.

    None if there is no such way that leads away from it.
    """
    ways = []
    for node, (metres, path) in gvg.routes(place).items():
        if not gvg.nodes[node].is_meetpoint:
            continue
        for branch in gvg.nodes[node].branches:
            if branch == Branch(path[-1].edge, not path[-1].forward):
                continue
            way = (*path, branch)
            is_deep = gvg.edges[branch.edge].length > gvg.nodes[node].clearance + _ASIDE_M
            if is_deep and _leads_away(gvg.line_from(place, way)[0], other):
                ways.append((metres, _straightness(gvg, way), way))
    return min(ways)[2] if ways else None


def way_off(gvg: LocalGvg, place: Place, other: Array) -> tuple[Branch, ...] | None:
    """The longest way that leads away from another robot (2,); None if none does."""
    ways = gvg.routes(place).values()
    away = [way for way in ways if _leads_away(gvg.line_from(place, way[1])[0], other)]
    return max(away, key=lambda way: way[0])[1] if away else None


def _leads_away(line: Array, other: Array) -> bool:
    """Whether a line (N, 2) hardly comes nearer to another robot (2,) than where it begins."""
    away = np.hypot(*(line - other).T)
    return bool(away.min() > away[0] - 2 * _KEPT_M)


def wide_place(gvg: LocalGvg, place: Place, company: list[Companion]) -> tuple[Branch, ...] | None:
    """The way to the nearest place where two can pass each other, for a robot that waits.

    None if this is one, or none is near that nobody stands before.
    """
    if gvg.edges[place.edge].clearance_at(place.station) >= _ABREAST_M:
        return None
    ways = []
    for _, path in gvg.routes(place).values():
        line, room = gvg.line_from(place, path)
        way = line[: 1 + int(np.argmax(room >= _ABREAST_M))]
        metres = length_of(way)
        is_free = not any(_stands_on(way, one) for one in company)
        if room.max() >= _ABREAST_M and metres < _NEAR_M and is_free:
            ways.append((metres, path))
    return min(ways)[1] if ways else None


def _stands_on(line: Array, one: Companion) -> bool:
    """Whether a line (N, 2) leads towards another robot, and not past it."""
    away = np.hypot(*(line - one.pose.position).T)
    return float(away.min()) < min(_ONE_WAY_M, float(away[0]) - _ASTRAY_M)


def _straightness(gvg: LocalGvg, way: tuple[Branch, ...]) -> float:
    """How much a way goes straight on at its last node: 1 for that, 0 for a right angle."""
    arrived = Branch(way[-2].edge, not way[-2].forward)
    clearance = gvg.nodes[gvg.end_of(way[-2])].clearance
    return -math.cos(gvg.bearing(way[-1], clearance) - gvg.bearing(arrived, clearance))
