"""Worlds made by code, so that a simulation needs no files."""

from collections.abc import Callable
from pathlib import Path

from gvgbot.drivers.world import World, load_world
from gvgbot.errors import WorldError
from gvgbot.geometry import Pose
from gvgbot.worlds.buildings import comb, grid, hall, jittered, office, ring, spiral
from gvgbot.worlds.cave import cave
from gvgbot.worlds.rooms import rooms

_MAKERS: dict[str, Callable[[int], tuple[World, Pose]]] = {
    "office": office,
    "grid": grid,
    "jittered": jittered,
    "rooms": rooms,
    "cave": cave,
    "comb": comb,
    "spiral": spiral,
    "ring": ring,
    "hall": hall,
}
NAMES: tuple[str, ...] = tuple(_MAKERS)


def builtin(name: str, seed: int = 0) -> tuple[World, Pose]:
    """The built-in world of this name and a free start pose (world_base).

    Worlds that are not drawn at random ignore the seed. Raises WorldError for an unknown name.
    """
    if name not in _MAKERS:
        raise WorldError(f"unknown world {name!r}; the built-in worlds are {', '.join(NAMES)}")
    return _MAKERS[name](seed)


def open_world(name_or_path: str, seed: int = 0) -> tuple[World, Pose | None]:
    """A built-in world with its start pose, or the world of a map_server YAML file without one.

    Raises WorldError when it is neither, or the file is unfit.
    """
    if name_or_path in _MAKERS:
        return builtin(name_or_path, seed)
    path = Path(name_or_path)
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        raise WorldError(
            f"unknown world {name_or_path!r}: give a map_server YAML file or one of the built-in "
            f"worlds {', '.join(NAMES)}"
        )
    return load_world(path), None
