"""The multigraph that is reduced: chains of Voronoi points between ends and forks."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from gvgbot.autonomy.gvg.voronoi import FineGraph
from gvgbot.geometry import Array

_WIDE_M = 4.0  # from the walls
_INTO_CORNER = 0.55  # of a metre, by which clearance falls in one: by 0.71 in a right corner


@dataclass(slots=True, eq=False)
class Chain:
    """Points (N, 2), m, from node a to node b, and their clearance (N,)."""

    a: int
    b: int
    points: Array
    clearance: Array
    known_length: float | None = None  # of these points, if it has been asked for

    def length(self) -> float:
        """Metres from end to end."""
        if self.known_length is None:
            self.known_length = float(steps_of(self.points).sum())
        return self.known_length

    def towards(self, *, forward: bool) -> "Chain":
        """The same from node a to node b if `forward`, else the other way."""
        if forward:
            return self
        return Chain(self.b, self.a, self.points[::-1], self.clearance[::-1], self.length())


@dataclass(slots=True, eq=False)
class Draft:
    """A multigraph under reduction: nodes, chains by id, and the chain ends at each node."""

    position: dict[int, Array]
    clearance: dict[int, float]
    lead: dict[int, float | None]
    chains: dict[int, Chain] = field(default_factory=dict)
    ends: dict[int, list[tuple[int, bool]]] = field(default_factory=dict)  # (chain, leaves its a)
    beyond: dict[int, float] = field(default_factory=dict)  # m, from where leaves were dropped
    serial: int = 0

    def add(self, chain: Chain) -> None:
        """Put a chain between its two nodes."""
        key, self.serial = self.serial, self.serial + 1
        self.chains[key] = chain
        self.ends.setdefault(chain.a, []).append((key, True))
        self.ends.setdefault(chain.b, []).append((key, False))

    def remove(self, key: int) -> Chain:
        """Take a chain out; its nodes stay."""
        chain = self.chains.pop(key)
        self.ends[chain.a].remove((key, True))
        self.ends[chain.b].remove((key, False))
        return chain

    def drop_leaf(self, leaf: int, key: int, base: int) -> None:
        """Take out a leaf and its chain to a base, which is as deep as what forked beyond it.

        What forks in a corner does not: there is something small in it.
        """
        length, deep = self.chains[key].length(), self.depth(base)
        is_corner = self.clearance[base] - self.clearance[leaf] > _INTO_CORNER * length
        if leaf in self.beyond and not is_corner:
            deep = max(deep, length + self.depth(leaf))
        self.beyond[base] = deep
        self.remove(key)
        del self.ends[leaf]

    def degree(self, node: int) -> int:
        """The number of chain ends at a node, with the way on into the unseen."""
        return len(self.ends[node]) + self.open(node)

    def open(self, node: int) -> bool:
        """Whether the diagram goes on from a node into space not yet seen."""
        return self.lead[node] is not None

    def reach(self, leaf: int) -> tuple[float, int, int]:
        """Reach of the branch that ends at a leaf, its base and its chain."""
        key, out = self.ends[leaf][0]
        chain = self.chains[key]
        base = chain.b if out else chain.a
        return self.reach_along(key, forward=not out), base, key

    def reach_along(self, key: int, *, forward: bool) -> float:
        """Reach of a chain from its node a to its node b if `forward`, else the other way."""
        chain, within = self.chains[key].towards(forward=forward), 0.0
        room = self.clearance[chain.a]
        if room > _WIDE_M:
            within, room = _out_of_the_wide(chain.points, chain.clearance)
        return (chain.length() - within + self.depth(chain.b)) / room

    def depth(self, tip: int) -> float:
        """Metres from a tip to the walls beyond it, past dropped forks, but into no corner."""
        return max(self.clearance[tip], self.beyond.get(tip, 0.0))

    def splice(self, node: int) -> None:
        """Make one chain of the two that meet at a node."""
        (first, out_a), (second, out_b) = self.ends[node]
        if first == second:
            return
        one = self.remove(first).towards(forward=not out_a)
        two = self.remove(second).towards(forward=out_b)
        points = np.concatenate([one.points, two.points[1:]])
        clearance = np.concatenate([one.clearance, two.clearance[1:]])
        del self.ends[node]
        self.add(Chain(one.a, two.b, points, clearance))


def _out_of_the_wide(points: Array, clearance: Array) -> tuple[float, float]:
    """After how many metres points (N, 2) come out of a wide space, and their clearance there.

    At their beginning, if they do not.
    """
    narrow = (clearance <= _WIDE_M).nonzero()[0]
    if not len(narrow) or narrow[0] == 0:
        return 0.0, float(clearance[0])
    last = narrow[0]
    before, after = clearance[last - 1], clearance[last]
    steps = steps_of(points[: last + 1])
    return float(steps.sum() - steps[-1] * (_WIDE_M - after) / (before - after)), _WIDE_M


def contracted(fine: FineGraph) -> Draft:
    """Chains of points with two neighbours become one edge each."""
    own, other = fine.ridges.ravel(), fine.ridges[:, ::-1].ravel()
    is_key = (np.bincount(own, minlength=len(fine.points)) != 2) | ~np.isnan(fine.lead)
    if len(is_key) and not is_key.any():
        is_key[0] = True  # a ring without a vertex
    keys = is_key.nonzero()[0].tolist()
    draft = Draft(
        {i: fine.points[i] for i in keys},
        {i: float(fine.clearance[i]) for i in keys},
        {i: None if math.isnan(angle := float(fine.lead[i])) else angle for i in keys},
        ends={i: [] for i in keys},
    )
    leaving = is_key[own].nonzero()[0]
    leaving = leaving.take(own.take(leaving).argsort(kind="stable"))
    stops, both = is_key.tolist(), np.bincount(own, other, len(is_key)).astype(int).tolist()
    walked: set[tuple[int, int]] = set()
    paths: list[list[int]] = []
    for key, second in zip(own.take(leaving).tolist(), other.take(leaving).tolist(), strict=True):
        if (key, second) not in walked:
            path = _walk(both, stops, key, second)
            walked.add((path[-1], path[-2]))
            walked.add((key, second))
            paths.append(path)
    for chain in _chains(fine, paths):
        draft.add(chain)
    return draft


def _chains(fine: FineGraph, paths: list[list[int]]) -> Iterator[Chain]:
    """The chains along paths of points, which lie one after another in the same arrays."""
    on = np.array([point for path in paths for point in path], np.intp)
    if not paths:
        return
    points, clearance = fine.points.take(on, axis=0), fine.clearance.take(on)
    ends = list(accumulate(map(len, paths), initial=0))
    steps = steps_of(points)
    steps[[end - 1 for end in ends[1:-1]]] = 0.0  # from chain to chain
    lengths = np.add.reduceat(steps, ends[:-1]).tolist()
    for path, (start, stop), length in zip(paths, pairwise(ends), lengths, strict=True):
        yield Chain(path[0], path[-1], points[start:stop], clearance[start:stop], length)


def _walk(both: list[int], stops: list[bool], start: int, second: int) -> list[int]:
    """The points from one that is a stop to the next.

    `both` is the sum of a point's neighbours: where it has two, each of them tells the other one.
    """
    before, here, path = start, second, [start, second]
    while not stops[here]:
        before, here = here, both[here] - before
        path.append(here)
    return path


def steps_of(line: Array) -> Array:
    """Metres (N - 1,) from point to point of a polyline (N, 2)."""
    way = line[1:] - line[:-1]
    return np.hypot(way[:, 0], way[:, 1])
