"""Drives over a lattice of streets by the ear rule, with the project's own filter and no walls.

A robot knows its odometry, and at each crossing where that is from the base, within 5 cm; which
crossing it is, the simulation tells it, and takes down what the first tests of recognition would
have said. So a hundred tours take seconds.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from gvgbot.autonomy.slam.ekf import (
    Belief,
    OdometryNoise,
    add_vertex,
    distances,
    predict_in_place,
    update_in_place,
)
from gvgbot.geometry import Array, Pose

BLOCK_M = 10.0  # from crossing to crossing
SIDE = 5  # crossings
STEP_M, SPEED_MPS, TURN_RADPS = 1.0, 0.5, 1.0
SEEN_M, SEEN_RAD = 0.05, 0.05  # how exactly a crossing is seen from where it is
GATE = 9.0  # squared Mahalanobis distance: three sigma
EAST, NORTH, WEST, SOUTH = range(4)
WAYS = {EAST: (1, 0), NORTH: (0, 1), WEST: (-1, 0), SOUTH: (0, -1)}

Crossing = tuple[int, int]


@dataclass(slots=True)
class Arrival:
    """At a crossing: how many known ones are in the gate, without the right one if it is known."""

    is_known: bool
    is_in_gate: bool  # the right one
    others: int
    others_of_degree: int  # with as many streets

    @property
    def is_clear(self) -> bool:
        """Whether the gate alone says which one it is, or that it is new."""
        return self.is_in_gate == self.is_known and not self.others


@dataclass
class Tour:
    """One robot on its way; `noise` multiplies the sigmas of odometry."""

    noise: float
    seed: int
    came_from: int = NORTH  # at the start: from the north it goes round one block after another
    limit: float = math.inf  # m: of the robot's sigma, above which it goes back to what is certain
    independent: bool = False  # as if errors of robot and crossings had nothing in common
    arrivals: list[Arrival] = field(default_factory=list)
    sigmas: list[float] = field(default_factory=list)  # m: of the robot on each arrival

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.true = Pose(0.0, 0.0, math.pi / 2)
        self.belief = Belief(np.array([0.0, 0.0, math.pi / 2]), np.zeros((3, 3)))
        self.ids: dict[Crossing, int] = {}
        self.open: dict[Crossing, set[int]] = {}
        self.model = OdometryNoise()

    def drive(self) -> "Tour":
        """Until no street is left."""
        here, came_from = (0, 0), self.came_from
        self._arrive(here)
        while (way := self._task(here, came_from)) is not None:
            for direction in way:
                here = self._follow(here, direction)
                came_from = (direction + 2) % 4
        return self

    def _task(self, here: Crossing, came_from: int) -> list[int] | None:
        """Where to go: on, or after something new back to the best known crossing."""
        if self.sigma > self.limit and not self.arrivals[-1].is_known:
            best = min(self.ids, key=lambda place: self._variance(self.ids[place]))
            return self._way(here, came_from, lambda place: place == best)
        return self._next(here, came_from)

    def _next(self, here: Crossing, came_from: int) -> list[int] | None:
        """The next street clockwise that is new here, or the way to the nearest one with its."""
        way = self._way(here, came_from, lambda place: bool(self.open[place]))
        if way is None:
            return None
        place, back = here, came_from
        for direction in way:
            place, back = self._beyond(place, direction), (direction + 2) % 4
        clockwise = ((back - turn) % 4 for turn in range(1, 5))
        return [*way, next(d for d in clockwise if d in self.open[place])]

    def _way(
        self, here: Crossing, came_from: int, is_goal: Callable[[Crossing], bool]
    ) -> list[int] | None:
        """The shortest way over known streets to the first crossing that is a goal."""
        queue = deque[tuple[Crossing, int, list[int]]]([(here, came_from, [])])
        found = {here}
        while queue:
            place, back, way = queue.popleft()
            if is_goal(place):
                return way
            for turn in range(1, 5):
                direction = (back - turn) % 4
                there = self._beyond(place, direction)
                if there in self.open and direction not in self.open[place] and there not in found:
                    found.add(there)
                    queue.append((there, (direction + 2) % 4, [*way, direction]))
        return None

    def _follow(self, here: Crossing, direction: int) -> Crossing:
        there = self._beyond(here, direction)
        self.open[here].discard(direction)
        angle = math.remainder(direction * math.pi / 2 - self.true.theta, math.tau)
        self._move(Pose(0.0, 0.0, angle), abs(angle) / TURN_RADPS)
        for _ in range(round(BLOCK_M / STEP_M)):
            self._move(Pose(STEP_M, 0.0, 0.0), STEP_M / SPEED_MPS)
        self._arrive(there)
        self.open[there].discard((direction + 2) % 4)
        return there

    def _move(self, motion: Pose, seconds: float) -> None:
        Q = self.noise**2 * self.model.covariance(motion, seconds)
        error = np.linalg.cholesky(Q) @ self.rng.normal(size=3)
        felt = Pose(motion.x + error[0], motion.y + error[1], motion.theta + error[2])
        self.true = self.true.compose(motion)
        self.belief = predict_in_place(self.belief, felt, Q)
        self._separate()

    def _arrive(self, here: Crossing) -> None:
        place = Pose(BLOCK_M * here[0], BLOCK_M * here[1])
        error = self.rng.normal(0.0, [SEEN_M, SEEN_M, SEEN_RAD])
        exact = self.true.to(place)
        seen = Pose(exact.x + error[0], exact.y + error[1], exact.theta + error[2])
        R = np.diag([SEEN_M**2, SEEN_M**2, SEEN_RAD**2])
        self._judge(here, seen, R[:2, :2])
        self.sigmas.append(self.sigma)
        if here in self.ids:
            self.belief = update_in_place(self.belief, self.ids[here], seen, R[:2, :2])
        else:
            self.ids[here] = len(self.ids) + 1
            self.open[here] = {d for d in WAYS if self._is_street(self._beyond(here, d))}
            self.belief = add_vertex(self.belief, self.ids[here], seen, R)
        self._separate()

    def _judge(self, here: Crossing, seen: Pose, R: Array) -> None:
        gaps, _ = distances(self.belief, np.array([seen.x, seen.y]), R)
        near = {place for place, key in self.ids.items() if gaps[key - 1] < GATE}
        others = near - {here}
        alike = [place for place in others if _degree(place) == _degree(here)]
        self.arrivals.append(Arrival(here in self.ids, here in near, len(others), len(alike)))

    def _separate(self) -> None:
        if self.independent:
            covariance = self.belief.P
            covariance *= np.kron(np.eye(len(covariance) // 3), np.ones((3, 3)))

    def _beyond(self, here: Crossing, direction: int) -> Crossing:
        dx, dy = WAYS[direction]
        return here[0] + dx, here[1] + dy

    def _is_street(self, place: Crossing) -> bool:
        return 0 <= place[0] < SIDE and 0 <= place[1] < SIDE

    @property
    def sigma(self) -> float:
        """Of the robot's position, m."""
        return math.sqrt(float(np.trace(self.belief.P[:2, :2])))

    def _variance(self, key: int) -> float:
        return float(np.trace(self.belief.vertex_covariance(key)))

    @property
    def before_closure(self) -> int:
        """Crossings in a row, from the start, that were new."""
        known = [arrival.is_known for arrival in self.arrivals]
        return known.index(True)

    @property
    def errors(self) -> Array:
        """Of the crossings at the end, (N, 2) m."""
        found = [self.belief.map_vertex(key).position for key in self.ids.values()]
        return np.array(found) - BLOCK_M * np.array(list(self.ids))

    @property
    def nees(self) -> float:
        """Mean squared error of the crossings in units of their covariance; 2 is right."""
        shares = [
            float(e @ np.linalg.solve(self.belief.vertex_covariance(key), e))
            for e, key in zip(self.errors, self.ids.values(), strict=True)
        ]
        return float(np.mean(shares))


def _degree(place: Crossing) -> int:
    return 4 - sum(coordinate in (0, SIDE - 1) for coordinate in place)
