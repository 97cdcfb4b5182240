"""From a robot to the viewers: connects, passes on what it says, asks it for things."""

import asyncio
import math
from collections import deque
from collections.abc import AsyncIterable, Callable
from functools import partial
from pathlib import Path
from typing import Any

from gvgbot import client
from gvgbot.client import Asking, Grid, Robot, State
from gvgbot.client.newest import Newest
from gvgbot.errors import GvgbotError, UsageError, reason_of, underlying
from gvgbot.requests import Goto, Patrol, Set
from gvgbot.tiles import Tile
from gvgbot.topics import Events
from gvgbot.web.viewers import Audience
from gvgbot.web.wire import Floor, History, Known, Link, Reply, Wish

_PATIENCE = 1.0  # s for a connection, before the page says that there is none
_BEAT = 0.5  # s between words on how things are
_SILENT = 2.0  # s without such a word; a page gives up after four
_PAUSE = 0.1  # s between two values of a kind: more often nobody sees
_SAMPLE_EVERY, _SAMPLES = 2.0, 900  # s of the robot's clock, and how many: half an hour


class Feed:
    """Watches one robot, or the only one there is, for an audience."""

    def __init__(
        self,
        robot: str | None,
        endpoint: str,
        zenoh_file: Path | None,
        audience: Audience,
        *,
        on_link: Callable[[Link], None] = lambda _: None,
    ) -> None:
        """`on_link` hears how things are with the robot, over and over."""
        self._name, self._endpoint, self._file = robot, endpoint, zenoh_file
        self._audience, self._on_link = audience, on_link
        self._robot: Robot | None = None
        self._life: str | None = None  # of the robot, that the audience knows of
        self._began: float | None = None  # of its grid
        self._tiles: dict[tuple[int, int], Tile] = {}  # of its grid
        self._told: Events | None = None  # of this life
        self._history = _Histories()
        self._lost_at: float | None = None  # by the loop's clock; None while connected
        self._trouble = f"looking for a robot at {endpoint}"  # why there is no connection
        self._told_at = 0.0  # by the loop's clock, how things are

    async def run(self) -> None:
        """Watch until cancelled, and say why if that is not possible just now.

        Raises UsageError if several robots are there and none is named.
        """
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._keep_watching(), name="watch")
                tasks.create_task(self._repeat_why(), name="repeat why")
        except* UsageError as errors:
            raise underlying(errors) from None

    async def _repeat_why(self) -> None:
        """Say again why there is no connection while it takes long to find that out anew.

        A name server may be silent for half a minute, and a page that hears nothing for some
        seconds takes this program for gone.
        """
        loop = asyncio.get_running_loop()
        self._told_at = loop.time()
        while True:
            await asyncio.sleep(_BEAT)
            if self._robot is None and loop.time() > self._told_at + _SILENT:
                self._say_why(self._trouble)

    async def _keep_watching(self) -> None:
        while True:
            try:
                await self._connect()
            except* UsageError as errors:
                raise underlying(errors) from None
            except* GvgbotError as errors:
                self._say_why(reason_of(errors))
            await asyncio.sleep(_BEAT)

    async def _connect(self) -> None:
        only = partial(client.only_robot, self._endpoint, _PATIENCE, self._file)
        name = await asyncio.to_thread(only) if self._name is None else self._name
        seen = client.connect(name, self._endpoint, patience_s=_PATIENCE, zenoh_file=self._file)
        async with seen as robot:
            self._robot, self._lost_at = robot, None
            try:
                await self._watch(robot)
            finally:
                self._robot = None

    def _say_why(self, trouble: str) -> None:
        self._trouble, now = trouble, asyncio.get_running_loop().time()
        self._lost_at = now if self._lost_at is None else self._lost_at
        said = Link(
            robot=self._name,
            endpoint=self._endpoint,
            word="unreachable",
            for_s=now - self._lost_at,
            trouble=trouble,
        )
        self._show_link(said)

    def _show_link(self, link: Link) -> None:
        self._told_at = asyncio.get_running_loop().time()
        self._audience.show("link", link)
        self._on_link(link)

    async def _watch(self, robot: Robot) -> None:
        async with asyncio.TaskGroup() as tasks:
            for kind, newest in _said_by(robot).items():
                tasks.create_task(self._pass_on(robot, kind, newest))
            tasks.create_task(self._remember(robot.state()))
            tasks.create_task(self._keep_telling(robot))

    async def _pass_on(self, robot: Robot, kind: Known, newest: Newest[Any]) -> None:
        async for value in newest:
            if not self._has_begun_anew(robot):
                self._show(kind, value)
            await asyncio.sleep(_PAUSE)

    def _has_begun_anew(self, robot: Robot) -> bool:
        """Whether another life of the robot speaks: then all that this one has said is shown.

        What was read just before may be of the other one.
        """
        life = robot.life
        if life is None or life == self._life:
            return False
        self._life, self._began, self._tiles, self._told = life, None, {}, None
        self._audience.begin_anew(life)
        for kind, newest in _said_by(robot).items():
            if (value := newest.latest) is not None:
                self._show(kind, value)
        return True

    def _show(self, kind: Known, value: Any) -> None:
        if isinstance(value, Grid):
            self._show_tiles(value)
        else:
            self._audience.show(kind, value)

    def _show_tiles(self, grid: Grid) -> None:
        """Send of each grid what is new in it."""
        if grid.began != self._began:
            self._began, self._tiles = grid.began, {}
            self._audience.forget("tile")
            self._audience.show("floor", Floor(resolution=grid.resolution, side=grid.side))
        for tile in grid.tiles:
            place = tile.row, tile.column
            if self._tiles.get(place) != tile:
                self._tiles[place] = tile
                self._audience.show("tile", tile, place)

    async def _remember(self, states: AsyncIterable[State]) -> None:
        """Keep a history for those who come later."""
        async for state in states:
            if self._history.add(state):
                self._audience.keep("history", self._history.columns())

    async def _keep_telling(self, robot: Robot) -> None:
        """Say how things are with the robot, and what has happened."""
        while True:
            self._show_link(await self._link(robot))
            self._has_begun_anew(robot)
            happened = Events(events=robot.events().latest)
            if happened != self._told:
                self._told = happened
                self._audience.show("events", happened)
            await asyncio.sleep(_BEAT)

    async def _link(self, robot: Robot) -> Link:
        """How things are with a robot to whose address there was a connection."""
        presence = robot.presence
        others = await asyncio.to_thread(robot.others) if presence.word == "absent" else []
        return Link(
            robot=robot.name,
            endpoint=self._endpoint,
            word=presence.word,
            for_s=presence.for_s,
            others=tuple(others),
        )

    async def fulfil(self, wish: Wish) -> Reply:
        """Ask the robot for what somebody wants, and wait for its answer."""
        try:
            text, done = await self._ask(wish), True
        except (GvgbotError, ValueError) as error:
            text, done = str(error), False
        return Reply(id=wish.id, done=done, text=text)

    def _ask(self, wish: Wish) -> Asking:
        robot = self._robot
        if robot is None:
            raise GvgbotError("there is no connection to the robot")
        match wish.typed:
            case Goto(vertex=None, x=float(x), y=float(y)):
                return robot.goto(x, y)
            case Goto(vertex=int(vertex)):
                return robot.goto(vertex)
            case Set(key=key, value=value):
                return robot.set(key, value)
            case Patrol(vertices=vertices):
                return robot.patrol(*vertices)
            case _:
                ask: Callable[[], Asking] = getattr(robot, wish.name)
                return ask()


def _said_by(robot: Robot) -> dict[Known, Newest[Any]]:
    """What a robot says all the time; its grid goes on in tiles."""
    return {
        "state": robot.state(),
        "map": robot.map(),
        "tile": robot.grid(),
        "trajectory": robot.trajectory(),
        "plan": robot.plan(),
        "health": robot.health(),
        "odometry": robot.odometry(),
        "scan": robot.scan(),
    }


class _Histories:
    """The last half hour of a robot's state, thinned."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float | None, float | None]] = deque(maxlen=_SAMPLES)

    def add(self, state: State) -> bool:
        """Take a state, if it is time for the next; whether it was."""
        last = self._samples[-1][0] if self._samples else -math.inf
        if state.stamp < last:  # the robot began anew
            self._samples.clear()
        elif state.stamp < last + _SAMPLE_EVERY:
            return False
        sigma = None if state.is_lost else state.position_sigma
        self._samples.append((state.stamp, sigma, state.battery_fraction))
        return True

    def columns(self) -> History:
        stamps, sigmas, batteries = zip(*self._samples, strict=True)
        return History(stamps=stamps, sigmas=sigmas, batteries=batteries)
