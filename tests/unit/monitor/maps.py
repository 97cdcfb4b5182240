"""Maps drawn by hand: `#` is a wall, `.` free floor, a blank is unknown; north is up."""

import zlib

import numpy as np
from numpy.typing import NDArray

from gvgbot.tiles import Grid, Raster, Tile
from gvgbot.topics import Map, MapEdge, MapVertex

CELLS = {"#": 100, ".": 0, " ": -1}
SIDE = 64  # cells of a tile


def a_map(
    vertices: tuple[MapVertex, ...] = (), lines: tuple[list[tuple[float, float]], ...] = ()
) -> Map:
    return Map(
        stamp=0.0,
        vertices=vertices,
        edges=tuple(
            MapEdge(start=1, end=1, length=1.0, points=np.array(line, "<f4").tobytes())
            for line in lines
        ),
    )


def a_floor(
    drawing: str, *, resolution: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> Raster:
    return Raster(_cells(drawing), resolution, origin)


def a_grid(drawing: str, *, resolution: float = 1.0, number: int = 1) -> Grid:
    """A drawing of at most 64 by 64 cells, whose lower left corner is the map's origin."""
    drawn = _cells(drawing)
    cells = np.full((SIDE, SIDE), -1, np.int8)
    cells[: drawn.shape[0], : drawn.shape[1]] = drawn
    return Grid(
        stamp=0.0,
        began=0.0,
        number=number,
        resolution=resolution,
        side=SIDE,
        tiles=(Tile(column=0, row=0, cells=zlib.compress(cells.tobytes())),),
    )


def _cells(drawing: str) -> NDArray[np.int8]:
    rows = [[CELLS[sign] for sign in line] for line in reversed(drawing.strip("\n").split("\n"))]
    return np.array(rows, np.int8)


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
