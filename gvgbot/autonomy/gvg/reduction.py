"""From the fine Voronoi graph to the reduced GVG: chains become edges, corner branches go.

A dangling branch from vertex v to tip t has reach (length(v, t) + clearance(t)) / clearance(v). In
a right-angled corner it is 1.41; a dead end worth a visit has more. Reach only grows while more of
a branch is seen, so for a branch that ends in unseen space it is a lower bound. In a wide space it
counts from where the branch is no longer in it: what is worth a visit does not grow with the space.
Where branches beyond a tip have been dropped and forked themselves, its depth, up to their tips and
the walls there, stands for its clearance: a desk in its corner makes a room no less deep.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.gvg.draft import Chain, Draft, contracted
from gvgbot.autonomy.gvg.edges import smooth_edges
from gvgbot.autonomy.gvg.local import Branch, LocalGvg, LocalNode
from gvgbot.autonomy.gvg.voronoi import FineGraph
from gvgbot.geometry import Array
from gvgbot.ranges import Range

_MERGE_HYSTERESIS = 1.3  # by which factor an edge must differ to overrule what the map says of it
_REACH_HYSTERESIS = 1.12
_END_REACH = 1.6  # of a niche that an edge ends in, or a corner of 77 degrees; a right one has 1.41
_SEEN_SHARE = 0.8  # of the laser's range: walls farther off may lack
_CORNER_SHARE = 0.7  # of the map's reach: a corner is sqrt(2) times as far as its walls
_SPECK = 4.0  # so many of the shortest edges around open space are no way round it
_FALL_IN_CORNER = 0.3  # metres of clearance lost per metre, at least, towards a corner
_ENDPOINT_M = 0.6  # a point so near to a known endpoint is that endpoint


@dataclass(frozen=True, slots=True, eq=False)
class KnownVertices:
    """Where the map has vertices (N, 2), local frame, and their degrees (N,).

    What is near a threshold, one meetpoint or two, a corner or a dead end, stays as it was decided
    at first, unless sight says clearly otherwise.
    """

    positions: Array = field(default_factory=lambda: np.empty((0, 2)))
    degrees: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    @property
    def endpoints(self) -> Array:
        """Positions (M, 2) of the endpoints."""
        found: Array = self.positions[self.degrees == 1]
        return found

    def degrees_near(self, point: Array, reach: float) -> list[int]:
        """Degrees of the meetpoints within `reach` m of a point (2,)."""
        near = np.hypot(*(self.positions - point).T) < reach
        found: list[int] = self.degrees[near & (self.degrees > 1)].tolist()
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class ReductionConfig:
    """What is worth being a vertex."""

    min_reach: Annotated[float, Range(1.45, 4.0)] = 1.7  # shorter dangling branches are corners
    merge_m: Annotated[float, Range(0.0, 2.0)] = 0.6  # meetpoints closer than this are one
    roughness_m: Annotated[float, Range(0.0, 0.2)] = (
        0.03  # unevenness of a flat wall, noise included
    )
    open_clearance_m: Annotated[float, Range(1.0, 30.0)] = 8.0  # farther off, follow one wall

    def open_clearance(self, range_m: float, reach_m: float) -> float:
        """How far off one wall is followed, m, by a laser's range and how far the map reaches.

        Where that way turns, the corner of the room must be in the map: as one that comes and goes
        with every metre, it would be taken for a way out.
        """
        return min(self.open_clearance_m, _SEEN_SHARE * range_m, _CORNER_SHARE * reach_m)


def reduce_graph(
    fine: FineGraph, config: ReductionConfig, known: KnownVertices | None = None
) -> LocalGvg:
    """The local GVG of a fine graph."""
    known = known or KnownVertices()
    draft = contracted(fine)
    _prune(draft, config.min_reach, known.endpoints)
    _merge(draft, config.merge_m, known)
    _prune(draft, config.min_reach, known.endpoints)
    _doubt_stumps(draft, config.min_reach)
    return _finish(draft, config.min_reach)


def _prune(draft: Draft, min_reach: float, endpoints: Array) -> None:
    """Drop corner branches in rounds: a dead end keeps the vertex that both its corners hang on.

    Or it goes on into the deepest of them, if that is rather a niche.
    """
    while True:
        doomed: dict[int, list[tuple[int, int]]] = {}  # leaves and their chains, by base
        for node, ends in draft.ends.items():
            if len(ends) == 1 and not draft.open(node):
                reach, base, key = draft.reach(node)
                if draft.degree(base) >= 3 and _is_corner(
                    reach / min_reach, draft.position[node], draft.position[base], endpoints
                ):
                    doomed.setdefault(base, []).append((node, key))
        if not doomed:
            return
        forks = [fork for base in doomed for fork in _forks(draft, base, doomed)]
        least = min((draft.clearance[fork] for fork in forks), default=math.inf)
        ready = [base for base in doomed if draft.clearance[base] <= least]
        for base in ready:
            for node, key in _corners(draft, base, doomed[base], endpoints):
                draft.drop_leaf(node, key, base)
        for base in ready:
            if base in draft.ends and len(draft.ends[base]) == 2 and not draft.open(base):
                draft.splice(base)


def _corners(
    draft: Draft, base: int, doomed: list[tuple[int, int]], endpoints: Array
) -> list[tuple[int, int]]:
    """Those of the doomed leaves of a base that go: not the niche that its only edge ends in."""
    if draft.degree(base) - len(doomed) != 1:
        return doomed
    deepest = max(doomed, key=lambda leaf: draft.reach(leaf[0])[0])
    share = draft.reach(deepest[0])[0] / _END_REACH
    if _is_corner(share, draft.position[deepest[0]], draft.position[base], endpoints):
        return doomed
    return [leaf for leaf in doomed if leaf != deepest]


def _forks(draft: Draft, base: int, doomed: dict[int, list[tuple[int, int]]]) -> Iterator[int]:
    """Where corner branches of a base fork: all their twigs must go before any of its branches do.

    Towards a corner clearance falls by 1 / reach of the way; along a room it hardly does.
    """
    for key, _ in draft.ends[base]:
        chain = draft.chains[key]
        fork = chain.b if chain.a == base else chain.a
        stump = len(draft.ends[fork]) - len(doomed.get(fork, ())) == 1 and not draft.open(fork)
        falls = draft.clearance[base] - draft.clearance[fork]
        if fork in doomed and stump and falls > _FALL_IN_CORNER * chain.length():
            yield fork


def _is_corner(reach: float, tip: Array, base: Array, endpoints: Array) -> bool:
    """Whether a branch is a corner, by its reach in units of the least.

    If that is about one, the map decides: the known endpoint is what is nearer to it.
    """
    if 1 / _REACH_HYSTERESIS < reach < _REACH_HYSTERESIS:
        to_tip, to_base = (
            np.hypot(*(endpoints - end).T).min(initial=_ENDPOINT_M) for end in (tip, base)
        )
        if to_tip != to_base:
            return bool(to_base < to_tip)
    return reach < 1.0


def _doubt_stumps(draft: Draft, min_reach: float) -> None:
    """What is seen of a branch from its tip up to where sight ends may be nothing but a corner."""
    for node, ends in draft.ends.items():
        if len(ends) == 1 and not draft.open(node):
            reach, base, key = draft.reach(node)
            if reach < min_reach and len(draft.ends[base]) == 1:
                chain = draft.chains[key]
                way = chain.points[0] - chain.points[-1]
                inwards = way if chain.a == node else -way
                draft.lead[node] = math.atan2(inwards[1], inwards[0])


def _merge(draft: Draft, merge_m: float, known: KnownVertices) -> None:
    """Make one meetpoint of two that are joined by a very short edge."""
    while True:
        short = [
            (length, key)
            for key, chain in draft.chains.items()
            if chain.a != chain.b
            and min(draft.degree(chain.a), draft.degree(chain.b)) >= 3
            and (length := chain.length()) < merge_m * _known_length(draft, chain, merge_m, known)
        ]
        if not short:
            speck = _speck(draft, _SPECK * merge_m)
            if speck is None:
                return
            _drop(draft, speck)
            continue
        chain = draft.remove(min(short)[1])
        keep, gone = chain.a, chain.b
        centre = (draft.position[keep] + draft.position[gone]) / 2
        draft.position[keep] = centre
        draft.clearance[keep] = min(draft.clearance[keep], draft.clearance[gone])
        if draft.lead[keep] is None:
            draft.lead[keep] = draft.lead[gone]
        for key, out in draft.ends.pop(gone):
            end = draft.chains[key]
            if out:
                end.a = keep
            else:
                end.b = keep
            draft.ends[keep].append((key, out))
        for key, out in draft.ends[keep]:
            _attach(draft.chains[key], centre, at_start=out)


def _speck(draft: Draft, longest: float) -> int | None:
    """The longest chain of a loop of one or two that is too short to go round a wall.

    What goes round a wall at a clearance c is 2 pi c long, at least, or a little less where
    meetpoints have been merged. The coast of a speck of open space is far shorter.
    """
    between: dict[frozenset[int], list[int]] = {}
    for key, chain in draft.chains.items():
        between.setdefault(frozenset((chain.a, chain.b)), []).append(key)
    for ends, keys in between.items():
        if len(keys) < len(ends) or any(draft.degree(end) < 3 for end in ends):
            continue
        loop = sorted(keys, key=lambda key: draft.chains[key].length())[: len(ends)]
        chains = [draft.chains[key] for key in loop]
        shortest = min(longest, *(math.pi * float(chain.clearance.min()) for chain in chains))
        if sum(chain.length() for chain in chains) < shortest:
            return loop[-1]
    return None


def _drop(draft: Draft, key: int) -> None:
    """Take a chain out, and the vertices with it that are none without it."""
    chain = draft.remove(key)
    for end in {chain.a, chain.b}:
        if len(draft.ends[end]) == 2 and not draft.open(end):
            draft.splice(end)


def _known_length(draft: Draft, chain: Chain, merge_m: float, known: KnownVertices) -> float:
    """By what the map stretches the length below which a chain's ends are one meetpoint.

    One known meetpoint around with all the departures of both: they are one. Two: they are not.
    """
    if chain.length() > _MERGE_HYSTERESIS * merge_m:
        return 0.0
    middle = (draft.position[chain.a] + draft.position[chain.b]) / 2
    degrees = known.degrees_near(middle, _MERGE_HYSTERESIS * merge_m)
    if len(degrees) == 1 and degrees[0] >= draft.degree(chain.a) + draft.degree(chain.b) - 2:
        return _MERGE_HYSTERESIS
    return 1.0 if len(degrees) < 2 else 1 / _MERGE_HYSTERESIS


def _attach(chain: Chain, point: Array, *, at_start: bool) -> None:
    """Let a chain begin (or end) at a node that has moved."""
    points, clearance, chain.known_length = chain.points, chain.clearance, None
    if at_start:
        chain.points = np.concatenate([point[None], points])
        chain.clearance = np.concatenate([clearance[:1], clearance])
    else:
        chain.points = np.concatenate([points, point[None]])
        chain.clearance = np.concatenate([clearance, clearance[-1:]])


def _finish(draft: Draft, min_reach: float) -> LocalGvg:
    edges = dict(zip(draft.chains, smooth_edges(list(draft.chains.values())), strict=True))
    nodes = {}
    for node, ends in draft.ends.items():
        branches = tuple(Branch(key, out) for key, out in ends)
        weak = frozenset(b for b in branches if _is_weak(draft, b, node, min_reach))
        nodes[node] = LocalNode(
            draft.position[node], draft.clearance[node], draft.lead[node], branches, weak
        )
    return LocalGvg(nodes, edges)


def _is_weak(draft: Draft, branch: Branch, node: int, min_reach: float) -> bool:
    """Whether a branch ends where sight does, too soon to be told from a corner."""
    chain = draft.chains[branch.edge]
    tip = chain.b if branch.forward else chain.a
    if tip == node or len(draft.ends[tip]) != 1 or not draft.open(tip) or draft.degree(node) < 3:
        return False
    return draft.reach_along(branch.edge, forward=branch.forward) < min_reach
