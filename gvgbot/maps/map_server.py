"""Occupancy grid -> the files that ROS map_server loads: a YAML beside a PGM image."""

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from gvgbot.maps.atomic_files import write_files
from gvgbot.maps.occupancy import OccupancyGrid

IMAGE = "map.pgm"
DESCRIPTION = "map.yaml"
OCCUPIED_THRESH = 0.65
FREE_THRESH = 0.196  # just below the probability that the grey of unknown stands for
WALL, FREE, UNSEEN = 0, 254, 205  # grey levels


def encode_map_server(grid: OccupancyGrid) -> dict[str, bytes | str]:
    """The two files by name. A cell in doubt counts as unknown."""
    return {IMAGE: _pgm(_grey(grid)), DESCRIPTION: _description(grid)}


def write_map_server(grid: OccupancyGrid, directory: Path) -> None:
    """Replace both files in a directory. Raises GvgbotError if one cannot be written."""
    write_files(directory, encode_map_server(grid))


def _grey(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """The image (rows, columns) with its first row at the top."""
    cells = grid.cells[::-1]
    grey = np.full(cells.shape, UNSEEN, np.uint8)
    grey[(cells >= 0) & (cells < 100.0 * FREE_THRESH)] = FREE
    grey[cells > 100.0 * OCCUPIED_THRESH] = WALL
    return grey


def _pgm(grey: NDArray[np.uint8]) -> bytes:
    rows, columns = grey.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + grey.tobytes()


def _description(grid: OccupancyGrid) -> str:
    x, y = grid.origin
    fields = {
        "image": IMAGE,
        "mode": "trinary",
        "resolution": round(grid.resolution_m, 6),
        "origin": [round(x, 6), round(y, 6), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    return yaml.safe_dump(fields, sort_keys=False, default_flow_style=None)
