"""The command `gvgbot map import`: a run made of a map_server map, to be localised on."""

import math
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.reduction import reduce_graph
from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.autonomy.known_grid import KnownGrid, learn
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import Config
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World, load_map
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.geometry import Array, Pose, thinned
from gvgbot.hal.messages import Scan
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.service import set_up_logging
from gvgbot.session import Session

_BEAMS = 720  # of a scan, all around
_MERGE_M = 0.1  # points of walls in one square of this size are one
_HOLE = 0.1  # of the space around it


def import_map(path: Path, out: Path, config: Config) -> tuple[int, int]:
    """Write a run that knows a map_server map; how many vertices and edges it has.

    An error leaves no run in the way of the next attempt.
    Raises UsageError for a map or a directory that cannot be used, GvgbotError if nothing can be
    written.
    """
    set_up_logging(sys.stderr, os.environ, "warning")
    world, known = load_map(path)
    with RunDirectory.create(out, world=world.name) as directory, directory.emptied_by_failure():
        session = Session(config, directory, None)
        session.title = world.name
        _teach(session.pipeline, path, world, known, config)
        graph = session.pipeline.mapper.graph
        if not graph.vertices:
            raise UsageError(
                f"{path}: no way in it is wide enough for the robot, or leads from one place to "
                "another: a closed room alone has no edges"
            )
        keeper = Keeper(session, MissionFiles(directory.path))
        keeper.finish()
        if keeper.trouble is not None:
            raise GvgbotError(f"cannot write the mission to {out}: {keeper.trouble}")
        session.pipeline.mission.reason = f"imported from {path.name}"
        session.save()
        return len(graph.vertices), len(graph.edges)


def _teach(pipeline: Pipeline, path: Path, world: World, known: Mask, config: Config) -> None:
    reach = MODELS[config.twin.laser.model].usable_mm / 1000
    gvg = _gvg(path, world, known, config, reach)
    if gvg.edges:
        learn(pipeline, gvg, _looker(world, known, reach))


def _gvg(path: Path, world: World, known: Mask, config: Config, reach: float) -> LocalGvg:
    """The GVG of the largest part of the map that the robot can drive in."""
    reduction = config.autonomy.reduction
    room = config.robot.radius_m + config.autonomy.passage_margin_m
    grid = KnownGrid(_walls(world, known), known, world.resolution_m, np.array(world.origin))
    fine = fine_graph(
        grid,
        _somewhere(path, world, known, room),
        min_clearance=room,
        roughness=reduction.roughness_m,
        open_clearance=reduction.open_clearance(reach, config.autonomy.local_map.half_width_m),
    )
    return reduce_graph(fine, reduction)


def _somewhere(path: Path, world: World, known: Mask, room: float) -> Array:
    """The middle (2,), m, of the largest connected space with room for the robot."""
    free = known & ~world.occupied
    distance = np.asarray(ndimage.distance_transform_edt(np.pad(free, 1)))[1:-1, 1:-1]
    distance = distance * world.resolution_m
    labels, count = ndimage.label(distance > room)
    if not count:
        raise UsageError(f"{path}: nothing in it is free and wide enough for the robot")
    largest = _largest_inside(labels, 1 + int(room / world.resolution_m))
    row, column = np.unravel_index(
        int(np.argmax(np.where(labels == largest, distance, 0.0))), free.shape
    )
    middle: Array = _centres(world, np.array([row]), np.array([column]))[0]
    return middle


def _largest_inside(labels: NDArray[np.signedinteger], margin: int) -> int:
    """The largest space, but not that all around a building, as on a plan on white paper.

    This one comes close to all four sides of the image, within so many pixels. It counts if all
    others are mere holes in it.
    """
    sides = labels[:margin], labels[-margin:], labels[:, :margin], labels[:, -margin:]
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    inside = sizes.copy()
    inside[list(set.intersection(*({*np.unique(side).tolist()} for side in sides)))] = 0
    return int(np.argmax(inside if inside.max() > _HOLE * sizes.max() else sizes))


def _walls(world: World, known: Mask) -> Array:
    """Points (N, 2), m, on the faces of walls that look onto free space, not too many of them.

    A pixel in between may be unknown: beams have ended there and farther on.
    """
    free, around = known & ~world.occupied, np.ones((3, 3), np.bool_)
    doubtful = ndimage.binary_dilation(free, around) & ~known
    beside = ndimage.binary_dilation(free | doubtful, around)
    points = _centres(world, *np.nonzero(world.occupied & beside))
    return thinned(points, max(_MERGE_M, world.resolution_m))


def _centres(world: World, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
    """Of squares (N,), (N, 2) m."""
    squares = np.stack([columns, rows], axis=1) + 0.5
    return np.asarray(squares * world.resolution_m + np.array(world.origin))


def _looker(world: World, known: Mask, reach: float) -> Callable[[Pose], Scan]:
    """What a laser sees that looks all around; beams into the unknown, or outside, tell nothing."""
    bearings: Array = -math.pi + np.arange(_BEAMS, dtype=np.float64) * (math.tau / _BEAMS)
    unknown = np.pad(world.occupied | ~known, 1, constant_values=True)
    x, y = np.array(world.origin) - world.resolution_m
    beyond = World(unknown, world.resolution_m, (float(x), float(y)))

    def look(pose: Pose) -> Scan:
        ranges = world.cast(pose, bearings, reach)
        ranges[beyond.cast(pose, bearings, reach) < ranges - world.resolution_m / 2] = np.nan
        return Scan(0.0, ranges, -math.pi, math.tau / _BEAMS, 0.0, reach)

    return look
