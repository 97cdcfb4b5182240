"""Worlds made by code, so that a simulation needs no files."""

from collections.abc import Callable
from pathlib import Path

from gvgbot.drivers.world import World, load_world
from gvgbot.errors import WorldError
from gvgbot.geometry import Pose
from gvgbot.spelling import nearest
from gvgbot.worlds.buildings import comb, grid, hall, jittered, office, ring, spiral
from gvgbot.worlds.cave import cave
from gvgbot.worlds.clutter import clutter
from gvgbot.worlds.difficult_plans import crowd, doors, glass, narrow
from gvgbot.worlds.floor_plan import floor_plan, large_plan
from gvgbot.worlds.open_hall import open_hall
from gvgbot.worlds.rooms import rooms
from gvgbot.worlds.slopes import slopes

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
    "floor_plan": floor_plan,
    "large_plan": large_plan,
    "narrow": narrow,
    "doors": doors,
    "clutter": clutter,
    "slopes": slopes,
    "open_hall": open_hall,
    "glass": glass,
    "crowd": crowd,
}
NAMES: tuple[str, ...] = tuple(_MAKERS)
_ALWAYS_THE_SAME = ("office", "grid", "comb", "spiral", "ring", "hall")


def builtin(name: str) -> tuple[World, Pose]:
    """A built-in world and a free start pose in it (world frame).

    `name` is one of NAMES; a world that is drawn at random takes a seed behind a colon, as in
    `floor_plan:7`, else 0. Raises WorldError for an unknown name, and for a seed of another world.
    """
    maker, _, seed = name.partition(":")
    if maker not in _MAKERS or (":" in name and not seed.isdecimal()):
        raise WorldError(_unknown(name))
    if seed and maker in _ALWAYS_THE_SAME:
        raise WorldError(f"world {name!r}: {maker} is always the same and takes no seed")
    return _MAKERS[maker](int(seed or 0))


def open_world(name_or_path: str, *, unknown_is_wall: bool = False) -> tuple[World, Pose | None]:
    """A built-in world with its start pose, or the world of a map_server YAML file without one.

    What the file does not know is free, or wall. Raises WorldError when it is neither, or the file
    is unfit.
    """
    if name_or_path.partition(":")[0] in _MAKERS:
        return builtin(name_or_path)
    path = Path(name_or_path)
    if not name_or_path or (not path.exists() and path.suffix not in (".yaml", ".yml")):
        raise WorldError(_unknown(name_or_path))
    return load_world(path, unknown_is_wall=unknown_is_wall), None


def _unknown(name: str) -> str:
    kind, colon, seed = name.partition(":")
    near = nearest(kind, NAMES)
    meant = near if near in _ALWAYS_THE_SAME else f"{near}{colon}{seed}"
    hint = "" if near in (None, kind) else f"did you mean {meant}? or "
    return (
        f"unknown world {name!r}: {hint}give a map_server YAML file or one of the built-in worlds "
        f"{', '.join(NAMES)} (NAME:SEED draws another one of its kind)"
    )
