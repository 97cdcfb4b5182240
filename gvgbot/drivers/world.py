"""The simulated world: an occupancy bitmap, and its files in map_server form."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import structlog
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask, RayCaster
from gvgbot.errors import WorldError
from gvgbot.geometry import Array, Pose
from gvgbot.images import opened
from gvgbot.yaml_text import is_finite, read_yaml

OCCUPIED_THRESHOLD = 0.65  # map_server's customary values, for files that leave them out
FREE_THRESHOLD = 0.196
OWN_MAP = "map.yaml"  # in the directory of a run
FREE_GREY, OCCUPIED_GREY, UNKNOWN_GREY = SAVED_GREYS = 254, 0, 205  # what map_saver writes
OPAQUE = 255
_MOST_PIXELS = 60_000_000  # of a map: a square of 390 m by 5 cm; each takes some 30 bytes to read
_FINEST_M, _COARSEST_M = 1e-4, 10.0  # a pixel of a map
_FARTHEST_M = 1e6  # from the origin of the world to a map of it

log = structlog.get_logger()


@dataclass(frozen=True, eq=False)
class World:
    """Walls as a bitmap: `occupied` (rows, columns) squares of `resolution_m`, row 0 lowest.

    `origin` is the lower left corner of the bitmap in the world frame, m. Outside the bitmap all
    is empty. `glass` marks the occupied squares that light can pass; None where there are none.
    `people` is how many walk about in it, unless configured otherwise. Bitmaps are read-only.
    """

    occupied: Mask
    resolution_m: float
    origin: tuple[float, float] = (0.0, 0.0)
    name: str = "world"
    glass: Mask | None = None
    people: int = 0

    def __post_init__(self) -> None:
        self.occupied.setflags(write=False)
        if self.glass is not None:
            self.glass.setflags(write=False)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least x, least y, greatest x, greatest y of the bitmap, m."""
        rows, columns = self.occupied.shape
        x, y = self.origin
        return x, y, x + columns * self.resolution_m, y + rows * self.resolution_m

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies on the bitmap."""
        x0, y0, x1, y1 = self.extent
        return x0 <= x < x1 and y0 <= y < y1

    def cast(
        self, pose: Pose, bearings: Array, max_range: float, moved: Array | None = None
    ) -> Array:
        """Ranges (N,) in m from a sensor at `pose` along ascending bearings (N,) in its frame.

        A beam may begin a few millimetres away, `moved` (N, 2), m, in the world frame.
        inf where nothing is within `max_range`, zeros from inside a wall. Glass counts as a wall.
        Raises ValueError unless the bearings ascend and span at most one turn.
        """
        return self._caster.cast(pose.x, pose.y, bearings + pose.theta, max_range, moved)

    def clear_of_walls(self, x: float, y: float) -> float:
        """A distance in m that surely holds no wall: short of the true one by about two cells."""
        column = math.floor((x - self.origin[0]) / self.resolution_m)
        row = math.floor((y - self.origin[1]) / self.resolution_m)
        rows, columns = self.occupied.shape
        if not (0 <= row < rows and 0 <= column < columns):
            return 0.0
        return float(self.clearance[row, column])

    def wall_offsets(self, x: float, y: float, reach: float) -> Array:
        """From (x, y) to the nearest point of each occupied square within `reach`: (N, 2), m."""
        res, (x0, y0) = self.resolution_m, self.origin
        first_row = max(0, math.floor((y - reach - y0) / res))
        first_column = max(0, math.floor((x - reach - x0) / res))
        end_row = max(0, math.floor((y + reach - y0) / res) + 1)
        end_column = max(0, math.floor((x + reach - x0) / res) + 1)
        rows, columns = np.nonzero(self.occupied[first_row:end_row, first_column:end_column])
        left = x0 + res * (columns + first_column)
        bottom = y0 + res * (rows + first_row)
        dx = np.minimum(np.maximum(left - x, 0.0), left + res - x)
        dy = np.minimum(np.maximum(bottom - y, 0.0), bottom + res - y)
        near = np.hypot(dx, dy) <= reach
        return np.column_stack((dx[near], dy[near]))

    @cached_property
    def without_glass(self) -> "World":
        """The world with all glass taken away."""
        if self.glass is None:
            return self
        return replace(self, occupied=self.occupied & ~self.glass, glass=None)

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.occupied, self.resolution_m, self.origin)

    @cached_property
    def clearance(self) -> NDArray[np.float32]:
        """`clear_of_walls` of each square: the way from its centre to a wall's, less a diagonal."""
        if not self.occupied.any():
            return np.full(self.occupied.shape, np.inf, dtype=np.float32)
        cells = ndimage.distance_transform_edt(~self.occupied) - math.sqrt(2)
        return np.maximum(cells * self.resolution_m, 0.0).astype(np.float32)


def load_world(path: Path, *, unknown_is_wall: bool = False) -> World:
    """The world that a map_server YAML file describes.

    A pixel is a wall where its occupancy exceeds `occupied_thresh`; unknown pixels are free, or
    walls. Raises WorldError, in one line, for whatever is wrong with the file or its image.
    """
    world, known = load_map(path)
    return replace(world, occupied=world.occupied | ~known) if unknown_is_wall else world


def load_map(path: Path) -> tuple[World, Mask]:
    """The same world, and which of its squares are known: walls, or below `free_thresh`."""
    entries = _Entries(path, _read_yaml(path))
    resolution = entries.number("resolution")
    if not _FINEST_M <= resolution <= _COARSEST_M:
        allowed = f"must be from {_FINEST_M:g} to {_COARSEST_M:g} (metres per pixel)"
        raise entries.error("resolution", allowed)
    origin = entries.origin()
    negate = entries.negate()
    threshold = entries.fraction("occupied_thresh", OCCUPIED_THRESHOLD)
    grey = _read_grey(path, entries.image(), entries.mode())
    free_threshold = _free_threshold(entries, grey)
    occupancy = (grey if negate else 255.0 - grey) / 255.0
    occupied = np.ascontiguousarray(np.flipud(occupancy > threshold))
    known = occupied | np.flipud(occupancy < free_threshold)
    return World(occupied, resolution, origin, path.stem), known


def _free_threshold(entries: "_Entries", grey: Array) -> float:
    """`free_thresh`, or less where map_saver would take its own unknown pixels for free by it.

    Nav2's wrote 0.25 for years, https://github.com/SteveMacenski/slam_toolbox/issues/587.
    """
    threshold = entries.fraction("free_thresh", FREE_THRESHOLD)
    unknown = (255.0 - UNKNOWN_GREY) / 255.0
    if threshold <= unknown or entries.mode() != "trinary" or entries.negate():
        return threshold
    if UNKNOWN_GREY not in grey or not np.isin(grey, SAVED_GREYS).all():
        return threshold
    log.warning("grey 205 is unknown, not free", path=str(entries.path), free_thresh=threshold)
    return unknown


def save_world(world: World, directory: Path) -> Path:
    """Write NAME.yaml and NAME.png into the directory, made if absent; the YAML's path."""
    directory.mkdir(parents=True, exist_ok=True)
    image = directory / f"{world.name}.png"
    grey = np.where(world.occupied, OCCUPIED_GREY, FREE_GREY).astype(np.uint8)
    Image.fromarray(np.flipud(grey)).save(image)
    entries = {
        "image": image.name,
        "resolution": float(world.resolution_m),
        "origin": [float(world.origin[0]), float(world.origin[1]), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESHOLD,
        "free_thresh": FREE_THRESHOLD,
    }
    path = directory / f"{world.name}.yaml"
    path.write_text(yaml.safe_dump(entries, sort_keys=False), encoding="utf-8")
    return path


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        content = read_yaml(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise WorldError(f"{path}: no such file; give the path of a map_server YAML file") from None
    except OSError as error:
        reason = f"{error.strerror}{_instead(path / OWN_MAP)}"
        raise WorldError(f"{path}: cannot read the file: {reason}") from None
    except UnicodeDecodeError:
        raise WorldError(f"{path}: cannot be read as text; give a map_server YAML file") from None
    except ValueError as error:
        raise WorldError(f"{path}: not valid YAML ({error})") from None
    if not isinstance(content, dict):
        raise WorldError(f"{path}: not a map_server file; it must hold `key: value` lines")
    if not content.keys() & {"image", "resolution", "origin"}:
        instead = _instead(path.parent / OWN_MAP) or "; a world is such a YAML file and its image"
        raise WorldError(f"{path}: not a map_server file{instead}")
    return content


def _instead(path: Path) -> str:
    """What to say of a file that may have been meant, if it is there."""
    return f"; give {path}" if path.exists() else ""


def _read_grey(path: Path, image: Path, mode: str) -> Array:
    """Brightness 0..255 of each pixel, NaN where it tells nothing; row 0 at the top."""
    try:
        with opened(image) as picture:
            return _grey(picture, mode)
    except FileNotFoundError:
        raise WorldError(f"{path}: key image: no such file {image}; correct the name") from None
    except UnidentifiedImageError:
        raise WorldError(f"{path}: key image: {image} is not an image; use PGM or PNG") from None
    except (OSError, SyntaxError, ValueError) as error:
        raise WorldError(f"{path}: key image: cannot read {image} ({_line(error)})") from None


def _grey(picture: Image.Image, mode: str) -> Array:
    """The same of one that is open, and not read yet. Raises ValueError for one too large."""
    if (pixels := picture.width * picture.height) > _MOST_PIXELS:
        most = _MOST_PIXELS // 1_000_000
        raise ValueError(f"{pixels} pixels, and {most} million at most: make it coarser")
    if picture.mode.startswith("I"):
        return np.asarray(picture, dtype=np.float64) / 257.0  # sixteen bits
    if picture.has_transparency_data:
        return _grey_of_transparent(np.asarray(picture.convert("RGBA")), mode)
    if picture.mode in ("1", "L"):
        return np.asarray(picture.convert("L"), dtype=np.float64)
    return np.asarray(np.asarray(picture.convert("RGB")).mean(axis=2))


def _grey_of_transparent(pixels: NDArray[np.uint8], mode: str) -> Array:
    """As map_server has it: alpha is one more colour, or in scale mode marks what is unknown."""
    if mode == "scale":
        return np.where(pixels[..., 3] == OPAQUE, pixels[..., :3].mean(axis=2), np.nan)
    return np.asarray(pixels.mean(axis=2))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


@dataclass(frozen=True, slots=True)
class _Entries:
    """The keys of one world file; every complaint names the file and the key."""

    path: Path
    content: dict[str, Any]

    def error(self, key: str, complaint: str) -> WorldError:
        return WorldError(f"{self.path}: key {key}: {complaint}")

    def required(self, key: str) -> Any:
        if key not in self.content:
            raise self.error(key, "missing; add it, as map_server files have it")
        return self.content[key]

    def number(self, key: str) -> float:
        value = self.required(key)
        if not _is_number(value):
            raise self.error(key, f"must be a number, not {value!r}")
        return float(value)

    def fraction(self, key: str, default: float) -> float:
        value = self.number(key) if key in self.content else default
        if not 0.0 <= value <= 1.0:
            raise self.error(key, f"must be from 0 to 1, not {value!r}")
        return value

    def origin(self) -> tuple[float, float]:
        value = self.required("origin")
        if not (isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))):
            raise self.error("origin", f"must be three numbers [x, y, yaw], not {value!r}")
        if value[2] != 0:
            raise self.error("origin", f"yaw must be 0, not {value[2]!r}; turn the image instead")
        if max(abs(value[0]), abs(value[1])) > _FARTHEST_M:
            raise self.error("origin", f"must be within {_FARTHEST_M:.0f} m, not {value!r}")
        return float(value[0]), float(value[1])

    def negate(self) -> bool:
        value = self.content.get("negate", 0)
        if value not in (0, 1):
            raise self.error("negate", f"must be 0 or 1, not {value!r}")
        return bool(value)

    def mode(self) -> str:
        mode = self.content.get("mode", "trinary")
        if mode not in ("trinary", "scale"):
            raise self.error("mode", f"must be trinary or scale, not {mode!r}; save the map so")
        return str(mode)

    def image(self) -> Path:
        value = self.required("image")
        if not (isinstance(value, str) and value):
            raise self.error("image", f"must be a file name, not {value!r}")
        return self.path.parent / value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and is_finite(value)
