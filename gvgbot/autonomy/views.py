"""What one keyframe shows, and which part of it is which part of the map."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local import Branch, LocalEdge, LocalGvg, LocalNode
from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.slam.graph import HalfEdgeId, Vertex
from gvgbot.geometry import Array, Pose

IN_FULL_VIEW_M = 4.0  # from so near, it would be seen that a vertex is none
_AT_M = 0.2  # from a node, a line ends there
_RIM_M = 0.25  # a point so near to a disc of the GVG may shape it
_BESIDE_M, _STEP_M = 0.1, 0.05  # from a line of sight, a wall is on it; and from point to point


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """All that one keyframe shows, in the local frame."""

    keyframe: int  # its number, from 0
    stamp: float
    travelled: float  # metres
    local_base: Pose
    gvg: LocalGvg
    local_map: LocalMap
    doubtful: Array = field(default_factory=lambda: np.empty((0, 2)))  # obstacles that may go
    doubted: frozenset[int] = frozenset()  # nodes that may be there for a while only
    # nodes that were made where the vertex of a ring should be: there is nothing to be seen of it
    marks: dict[int, Vertex] = field(default_factory=dict)
    is_somebody_found: bool = False  # who will be let into the map if he stays
    passing: Array = field(default_factory=lambda: np.empty((0, 2)))  # bodies that may yet go
    aside: Array = field(default_factory=lambda: np.empty((0, 2)))  # of these, who leads no edges
    may_be_robots: bool = False  # of a team: some of them are about, and nobody knows where
    field_of_view: tuple[float, float] = (-math.pi, math.pi)  # rad, base frame
    virtual_walls: Array = field(default_factory=lambda: np.empty((0, 2)))  # points (N, 2)
    felt: Array = field(default_factory=lambda: np.empty((0, 2)))  # doubtful, but never seen
    robot_radius: float = 0.177  # m
    _obstacles: list[cKDTree] = field(default_factory=list, init=False)  # once they were asked for

    def obstacles(self) -> cKDTree:
        """To find the nearest of all that it must not drive into: walls, virtual ones too."""
        if not len(self.virtual_walls):
            return self.local_map.tree()
        if not self._obstacles:
            walls = np.concatenate([self.local_map.points(), self.virtual_walls])
            self._obstacles.append(cKDTree(walls, balanced_tree=False))
        return self._obstacles[0]

    def is_doubtful(self, place: Array, within_m: float) -> bool:
        """Whether something or somebody that may go stands so near to a place (2,)."""
        may_go = np.concatenate([self.doubtful, self.aside])
        return bool((np.hypot(*(may_go - place).T) < within_m).any())

    def is_somebody_near(self) -> bool:
        """Whether a body that may yet go is where vertices are in full view."""
        away = np.hypot(*(self.passing - self.local_base.position).T)
        return bool((away < IN_FULL_VIEW_M).any())

    def is_end_doubted(self, place: Array) -> bool:
        """Whether the GVG ends at a place (2,) only because something that may go is there."""
        ends = (self.gvg.nodes[key] for key in self.doubted)
        return any(node.degree == 1 and math.dist(node.position, place) < _AT_M for node in ends)

    def sees(self, place: Array) -> bool:
        """Whether no wall is on the line of sight to a place (2,).

        What is known of places out of sight does not grow: only parts of it are forgotten.
        """
        return _is_clear(self.local_map.tree(), self.local_base.position, place)

    def turn_to_see(self, bearing: float) -> float:
        """How far to turn left until a bearing, rad, local frame, is in view; 0 if it is."""
        first, last = self.field_of_view
        beyond = (bearing - self.local_base.theta - last) % math.tau
        return beyond if beyond < math.tau - (last - first) else 0.0

    def stands_free(self, place: Array, within_m: float) -> bool:
        """Whether it is certain that neither wall nor glass is so near to a place (2,)."""
        away = np.hypot(*(self.local_map.points() - place).T)
        is_walled = bool((away < within_m).any())
        return not is_walled and self.local_map.is_bare(place, within_m)


def touching(gvg: LocalGvg, points: Array, walls: cKDTree | None = None) -> frozenset[int]:
    """The nodes that would be elsewhere, or not at all, without obstacles (N, 2).

    What stands behind one of the `walls` has no part in a node.
    """
    if not len(points):
        return frozenset()
    return frozenset(key for key, node in gvg.nodes.items() if _is_shaped(node, points, walls))


def _is_shaped(node: LocalNode, points: Array, walls: cKDTree | None) -> bool:
    near = beside(node, points)
    return any(walls is None or _is_clear(walls, node.position, point) for point in near)


def _is_clear(walls: cKDTree, start: Array, end: Array) -> bool:
    """Whether no wall is on the line from a place (2,) to another one."""
    line = np.linspace(start, end, math.ceil(math.dist(start, end) / _STEP_M) + 1)
    gaps, _ = walls.query(line, distance_upper_bound=_BESIDE_M)
    return bool(np.isinf(gaps).all())


def beside(node: LocalNode, points: Array) -> Array:
    """Of obstacles (N, 2) those without which the node would be elsewhere, or not at all."""
    return np.asarray(points[np.hypot(*(points - node.position).T) < node.clearance + _RIM_M])


def touches(edge: LocalEdge, points: Array) -> bool:
    """Whether an edge would be elsewhere, or not at all, with obstacles (N, 2)."""
    if not len(points):
        return False
    away = np.hypot(*(edge.polyline[:, None] - points).transpose(2, 0, 1)).min(axis=1)
    return bool((away < edge.clearance + _RIM_M).any())


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A vertex as measured at a keyframe: its pose in the base frame, and R (2, 2) or (3, 3)."""

    keyframe: int
    vertex: int
    base_vertex: Pose
    R: Array


@dataclass(slots=True, eq=False)
class Correspondence:
    """Which part of the local GVG is which part of the graph."""

    vertex_of: dict[int, int] = field(default_factory=dict)
    node_of: dict[int, int] = field(default_factory=dict)
    half_edge_of: dict[Branch, HalfEdgeId] = field(default_factory=dict)
    branch_of: dict[HalfEdgeId, Branch] = field(default_factory=dict)

    def pair(self, node: int, vertex: int) -> None:
        """Note that a local node is a vertex."""
        self.vertex_of[node], self.node_of[vertex] = vertex, node

    def pair_branch(self, branch: Branch, end: HalfEdgeId) -> None:
        """Note that a local branch is a half-edge."""
        self.half_edge_of[branch], self.branch_of[end] = end, branch
