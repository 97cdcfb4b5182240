"""Occupancy grid <-> the files that ROS map_server loads: a YAML beside a PGM image.

A third file, which map_server does not know, says when each pixel was first seen.
"""

import io
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from gvgbot.errors import UsageError
from gvgbot.images import opened
from gvgbot.maps.occupancy import UNKNOWN, OccupancyGrid, Seconds
from gvgbot.yaml_text import read_yaml

IMAGE = "map.pgm"
DESCRIPTION = "map.yaml"
SEEN = "seen.png"
OCCUPIED_THRESH = 0.65
FREE_THRESH = 0.196  # just below the probability that the grey of unknown stands for
WALL, FREE, UNSEEN = 0, 254, 205  # grey levels
NEVER = 65535  # the level of a pixel in SEEN that no scan saw

_FARTHEST_M = 1e5  # from the origin to a map
_Near = Annotated[float, msgspec.Meta(ge=-_FARTHEST_M, le=_FARTHEST_M)]


class _Description(msgspec.Struct):
    resolution: Annotated[float, msgspec.Meta(ge=1e-4, le=10.0)]
    origin: tuple[_Near, _Near, _Near]


def encode_map_server(grid: OccupancyGrid) -> dict[str, bytes | str]:
    """The files by name. A cell in doubt counts as unknown; what was seen when, if it is known."""
    files: dict[str, bytes | str] = {IMAGE: _pgm(_grey(grid)), DESCRIPTION: _description(grid)}
    return files if grid.seen_s is None else files | {SEEN: _seconds_png(grid.seen_s)}


def read_map_server(directory: Path) -> OccupancyGrid:
    """The grid that `encode_map_server` made the files of, with cells of 0, 100 and -1 percent.

    Greys that were drawn into the image by hand count as map_server takes them.
    Raises UsageError, in one line, if a file is missing (but for SEEN) or damaged.
    """
    try:
        text = (directory / DESCRIPTION).read_bytes()
        description = msgspec.convert(read_yaml(text), _Description)
    except OSError as error:
        raise UsageError(f"cannot read {directory / DESCRIPTION}: {error.strerror}") from error
    except (ValueError, msgspec.ValidationError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"{directory / DESCRIPTION} describes no map: {reason}") from error
    grey = _read_image(directory / IMAGE, "L")
    cells = np.full(grey.shape, UNKNOWN, np.int8)
    occupancy = (255 - grey) / 255.0
    cells[occupancy < FREE_THRESH], cells[occupancy > OCCUPIED_THRESH] = 0, 100
    x, y, _ = description.origin
    return OccupancyGrid(cells, description.resolution, (x, y), _read_seen(directory, grey.shape))


def _read_seen(directory: Path, shape: tuple[int, ...]) -> Seconds | None:
    """When each cell was first seen; None for a run that did not take it down."""
    path = directory / SEEN
    if not path.exists():
        return None
    levels = _read_image(path, "I;16")
    if levels.shape != shape:
        raise UsageError(f"{path} is not as large as {IMAGE}")
    return np.where(levels == NEVER, np.inf, levels).astype(np.float32)


def _read_image(path: Path, mode: str) -> NDArray[np.int64]:
    """Levels (rows, columns), first row at the bottom."""
    try:
        with opened(path) as image:
            if image.mode != mode:
                raise UsageError(f"{path} is not an image that a run writes")
            return np.asarray(image)[::-1].astype(np.int64)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a whole image"
        raise UsageError(f"cannot read {path}: {reason}") from error


def _seconds_png(seen_s: Seconds) -> bytes:
    """Whole seconds as an image of 16 bit, first row at the top."""
    levels = np.where(np.isinf(seen_s), NEVER, np.minimum(seen_s, NEVER - 1))
    file = io.BytesIO()
    Image.fromarray(levels[::-1].astype(np.uint16)).save(file, "PNG")
    return file.getvalue()


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
