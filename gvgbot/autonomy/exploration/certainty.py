"""When to go back to a place that is known, instead of on to one that is not.

Standard deviations are of positions in the map frame, the square root of the trace, m.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gvgbot.autonomy.exploration.paths import Approach, shortest_paths
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.ranges import Range

_WELL_KNOWN = 0.5  # times the robot's own standard deviation
_GROWN = 1.5  # times what it was at the last time: before, going back again tells little more
_AROUND_M = 20.0  # a way so long makes a visit e times less worth while
_DRIFT_M2_PER_M = 1e-4  # variance that a way adds
_SIGHTING_M2 = 1e-3  # and that seeing a vertex again leaves beyond its own
_BETTER = 0.95  # times the standard deviation: what is worth another visit
_TRIES = 2  # visits of a vertex that may come to nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class CertaintyConfig:
    """How certain the map shall be. Zhang et al. 2014: p_explore, and a limit for the pose."""

    p_explore: Annotated[float, Range(0.1, 1.0)] = 1.0  # of all tasks; the rest visit vertices
    pose_sigma_m: Annotated[float, Range(0.01, 100.0)] = 0.5  # above it, back to what is known
    vertex_sigma_m: Annotated[float, Range(0.0, 10.0)] = 0.0  # goal for each at the end; 0: none


@dataclass(frozen=True, slots=True)
class Revisit:
    """A vertex to drive to, and why."""

    vertex: int
    reason: str


class Revisiting:
    """Decides after each task what to visit again; chance is replaced by taking turns."""

    def __init__(self, config: CertaintyConfig) -> None:
        self._config = config
        self._worst = 0.0  # standard deviation of the robot for which it has gone back
        self._has_explored = False  # since the last revisit
        self._owed = 0.0  # revisits
        self._tries: dict[int, int] = {}
        self._best: dict[int, float] = {}  # standard deviation before the last visit

    def configure(self, config: CertaintyConfig) -> None:
        """Use another configuration from now on."""
        if config.pose_sigma_m != self._config.pose_sigma_m:
            self._worst = 0.0
        self._config = config

    def note_target(self, target: HalfEdgeId | None) -> None:
        """Learn that the robot is exploring a frontier, if it is."""
        self._has_explored = self._has_explored or target is not None

    def next(self, graph: GvgGraph, belief: Belief, starts: list[Approach]) -> Revisit | None:
        """The vertex to visit now; None to go on exploring, or to end if all is explored."""
        is_over = not graph.frontiers()
        if self._has_explored and not is_over:
            self._owed += (1.0 - self._config.p_explore) / self._config.p_explore
        if not self._has_explored and self._owed < 1.0 and not is_over:
            return None  # nothing has changed since this was asked last
        ways = shortest_paths(graph, starts)
        back = self._reassurance(belief, ways) if self._has_explored else None
        self._has_explored = False
        if is_over:
            return back or self._towards_goal(belief, ways)
        return back or self._turn(belief, ways)

    def _reassurance(self, belief: Belief, ways: dict[int, Approach]) -> Revisit | None:
        """The nearest well-known vertex, if the robot hardly knows where it is.

        Far from the start that is so wherever it goes, and each time it comes there once more it
        learns less about the way.
        """
        own = robot_sigma(belief)
        if own <= max(self._config.pose_sigma_m, _GROWN * self._worst):
            return None
        known = [v for v in ways if vertex_sigma(belief, v) < _WELL_KNOWN * own]
        if not known:
            return None
        self._worst = own
        nearest = min(known, key=lambda v: (ways[v].metres, v))
        return Revisit(nearest, f"the pose is uncertain by {own:.2f} m")

    def _turn(self, belief: Belief, ways: dict[int, Approach]) -> Revisit | None:
        """An uncertain vertex around, when it is its turn."""
        if not ways or self._owed < 1.0:
            return None
        self._owed -= 1.0
        worth = {v: vertex_sigma(belief, v) * math.exp(-ways[v].metres / _AROUND_M) for v in ways}
        best = max(worth, key=lambda v: (worth[v], -v))
        return Revisit(best, f"its place is uncertain by {vertex_sigma(belief, best):.2f} m")

    def _towards_goal(self, belief: Belief, ways: dict[int, Approach]) -> Revisit | None:
        """The least certain vertex above the goal that a visit may help."""
        if not self._config.vertex_sigma_m:
            return None
        sigma = {v: vertex_sigma(belief, v) for v in self.too_uncertain(belief)}
        for vertex in sorted(sigma.keys() & ways.keys(), key=lambda v: (-sigma[v], v)):
            if sigma[vertex] < _BETTER * self._best.get(vertex, math.inf):
                self._tries[vertex] = 0
            helps = arrival_sigma(belief, ways[vertex]) < _BETTER * sigma[vertex]
            if helps and self._tries.get(vertex, 0) < _TRIES:
                self._tries[vertex] = self._tries.get(vertex, 0) + 1
                self._best[vertex] = sigma[vertex]
                return Revisit(vertex, f"its place is uncertain by {sigma[vertex]:.2f} m")
        return None

    def too_uncertain(self, belief: Belief) -> list[int]:
        """The vertices that are less certain than the goal."""
        goal = self._config.vertex_sigma_m
        return [v for v in belief.ids if goal and vertex_sigma(belief, v) > goal]


def robot_sigma(belief: Belief) -> float:
    """Standard deviation of the robot's position, m."""
    return math.sqrt(max(float(np.trace(belief.P[:2, :2])), 0.0))


def vertex_sigma(belief: Belief, vertex: int) -> float:
    """Standard deviation of a vertex's position, m."""
    return math.sqrt(max(float(np.trace(belief.vertex_covariance(vertex))), 0.0))


def arrival_sigma(belief: Belief, way: Approach) -> float:
    """Standard deviation with which the robot would arrive, m: simulated without correlations.

    Every metre adds to the variance, and each vertex on the way may take it down to its own.
    """
    passed = [departure.vertex for departure in way.departures]
    each = way.metres / (len(passed) + 1)  # about
    variance = robot_sigma(belief) ** 2
    for vertex in passed:
        variance += _DRIFT_M2_PER_M * each
        variance = min(variance, vertex_sigma(belief, vertex) ** 2 + _SIGHTING_M2)
    return math.sqrt(variance + _DRIFT_M2_PER_M * each)
