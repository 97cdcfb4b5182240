"""The monitor as a program: watches one robot until a key or a signal ends it."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gvgbot import client
from gvgbot.client import Grid, Raster, Robot, Trajectory
from gvgbot.errors import GvgbotError, UsageError, underlying
from gvgbot.monitor.chart import Scene
from gvgbot.monitor.facts import Fact, headline
from gvgbot.monitor.screen import Picture, Screen
from gvgbot.monitor.terminal import keys, open_console
from gvgbot.monitor.view import Points
from gvgbot.stop_signals import StopSignals

_EVERY = 0.2  # s between pictures
_PATIENCE = 1.0  # s for a connection, before the screen says that there is none

Show = Callable[[Picture], None]


class Connection(NamedTuple):
    """Where to connect to, and with which keys."""

    endpoint: str
    zenoh_file: Path | None


def monitor(robot: str | None, endpoint: str, zenoh_file: Path | None = None) -> int:
    """Show a robot, or the only one there is, until q, Ctrl-C or another signal; 0.

    Raises UsageError if there is no terminal, if an argument cannot be right, or if several robots
    are there and none is named.
    """
    if robot is not None:
        client.connect(robot, endpoint)  # complains of wrong arguments before the screen is taken
    console = open_console()
    with StopSignals() as signals, console.screen():
        try:
            show, connection = Screen(console).show, Connection(endpoint, zenoh_file)
            asyncio.run(_until_told(signals, robot, connection, show))
        except* UsageError as errors:
            raise underlying(errors) from None
    return 0


async def _until_told(
    signals: StopSignals, robot: str | None, connection: Connection, show: Show
) -> None:
    quitting = asyncio.Event()

    def on_key(key: str) -> None:
        if key in "qQ":
            quitting.set()

    async with asyncio.TaskGroup() as tasks:
        watching = tasks.create_task(_keep_watching(robot, connection, show))
        ends = [tasks.create_task(quitting.wait()), tasks.create_task(signals.wait())]
        with keys(on_key):
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        for task in (watching, *ends):
            task.cancel()


async def _keep_watching(robot: str | None, connection: Connection, show: Show) -> None:
    """Watch, and say why if that is not possible just now."""
    endpoint, file = connection
    show(Picture(Fact("gvgbot", f"connecting to {endpoint}", "faint")))
    while True:
        try:
            only = partial(client.only_robot, endpoint, _PATIENCE, file)
            name = await asyncio.to_thread(only) if robot is None else robot
            async with client.connect(
                name, endpoint, patience_s=_PATIENCE, zenoh_file=file
            ) as seen:
                await _watch(seen, show)
        except UsageError:
            raise
        except GvgbotError as error:
            show(Picture(Fact("gvgbot", f"{error} (trying again)", "bad")))
            await asyncio.sleep(_EVERY)


async def _watch(robot: Robot, show: Show) -> None:
    grid, trajectory, health = robot.grid(), robot.trajectory(), robot.health()
    floor = _Floor()
    while True:
        presence, state = robot.presence, robot.state().latest
        others = await asyncio.to_thread(robot.others) if presence.word == "absent" else []
        pose = None if state is None or state.is_lost else state.pose
        scene = Scene(
            robot.map().latest,
            floor.of(grid.latest),
            _way(trajectory.latest, pose),
            robot.plan().latest,
            pose,
            () if state is None else tuple(mate.pose for mate in state.team),
        )
        picture = Picture(
            headline(robot.name, presence, state, others),
            state,
            scene,
            robot.events().latest,
            health.latest,
            is_fresh=presence.word in ("alive", "doubled"),
        )
        show(picture)
        await asyncio.sleep(_EVERY)


def _way(driven: Trajectory | None, pose: tuple[float, float, float] | None) -> list[Points]:
    """The way driven, in lines (N, 2), m, up to a pose, if that is known."""
    *others, line = [np.zeros((0, 2))] if driven is None else driven.stretches
    return [*others, line if pose is None else np.concatenate([line, [pose[:2]]])]


class _Floor:
    """The newest grid, unpacked once."""

    def __init__(self) -> None:
        self._grid: Grid | None = None
        self._raster: Raster | None = None

    def of(self, grid: Grid | None) -> Raster | None:
        """The cells of a grid. Raises GvgbotError if it is damaged."""
        if grid is not self._grid:
            self._grid = grid
            try:
                self._raster = None if grid is None else grid.raster()
            except ValueError as error:
                raise GvgbotError(f"a damaged sample of grid: {error}") from error
        return self._raster
