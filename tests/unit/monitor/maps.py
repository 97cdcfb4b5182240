"""Maps drawn by hand: `#` is a wall, `.` free floor, a blank is unknown; north is up."""

import numpy as np

from gvgbot.topics import Map, MapEdge, MapVertex

CELLS = {"#": 100, ".": 0, " ": -1}


def a_map(
    drawing: str,
    *,
    resolution: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
    vertices: tuple[MapVertex, ...] = (),
    lines: tuple[list[tuple[float, float]], ...] = (),
    trail: list[tuple[float, float]] | None = None,
) -> Map:
    rows = [[CELLS[sign] for sign in line] for line in reversed(drawing.strip("\n").split("\n"))]
    return Map(
        stamp=0.0,
        resolution=resolution,
        origin=origin,
        columns=len(rows[0]),
        rows=len(rows),
        cells=np.array(rows, np.int8).tobytes(),
        vertices=vertices,
        edges=tuple(
            MapEdge(start=1, end=1, length=1.0, points=np.array(line, "<f4").tobytes())
            for line in lines
        ),
        trail=np.array(trail or [], "<f4").tobytes(),
    )


def vertex(
    position: tuple[float, float],
    kind: str = "meetpoint",
    frontiers: tuple[float, ...] = (),
) -> MapVertex:
    return MapVertex(
        id=1,
        kind="meetpoint" if kind == "meetpoint" else "endpoint",
        position=position,
        covariance=(0.0, 0.0, 0.0, 0.0),
        clearance=1.0,
        frontiers=frontiers,
    )
