"""The finished map as a graph of routes: what is saved, drawn and handed to other robots."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gvgbot.geometry import Array, length_of

VertexKind = Literal["meetpoint", "endpoint"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteNode:
    """A meetpoint or an endpoint, in the map frame.

    `position` in m, `covariance` of it as (xx, xy, yx, yy) in m^2, `clearance` in m. `bearings`
    (rad, map frame) are the directions of the edges that leave here, `frontiers` those of them
    that were never followed. `visits` counts how often the robot came by.
    """

    id: int
    kind: VertexKind
    position: tuple[float, float]
    degree: int
    bearings: tuple[float, ...]
    clearance: float
    covariance: tuple[float, float, float, float]
    frontiers: tuple[float, ...] = ()
    visits: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RouteEdge:
    """An edge between two vertices, which may be one and the same.

    `polyline` (N, 2) in m, map frame, runs from the vertex `start` to the vertex `end`; read-only.
    `length`, its own, and `min_clearance` in m; `traversals` counts the times the robot drove
    along it.
    """

    start: int
    end: int
    polyline: Array
    length: float = field(init=False)
    min_clearance: float
    traversals: int = 0

    def __post_init__(self) -> None:
        if self.polyline.ndim != 2 or self.polyline.shape[1] != 2 or len(self.polyline) < 2:
            raise ValueError(f"edge from {self.start} to {self.end} needs two points or more")
        self.polyline.setflags(write=False)
        object.__setattr__(self, "length", length_of(self.polyline))


def lines_from(vertex: int, edges: Iterable[RouteEdge]) -> Iterator[Array]:
    """The polylines (N, 2) of those edges that end at a vertex, from there; a loop's both ways."""
    for edge in edges:
        if edge.start == vertex:
            yield edge.polyline
        if edge.end == vertex:
            yield edge.polyline[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class RouteGraph:
    """Vertices with unique ids, and edges between them; loops and parallel edges are legal.

    Raises ValueError if an id stands twice or is negative, or if an edge's end does not exist.
    """

    vertices: tuple[RouteNode, ...] = ()
    edges: tuple[RouteEdge, ...] = ()

    def __post_init__(self) -> None:
        ids = Counter(vertex.id for vertex in self.vertices)
        for number, times in ids.items():
            if number < 0 or times > 1:
                raise ValueError(f"vertex id {number} is negative or stands {times} times")
        for edge in self.edges:
            if edge.start not in ids or edge.end not in ids:
                raise ValueError(
                    f"edge from {edge.start} to {edge.end} joins a vertex not in the map"
                )

    @property
    def points(self) -> Array:
        """Every position and polyline point (N, 2), m, map frame."""
        positions = np.array([vertex.position for vertex in self.vertices]).reshape(-1, 2)
        return np.concatenate([positions, *(edge.polyline for edge in self.edges)])
