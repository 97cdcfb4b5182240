"""Tours of a regular town by odometry: which crossings are known again, rightly or wrongly.

    python -m benchmarks.doubts [--noises 0.5 0.7 1.0 ...] [--seeds N] [--margin 10]

Robots drive the tours of the paper's experiments, half of them with another first turn, and know
crossings by the project's filter and likelihoods alone; walls are taken to fit wherever the streets
do. The truth drives, so that a wrong closure spoils the belief, not the way. Noise multiplies
`odometry_noise`, and errors are drawn with it. A margin far below nought takes whatever is the only
vertex in the gate.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.figures.tours import (
    BLOCK_M,
    NORTH,
    SEEN_M,
    SEEN_RAD,
    SIDE,
    WAYS,
    WEST,
    Crossing,
    Tour,
)
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.doubts import (
    NEW_PER_M2,
    SAME,
    Doubt,
    Doubts,
    habit_density,
    match_cost,
    novelty_cost,
    room_for_new,
)
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.geometry import Array, Pose

REACH_M = BLOCK_M / 2
COMPARED, MOST_RIVALS = 12, 4
CONFIG = RecognitionConfig()
RIVAL_MARGIN = MappingConfig().margin


def streets(place: Crossing) -> frozenset[int]:
    """The directions in which streets leave a crossing."""
    x, y = place
    ends = {way: (x + dx, y + dy) for way, (dx, dy) in WAYS.items()}
    return frozenset(way for way, end in ends.items() if all(0 <= k < SIDE for k in end))


class Doubting(Tour):
    """A tour whose crossings nobody tells; `tally` counts what was made of them."""

    def __init__(self, noise: float, seed: int, came_from: int, margin: float) -> None:
        self.margin = margin
        self.place: dict[int, Crossing] = {}  # the truth of each vertex
        self.tally = Counter[str]()
        self.doubts = Doubts()
        self.edges: list[tuple[int, int]] = []
        self.last: int | None = None
        self.count = 0  # vertices so far
        super().__init__(noise, seed, came_from)

    def _arrive(self, here: Crossing) -> None:
        self.sigmas.append(self.sigma)
        if here not in self.open:
            self.ids[here], self.open[here] = len(self.ids) + 1, set(streets(here))
        if len(streets(here)) == 2:
            return  # a bend is no vertex
        exact = self.true.to(Pose(BLOCK_M * here[0], BLOCK_M * here[1]))
        x, y, theta = self.rng.normal((exact.x, exact.y, exact.theta), (SEEN_M, SEEN_M, SEEN_RAD))
        R = np.diag([SEEN_M**2, SEEN_M**2, SEEN_RAD**2])
        vertex, doubt = self._recognised(here, np.array([x, y]), R[:2, :2])
        if vertex is not None:
            self.tally[f"closed {'right' if self.place[vertex] == here else 'WRONG'}"] += 1
            self.belief = ekf.update_in_place(self.belief, vertex, Pose(x, y, theta), R[:2, :2])
        else:
            vertex = self._add(here, Pose(x, y, theta), R, doubt)
        if self.last is not None and self.last != vertex:
            self.edges.append((self.last, vertex))
        self.last = vertex
        while self._settle():
            pass

    def _recognised(
        self,
        here: Crossing,
        seen: Array,
        R: Array,
    ) -> tuple[int | None, Doubt]:
        """The vertex that a crossing is, and if none is certain what it may be."""
        nothing = Doubt(0, (), NEW_PER_M2)
        if not self.belief.ids:
            return None, nothing
        r, S = ekf.offsets(self.belief, seen, R)
        d2, metres = ekf.distances(self.belief, seen, R)
        alike = np.array([streets(self.place[v]) == streets(here) for v in self.belief.ids])
        near = (d2 < CONFIG.gate) | (metres < CONFIG.same_place_m)
        found = sorted(np.flatnonzero(alike & near), key=lambda i: (d2[i], i))
        if not found:
            return None, nothing
        first = found[0]
        if metres[first] < CONFIG.same_place_m and np.trace(S[first]) < CONFIG.same_place_m**2:
            return self.belief.ids[first], nothing
        elsewhere = alike[d2 > CONFIG.gate][:COMPARED]
        density = NEW_PER_M2 * (1 + int(elsewhere.sum())) / (2 + len(elsewhere))
        novelty = novelty_cost(density, room_for_new(r, S, np.full(len(r), REACH_M)))
        cost = {self.belief.ids[i]: match_cost(r[i], S[i]) for i in found}
        is_alone = len(found) == 1 or d2[found[1]] > d2[first] + RIVAL_MARGIN
        if is_alone and cost[self.belief.ids[first]] < novelty - self.margin:
            return self.belief.ids[first], nothing
        rivals = tuple(sorted(cost, key=lambda vertex: cost[vertex]))[:MOST_RIVALS]
        return None, Doubt(0, rivals, density)

    def _add(self, here: Crossing, seen: Pose, R: Array, doubt: Doubt) -> int:
        is_known, vertex = here in self.place.values(), self.count + 1
        self.count = vertex
        what = "doubted" if doubt.rivals else ("ADDED TWICE" if is_known else "added")
        self.tally[f"{'known' if is_known else 'new'} {what}"] += 1
        self.belief = ekf.add_vertex(self.belief, vertex, seen, R)
        self.place[vertex] = here
        self.doubts.note(Doubt(vertex, doubt.rivals, doubt.density))
        return vertex

    def _settle(self) -> bool:
        """Whether something became certain."""
        doubted = {doubt.vertex for doubt in self.doubts.recent}
        self.doubts.recent = [
            Doubt(d.vertex, d.rivals, d.density, self._habit(d.vertex, doubted))
            for d in self.doubts.recent
        ]
        reach = dict.fromkeys(self.belief.ids, REACH_M)
        verdict = self.doubts.weigh(self.belief, reach, self.margin)
        if verdict is None:
            return False
        here = self.place[verdict.vertex]
        if verdict.known is None:
            is_right = here not in (self.place[v] for v in self.place if v < verdict.vertex)
            self.doubts.believe(verdict.vertex)
        else:
            is_right = self.place[verdict.known] == here
            self._unite(verdict.known, verdict.vertex)
        what = "new" if verdict.known is None else "known"
        self.tally[f"settled as {what}, {'right' if is_right else 'WRONG'}"] += 1
        return True

    def _habit(self, vertex: int, doubted: set[int]) -> float:
        def way(a: int, b: int) -> Array:
            return self.belief.map_vertex(b).position - self.belief.map_vertex(a).position

        plain = [edge for edge in self.edges if not doubted & set(edge)]
        ways = np.array([way(a, b) for a, b in [*plain, *((b, a) for a, b in plain)]])
        own = [way(a, b) if b == vertex else way(b, a) for a, b in self.edges if vertex in (a, b)]
        return max((habit_density(w, ways.reshape(-1, 2)) for w in own), default=0.0)

    def _unite(self, kept: int, gone: int) -> None:
        self.belief = ekf.unite(self.belief, kept, gone, SAME)
        del self.place[gone]
        renamed = [tuple(kept if v == gone else v for v in edge) for edge in self.edges]
        self.edges = [(a, b) for a, b in dict.fromkeys(renamed) if a != b]
        self.last = kept if self.last == gone else self.last
        self.doubts.forget(gone)


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive and print a line for each noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--noises", nargs="+", type=float, default=[0.5, 0.7, 1.0, 1.5])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--margin", type=float, default=MappingConfig().novelty_margin)
    options = parser.parse_args(arguments)
    for noise in options.noises:
        tours = [
            Doubting(noise, seed, came_from, options.margin)
            for seed in range(options.seeds)
            for came_from in (NORTH, WEST)
        ]
        for tour in tours:
            tour.drive()
        spoilt = sum(any("WRONG" in what for what in tour.tally) for tour in tours)
        total = sum((tour.tally for tour in tours), Counter[str]())
        said = ", ".join(f"{what} {count}" for what, count in sorted(total.items()))
        sigma = np.mean([max(tour.sigmas) for tour in tours])
        print(
            f"noise {noise:g}: sigma up to {sigma:.1f} m, {spoilt} of {len(tours)} tours wrong "
            f"somewhere: {said}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
