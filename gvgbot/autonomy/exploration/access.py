"""Access: from a place off the GVG, in a wide space or beside it, onto the nearest edge."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from gvgbot.autonomy.gvg.local import Place
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, resampled

NEAR_M = 1.5  # from an edge, one is as good as on it
_BESIDE_M = 0.15  # farther from its edge than this, the robot goes there first
_TIGHT_M = 0.25  # nearer to a wall, the robot would scrape along it
_BETWEEN_M = 0.1  # from a straight way, a wall is between its ends
_CLIMB_M = 0.05  # steps away from the walls
_AROUND = np.stack([f(np.arange(16) * np.pi / 8) for f in (np.cos, np.sin)], axis=1)
_ROOM_M = 0.35  # from the walls, on the way
_SPACING_M = 0.1
_BEND_M = 0.2  # between places of an edge where a way may bend
_FARTHEST_M = 4.0  # of places to go to where no edge leads, and of bends
_NEAREST_M, _STEP_M = 1.0, 0.5  # of those places
# Their bearings, how far away they are at most, and by how much less room the way may have than
# there is where the robot stands.
_ALL_AROUND, _OUT_OF_A_SLOT = (16, _FARTHEST_M, 0.0), (180, 2.0, 0.03)
_ROOM_ENOUGH_M = 5.0  # from the walls: more says nothing
_SOUGHT_M = 1.5  # so near, one has been


@dataclass(frozen=True, slots=True, eq=False)
class Access:
    """Where on the local GVG the robot is, and the way there.

    Points (N, 2), local frame, and their distances (N,) from the walls, m; none if it is on it.
    """

    place: Place
    line: Array = field(default_factory=lambda: np.empty((0, 2)))
    room: Array = field(default_factory=lambda: np.empty(0))


def access(view: View) -> Access | None:
    """The access to the nearest edge, or to another one if walls are in the way; None without any.

    Beside a wall the robot drives away from it first. With walls before all edges near by it is one
    farther off, and without any the nearest one, straight ahead: the guard stops the robot, and
    what is then tried is the mission's.
    """
    base = view.local_base.position
    nearest = view.gvg.place(base, view.virtual_walls)
    if nearest is None:
        return None
    if not _BESIDE_M < nearest.distance <= NEAR_M:
        return Access(nearest)
    straight = _straight(view, nearest, _ROOM_M)
    if straight is not None and straight.room[0] > _TIGHT_M:
        return straight
    return (
        _uphill(view)
        or straight
        or _between_things(view)
        or _between_walls(view)
        or _farther_off(view)
        or Access(nearest, base[None], np.atleast_1d(view.obstacles().query(base)[0]))
    )


def _places(view: View) -> list[Place]:
    """The nearest point of each edge before virtual walls, the nearest of them first."""
    places = view.gvg.places(view.local_base.position, view.virtual_walls)
    return sorted(places, key=lambda place: place.distance)


def _straight(view: View, place: Place, least_room: float) -> Access | None:
    way = straight_way(view, view.gvg.point(place), least_room)
    return None if way is None else Access(place, *way)


def _uphill(view: View) -> Access | None:
    """To where there is more and more room, until an edge is near: as the method reaches the GVG.

    None if there is most room, but no edge, before that.
    """
    base, tree = view.local_base.position, view.obstacles()
    line = [base]
    rooms = [float(tree.query(base)[0])]
    for _ in range(round(NEAR_M / _CLIMB_M)):
        around = line[-1] + _CLIMB_M * _AROUND
        room = np.asarray(tree.query(around)[0])
        best = int(room.argmax())
        if room[best] <= rooms[-1]:
            return None
        line.append(around[best])
        rooms.append(float(room[best]))
        place = view.gvg.place(line[-1])
        if place is not None and place.distance <= _BESIDE_M:
            away = float(np.hypot(*(view.gvg.point(place) - base)))
            return Access(place._replace(distance=away), np.array(line), np.array(rooms))
    return None


def _between_things(view: View) -> Access | None:
    """To the nearest point of any edge to which a straight way is as wide as where it stands."""
    base = view.local_base.position
    points = [
        Place(key, float(station), float(metres))
        for key, edge in view.gvg.edges.items()
        for station, metres in zip(edge.stations, np.hypot(*(edge.polyline - base).T), strict=True)
        if metres <= NEAR_M
    ]
    points.sort(key=lambda place: place.distance)
    return next(filter(None, (_straight(view, place, _TIGHT_M) for place in points)), None)


def _between_walls(view: View) -> Access | None:
    """To the nearest edge near by to which no wall is in the way."""
    near = (place for place in _places(view) if place.distance <= NEAR_M)
    return next(filter(None, (_straight(view, place, _BETWEEN_M) for place in near)), None)


def _farther_off(view: View) -> Access | None:
    """To an edge that is not near, as all that are near are behind walls."""
    way = way_to_edge(view)
    if way is None:
        return None
    base, goal = view.local_base.position, way[0][-1]
    place = view.gvg.place(goal)
    assert place is not None, "there is an edge"
    return Access(place._replace(distance=math.dist(base, goal)), *way)


def is_tight(view: View) -> bool:
    """Whether walls are so near that the robot would scrape along them, or does."""
    return float(view.obstacles().query(view.local_base.position)[0]) < _TIGHT_M


def way_to_edge(view: View) -> tuple[Array, Array] | None:
    """The straight way to the nearest edge of the local GVG to which there is one.

    The very nearest edge may be behind a wall. Who has come between things gets out again. As
    `straight_way` has it.
    """
    nearest = ((view.gvg.point(place), _ROOM_M) for place in _places(view))
    others = ((goal, _TIGHT_M) for goal in _points_of_edges(view))
    ways = (straight_way(view, goal, room) for goal, room in chain(nearest, others))
    return next((way for way in ways if way is not None), None)


def _points_of_edges(view: View) -> Iterator[Array]:
    """Points (2,) of edges that are not too far away, the nearest first."""
    lines = [resampled(edge.polyline, _BEND_M) for edge in view.gvg.edges.values()]
    points = np.concatenate([np.empty((0, 2)), *lines])
    away = np.hypot(*(points - view.local_base.position).T)
    for i in np.argsort(away, kind="stable"):
        if away[i] < _FARTHEST_M:
            yield points[i]


def way_into_the_open(view: View, sought: list[Array]) -> tuple[Array, Array] | None:
    """The straight way away from the walls, to where most room is known and nobody has been.

    There an edge may come into sight, or a wall. `sought` are the places (2,), local frame, where
    none was. Out of a slot only few directions lead, so all are tried where there is no other way:
    the one with most room on it, to a centimetre. As `straight_way` has it.
    """

    def ways(bearings: int, farthest: float, slack: float) -> Iterator[tuple[Array, Array]]:
        for goal in _open_places(view, bearings, farthest):
            if all(math.dist(goal, place) > _SOUGHT_M for place in sought):
                way = straight_way(view, goal, _ROOM_M, slack)
                if way is not None:
                    yield way

    return next(ways(*_ALL_AROUND), None) or max(
        ways(*_OUT_OF_A_SLOT), key=lambda way: round(float(way[1].min()), 2), default=None
    )


def _open_places(view: View, bearings: int, farthest: float) -> Array:
    """Known places (N, 2), local frame, around the base, those with most room first."""
    base = view.local_base
    angles = base.theta + np.linspace(0.0, math.tau, bearings, endpoint=False)
    metres = np.arange(farthest, _NEAREST_M - _STEP_M / 2, -_STEP_M)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    goals = base.position + (metres[:, None, None] * rays).reshape(-1, 2)
    goals = goals[view.local_map.known(goals)]
    room = np.asarray(view.obstacles().query(goals)[0])
    best_first: Array = goals[np.argsort(-np.minimum(room, _ROOM_ENOUGH_M), kind="stable")]
    return best_first


def straight_way(
    view: View, goal: Array, least_room: float, slack: float = 0.0
) -> tuple[Array, Array] | None:
    """The straight way to a point (2,), local frame; None if it is not known to be free.

    Its points (N, 2), local frame, and their distances (N,) from the walls, m: `least_room`, or as
    much as where it stands, less a `slack`.
    """
    return _straight_from(view, view.local_base.position, goal, least_room, slack)


def bent_way(view: View, goal: Array, least_room: float) -> tuple[Array, Array] | None:
    """The shortest way to a point (2,), local frame, that bends once, on the local GVG; else None.

    As `straight_way` has it. A door that an edge passes at a slant is entered from before it.
    """
    base = view.local_base.position
    lines = [resampled(edge.polyline, _BEND_M) for edge in view.gvg.edges.values()]
    bends = np.concatenate([np.empty((0, 2)), *lines])
    legs = np.array([np.hypot(*(bends - end).T) for end in (base, goal)])
    shortest = np.argsort(legs.sum(axis=0), kind="stable")
    for bend in bends[shortest[legs.max(axis=0)[shortest] < _FARTHEST_M]]:
        onwards = _straight_from(view, bend, goal, least_room)
        way = None if onwards is None else straight_way(view, bend, least_room)
        if way is not None and onwards is not None:
            (line, room), (rest, rooms) = way, onwards
            return np.concatenate([line, rest[1:]]), np.concatenate([room, rooms[1:]])
    return None


def _straight_from(
    view: View, start: Array, goal: Array, least_room: float, slack: float = 0.0
) -> tuple[Array, Array] | None:
    distance = float(np.hypot(*(goal - start)))
    line = np.linspace(start, goal, math.ceil(distance / _SPACING_M) + 1)
    room = np.asarray(view.obstacles().query(line)[0])
    narrow = room < min(least_room, float(room[0]) - slack)  # where it stands, it may stand close
    # Behind a laser at its front, nothing may have been seen of where the robot stands itself.
    beyond = line[np.hypot(*(line - view.local_base.position).T) > view.robot_radius]
    if narrow.any() or not view.local_map.known(beyond).all():
        return None
    return line, room
