"""The local GVG: meetpoints, ends and edges in sight, in the local frame."""

import heapq
import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gvgbot.autonomy.virtual_walls import nearest_before
from gvgbot.geometry import Array

_WIDE_M = 4.0  # a disc with such a radius holds other meetpoints
_LEAST_M, _IN_WIDE_M = 0.5, 1.0  # from a node, where the direction of a branch is taken
_NO_WALLS = np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class LocalEdge:
    """A stretch of GVG between two nodes: polyline (N, 2) from node a to node b, clearance (N,)."""

    a: int
    b: int
    polyline: Array
    clearance: Array
    stations: Array  # metres along the polyline (N,)

    @property
    def length(self) -> float:
        """Metres from end to end."""
        return float(self.stations[-1])

    def clearance_at(self, station: float) -> float:
        """Clearance so many metres along the edge."""
        return float(np.interp(station, self.stations, self.clearance))

    def cut_far_from(self, point: Array) -> "LocalEdge":
        """The same ring, begun half way round from where it is nearest to a point (2,)."""
        nearest = int(np.hypot(*(self.polyline - point).T).argmin())
        opposite = (self.stations[nearest] + self.length / 2) % self.length
        at = int(np.abs(self.stations[:-1] - opposite).argmin())
        line, clearance, steps = (
            np.roll(values, -at, axis=0)
            for values in (self.polyline[:-1], self.clearance[:-1], np.diff(self.stations))
        )
        return LocalEdge(
            self.a,
            self.b,
            np.concatenate([line, line[:1]]),
            np.concatenate([clearance, clearance[:1]]),
            np.concatenate([[0.0], steps.cumsum()]),
        )


class Branch(NamedTuple):
    """One end of an edge: leaving node `a` of the edge if `forward`, else its node `b`."""

    edge: int
    forward: bool


@dataclass(frozen=True, slots=True, eq=False)
class LocalNode:
    """A point where edges meet or stop.

    `lead` = direction (rad) in which the diagram goes on from here into space not yet seen. `weak`
    = branches too short to be told from a corner as long as they are not wholly seen; they do not
    count towards `degree`.
    """

    position: Array
    clearance: float
    lead: float | None
    branches: tuple[Branch, ...]
    weak: frozenset[Branch]

    @property
    def degree(self) -> int:
        """Number of departures that are certain."""
        return len(self.branches) - len(self.weak)

    @property
    def settled(self) -> bool:
        """Whether nothing unseen could change the departures."""
        return self.lead is None and not self.weak

    @property
    def is_meetpoint(self) -> bool:
        """Whether three or more certain edges leave here."""
        return self.degree >= 3

    @property
    def is_suspect(self) -> bool:
        """Whether this may be a meetpoint, by edges of which too little is seen to be certain."""
        return self.degree < 3 <= len(self.branches) + (self.lead is not None)

    @property
    def may_be_vertex(self) -> bool:
        """Whether this is a vertex, or may prove to be one on a closer look."""
        return self.is_meetpoint or self.is_suspect or self.is_endpoint

    @property
    def is_endpoint(self) -> bool:
        """Whether the edge certainly stops here."""
        return self.settled and len(self.branches) == 1


class Place(NamedTuple):
    """A point of the local GVG: metres `station` along `edge`, `distance` m from the query."""

    edge: int
    station: float
    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class LocalGvg:
    """Nodes by id and edges by id; ids mean nothing beyond this one graph."""

    nodes: dict[int, LocalNode] = field(default_factory=dict)
    edges: dict[int, LocalEdge] = field(default_factory=dict)
    # as far as they have been asked for
    _bearings: dict[tuple[Branch, float], float] = field(default_factory=dict, init=False)

    def place(self, point: Array, virtual_walls: Array = _NO_WALLS) -> Place | None:
        """The point of the graph nearest to a point (2,), before virtual walls (N, 2).

        None on an empty graph, or where all of it is beyond these.
        """
        if not self.edges:
            return None
        lines = np.concatenate([edge.polyline for edge in self.edges.values()])
        away = np.hypot(lines[:, 0] - point[0], lines[:, 1] - point[1])
        nearest = nearest_before(virtual_walls, point, lines, away)
        if nearest is None:
            return None
        at, edges = nearest, iter(self.edges.items())
        key, edge = next(edges)
        while at >= len(edge.stations):
            at -= len(edge.stations)
            key, edge = next(edges)
        return Place(key, float(edge.stations[at]), float(away[nearest]))

    def places(self, point: Array, virtual_walls: Array = _NO_WALLS) -> list[Place]:
        """The point of each edge that is nearest to a point (2,), before virtual walls (N, 2)."""
        found = []
        for key, edge in self.edges.items():
            d = np.hypot(edge.polyline[:, 0] - point[0], edge.polyline[:, 1] - point[1])
            i = nearest_before(virtual_walls, point, edge.polyline, d)
            if i is not None:
                found.append(Place(key, float(edge.stations[i]), float(d[i])))
        return found

    def point(self, place: Place) -> Array:
        """The point (2,) that a place is."""
        edge = self.edges[place.edge]
        return np.asarray(edge.polyline[int(np.abs(edge.stations - place.station).argmin())])

    def is_meetpoint_near(self, point: Array, within_m: float) -> bool:
        """Whether what may be a meetpoint is so near to a point (2,)."""
        return any(
            node.degree > 2 and math.dist(node.position, point) < within_m
            for node in self.nodes.values()
        )

    def may_divide(self, place: Place) -> bool:
        """Whether the edge of a place has a point between its ends."""
        return len(self.edges[place.edge].stations) > 2

    def divided(self, place: Place) -> "tuple[LocalGvg, int]":
        """The same graph with one more node, of degree 2, at a place that `may_divide` its edge."""
        old, node = self.edges[place.edge], max(self.nodes) + 1
        at = int(np.clip(np.abs(old.stations - place.station).argmin(), 1, len(old.stations) - 2))
        to_it, onwards = max(self.edges) + 1, max(self.edges) + 2
        line, clearance, stations = old.polyline, old.clearance, old.stations
        edges = {key: edge for key, edge in self.edges.items() if key != place.edge} | {
            to_it: LocalEdge(old.a, node, line[: at + 1], clearance[: at + 1], stations[: at + 1]),
            onwards: LocalEdge(
                node, old.b, line[at:], clearance[at:], stations[at:] - stations[at]
            ),
        }
        renamed = {Branch(place.edge, True): Branch(to_it, True)}
        renamed[Branch(place.edge, False)] = Branch(onwards, False)
        nodes = dict(self.nodes)
        for end in {old.a, old.b}:
            branches = tuple(renamed.get(b, b) for b in nodes[end].branches)
            weak = frozenset(renamed.get(b, b) for b in nodes[end].weak)
            nodes[end] = replace(nodes[end], branches=branches, weak=weak)
        ways = (Branch(to_it, False), Branch(onwards, True))
        nodes[node] = LocalNode(line[at], float(clearance[at]), None, ways, frozenset())
        return LocalGvg(nodes, edges), node

    def rings_cut_far_from(self, point: Array) -> "LocalGvg":
        """The same graph, each edge without an end cut on the far side of its ring from a point.

        Its node means nothing, so it is put where nobody takes it for the end of a way.
        """
        nodes, edges = dict(self.nodes), dict(self.edges)
        for key, edge in self.edges.items():
            if edge.a == edge.b and self.nodes[edge.a].settled and self.nodes[edge.a].degree == 2:
                edges[key] = cut = edge.cut_far_from(point)
                nodes[edge.a] = replace(
                    nodes[edge.a], position=cut.polyline[0], clearance=float(cut.clearance[0])
                )
        return LocalGvg(nodes, edges)

    def leaving(self, branch: Branch) -> Array:
        """Polyline (N, 2) along a branch, from its node outwards."""
        line = self.edges[branch.edge].polyline
        return line if branch.forward else line[::-1]

    def end_of(self, branch: Branch) -> int:
        """The node where a branch arrives."""
        edge = self.edges[branch.edge]
        return edge.b if branch.forward else edge.a

    def bearing(self, branch: Branch, clearance: float) -> float:
        """Direction of a branch as it leaves its node's disc, rad in the local frame.

        A point at which nothing certain branches off is no end of it. In a wide disc it is taken so
        near that no other meetpoint lies between: what is seen of one makes no difference.
        """
        asked = branch, clearance
        if asked not in self._bearings:
            self._bearings[asked] = self._bearing(branch, clearance)
        return self._bearings[asked]

    def _bearing(self, branch: Branch, clearance: float) -> float:
        line = self.leaving(branch)
        wanted = max(_LEAST_M, 0.9 * clearance) if clearance < _WIDE_M else _IN_WIDE_M
        passed = {branch.edge}
        while True:
            z = line.view(np.complex128)[:, 0]
            off = z - z[0]
            away = np.abs(off)
            at = int((away >= wanted).argmax())
            onwards = None if away[at] >= wanted else self.onwards(branch)
            if onwards is None or onwards.edge in passed:
                break
            branch = onwards
            passed.add(branch.edge)
            line = np.concatenate([line, self.leaving(branch)])
        if away[at] < wanted:
            at = int(away.argmax())
        return float(np.angle(off[at]))

    def onwards(self, branch: Branch) -> Branch | None:
        """The one certain way on where a branch arrives; None at a meetpoint or an end."""
        node = self.nodes[self.end_of(branch)]
        arrived = Branch(branch.edge, not branch.forward)
        ways = [b for b in node.branches if b not in node.weak and b != arrived]
        return ways[0] if node.degree == 2 and len(ways) == 1 else None

    def routes(self, start: Place) -> dict[int, tuple[float, tuple[Branch, ...]]]:
        """Shortest way from a place to every node: metres, and the branches that are driven.

        The first branch is the rest of the edge on which the place lies.
        """
        edge = self.edges[start.edge]
        queue: list[tuple[float, int, tuple[Branch, ...]]] = [
            (start.station, edge.a, (Branch(start.edge, forward=False),)),
            (edge.length - start.station, edge.b, (Branch(start.edge, forward=True),)),
        ]
        heapq.heapify(queue)
        done: dict[int, tuple[float, tuple[Branch, ...]]] = {}
        while queue:
            metres, node, path = heapq.heappop(queue)
            if node in done:
                continue
            done[node] = (metres, path)
            for branch in self.nodes[node].branches:
                far = self.end_of(branch)
                if far not in done:
                    heapq.heappush(
                        queue, (metres + self.edges[branch.edge].length, far, (*path, branch))
                    )
        return done

    def line_from(self, start: Place, path: tuple[Branch, ...]) -> tuple[Array, Array]:
        """Polyline (N, 2) and clearance (N,) from a place along a path of `routes`."""
        lines, clear = [], []
        for i, branch in enumerate(path):
            edge = self.edges[branch.edge]
            line, room = edge.polyline, edge.clearance
            if i == 0:
                ahead = (
                    edge.stations >= start.station
                    if branch.forward
                    else edge.stations <= start.station
                )
                line, room = line[ahead], room[ahead]
            lines.append(line if branch.forward else line[::-1])
            clear.append(room if branch.forward else room[::-1])
        return np.concatenate(lines), np.concatenate(clear)
