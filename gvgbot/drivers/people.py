"""People in the simulated world: discs that walk along free ways, stand about and let robots be."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph
from scipy.spatial import KDTree

from gvgbot.drivers.discs import cast_on_discs, disc_offsets
from gvgbot.drivers.world import World
from gvgbot.errors import WorldError
from gvgbot.geometry import Array, Pose, stations_of

RADII = (0.2, 0.25)  # m
SPEEDS = (0.5, 1.2)  # m/s
STANDING = (5.0, 60.0)  # s, at the end of a walk
RESTLESS = 0.4  # of the walks end with another one instead
WAITING = (2.0, 10.0)  # s, in front of a robot, before another way is tried
SHARE_WALKED = (0.2, 1.0)  # of the way to a destination, so that people stand in corridors too
DISTANCE_KEPT = 0.3  # m of air between a person and the robot that is in the way
FAR_FROM_START = 1.5  # m from the robot's start, where people may be at the beginning
DESTINATIONS = 16  # places that people head for
SPACING = 0.1  # m between the nodes of ways
STEP = 0.05  # s

Nodes = NDArray[np.intp]


class Walkways:
    """Where people can walk in the part of a world that holds the robot's start.

    `others` are starts of more robots. Raises WorldError if there is no room.
    """

    def __init__(self, world: World, start: Pose, others: Sequence[Pose] = ()) -> None:
        self.points, self._links = _network(world)
        if len(self.points):
            _, parts = csgraph.connected_components(self._links, directed=False)
            here = np.flatnonzero(parts == parts[KDTree(self.points).query(start.position)[1]])
            self.points, self._links = self.points[here], self._links[here][:, here]
        starts = np.array([pose.position for pose in (start, *others)])
        away, _ = KDTree(starts).query(self.points)
        self.beginnings: Nodes = np.flatnonzero(away >= FAR_FROM_START)
        if len(self.beginnings) == 0:
            raise WorldError(
                f"world {world.name}: no room for people; set twin.people=0 or choose another world"
            )

    def routes_to(self, node: int) -> Nodes:
        """The next node of every node (N,) on its shortest way to this one; negative if none."""
        _, following = csgraph.dijkstra(
            self._links, directed=False, indices=np.array([node]), return_predecessors=True
        )
        return np.asarray(following[0], dtype=np.intp)

    def nearest(self, point: Array) -> int:
        """The node that is nearest to a point (2,)."""
        return int(self._tree.query(point)[1])

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.points)


def _network(world: World) -> tuple[Array, Any]:
    """Points (N, 2) in m where the widest person fits, and the lengths of ways between them."""
    stride = max(1, math.floor(SPACING / world.resolution_m + 1e-9))
    pitch = stride * world.resolution_m
    # Halfway between two nodes a wall may be nearer than at both, but a square's centre is
    # farther from walls than its clearance tells.
    needed = RADII[1] + (pitch - world.resolution_m) / math.sqrt(2)
    open_ = world.clearance[::stride, ::stride] >= needed
    number = np.full(open_.shape, -1)
    number[open_] = np.arange(np.count_nonzero(open_))
    rows, columns = np.nonzero(open_)
    middle = world.resolution_m / 2
    points = np.column_stack((columns, rows)) * np.float64(pitch) + middle + world.origin
    pairs = [_neighbours(number, step) for step in ((0, 1), (1, 0), (1, 1), (1, -1))]
    a, b = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    lengths = np.hypot(*(points[a] - points[b]).T)
    links = sparse.csr_array((lengths, (a, b)), shape=(len(points), len(points)))
    return points, links


def _neighbours(number: Nodes, step: tuple[int, int]) -> tuple[Nodes, Nodes]:
    """Pairs of nodes that lie one step (rows, columns) apart."""
    moved = ndimage.shift(number, (-step[0], -step[1]), order=0, cval=-1)
    both = (number >= 0) & (moved >= 0)
    return number[both], moved[both]


@dataclass(slots=True)
class _Person:
    radius: float
    speed: float
    way: Array  # (K, 2), m
    marks: Array  # (K,), metres along the way to each of its points
    length: float  # m of the way that are walked
    stands_until: float  # s
    along: float = 0.0  # m

    def place(self, along: float) -> Array:
        x, y = (np.interp(along, self.marks, self.way[:, i]) for i in (0, 1))
        return np.array([x, y])


class People:
    """Some people, drawn from a seed, on the move from the time `stamp` on."""

    def __init__(self, walkways: Walkways, count: int, seed: int, stamp: float = 0.0) -> None:
        self._walkways = walkways
        self._rng = np.random.default_rng(seed)
        nodes = self._rng.integers(len(walkways.points), size=DESTINATIONS)
        self._destinations = [int(node) for node in nodes]
        self._routes: dict[int, Nodes] = {}
        begins = walkways.points[self._rng.choice(walkways.beginnings, size=count)]
        self._people = [self._born(begin, stamp) for begin in begins]
        self.centres = begins.copy()  # (N, 2), m in the world
        self.radii = np.array([person.radius for person in self._people])  # (N,), m
        self.next_step = stamp + STEP  # s

    def step(self, robots: Sequence[Pose], robot_radius: float) -> None:
        """Walk on to `next_step`, past robots that are at these poses in the world."""
        for k, person in enumerate(self._people):
            if person.stands_until <= self.next_step:
                self.centres[k] = self._walked(person, self.centres[k], robots, robot_radius)
        self.next_step += STEP

    def stand(self, number: int, x: float, y: float) -> None:
        """Put one of them somewhere, to stand there for good."""
        self._people[number].stands_until = math.inf
        self.centres[number] = (x, y)

    def offsets(self, x: float, y: float, reach: float) -> Array:
        """From (x, y) to the nearest point of each person within `reach`: (M, 2), m."""
        return disc_offsets(self.centres, self.radii, x, y, reach)

    def cast(self, pose: Pose, bearings: Array) -> Array:
        """Ranges (N,) in m to the nearest person along bearings (N,) of a sensor; inf: nobody."""
        return cast_on_discs(self.centres, self.radii, pose, bearings)

    def _born(self, place: Array, stamp: float) -> _Person:
        radius, speed = (float(self._rng.uniform(*limits)) for limits in (RADII, SPEEDS))
        nowhere = place[None], np.zeros(1), 0.0
        return _Person(radius, speed, *nowhere, stamp + float(self._rng.uniform(0, STANDING[0])))

    def _walked(
        self, person: _Person, here: Array, robots: Sequence[Pose], robot_radius: float
    ) -> Array:
        """Where the person is a step later."""
        if person.along >= person.length:
            if person.length and self._rng.random() >= RESTLESS:
                self._stand(person, STANDING)
            self._set_out(person, here)
            return here
        along = min(person.along + person.speed * STEP, person.length)
        there = person.place(along)
        kept = person.radius + robot_radius + DISTANCE_KEPT
        if any(
            math.dist(there, robot.position) < min(kept, math.dist(here, robot.position))
            for robot in robots
        ):
            self._stand(person, WAITING)
            self._set_out(person, here)
            return here
        person.along = along
        return there

    def _stand(self, person: _Person, limits: tuple[float, float]) -> None:
        person.stands_until = self.next_step + float(self._rng.uniform(*limits))

    def _set_out(self, person: _Person, here: Array) -> None:
        """Choose a way to somewhere."""
        person.way = self._way(here, self._destinations[self._rng.integers(DESTINATIONS)])
        person.marks = stations_of(person.way)
        person.length = float(person.marks[-1] * self._rng.uniform(*SHARE_WALKED))
        person.along = 0.0

    def _way(self, here: Array, destination: int) -> Array:
        """Points (K, 2) from a place near the ways to a destination."""
        if destination not in self._routes:
            self._routes[destination] = self._walkways.routes_to(destination)
        points, following = self._walkways.points, self._routes[destination]
        node = self._walkways.nearest(here)
        ahead = points[following[node]] if following[node] >= 0 else points[node]
        if math.dist(here, ahead) < math.dist(points[node], ahead):
            node = int(following[node])  # the nearest one lies behind
        way = [here]
        while node >= 0:
            way.append(points[node])
            node = int(following[node])
        return np.array(way)
