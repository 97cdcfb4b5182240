"""A robot seen over the network: its newest state and map, its events, and whether it is there."""

import asyncio
import contextlib
import operator
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, Self, TypeVar, overload

import zenoh

from gvgbot.client.asking import PATIENCE_S, Asking, answer_of, ask
from gvgbot.client.event_stream import EventStream
from gvgbot.client.network import (
    DEFAULT_ENDPOINT,
    SETTLING,
    check_endpoint,
    names_on,
    open_session,
    subscribe,
)
from gvgbot.client.newest import Newest, decoded
from gvgbot.client.presence import Presence, Signs
from gvgbot.client.tiles import Tiles
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.names import is_robot_name
from gvgbot.requests import Arguments, Goto, Nothing, Patrol, RequestName, Set
from gvgbot.tiles import Grid
from gvgbot.topics import (
    EVENTS,
    GRID,
    HEALTH,
    MAP,
    ODOMETRY,
    PLAN,
    SCAN,
    STATE,
    TRAJECTORY,
    Events,
    Health,
    Map,
    Odometry,
    Payload,
    Plan,
    Scan,
    State,
    Topic,
    Trajectory,
    alive_key,
)

_ASK_AGAIN_S = 1.0

T = TypeVar("T", bound=Payload)


def connect(
    robot: str,
    endpoint: str = DEFAULT_ENDPOINT,
    *,
    patience_s: float = 10.0,
    zenoh_file: Path | None = None,
) -> "Robot":
    """A robot by its name, to be entered with `with` or `async with`.

    `endpoint` is the address of the robot or of a zenoh router. Entering raises GvgbotError if
    nobody answers there for as long as the patience lasts; whether the robot itself is there, now
    or later, its `presence` tells. A connection that is lost later is made again by itself.
    `zenoh_file` (JSON5) has keys and passwords; an address in it replaces the default one. It is
    read when the robot is entered, which raises UsageError if it cannot be used.
    Raises UsageError for a name or an address that cannot be one.
    """
    if not is_robot_name(robot):
        raise UsageError(f"no robot can be named {robot!r}: letters, digits, - and _ only")
    check_endpoint(endpoint)
    return Robot(robot, endpoint, patience_s, zenoh_file)


class Robot:
    """One robot; made by `connect`. What it says is kept up to date whether it is read or not."""

    def __init__(
        self, name: str, endpoint: str, patience_s: float, zenoh_file: Path | None = None
    ) -> None:
        self.name, self.endpoint = name, endpoint
        self._patience_s, self._zenoh_file = patience_s, zenoh_file
        self._session: zenoh.Session | None = None
        self._state: Newest[State] = Newest()
        self._map: Newest[Map] = Newest()
        self._events: Newest[Events] = Newest()
        self._plan: Newest[Plan] = Newest()
        self._odometry: Newest[Odometry] = Newest()
        self._scan: Newest[Scan] = Newest()
        self._trajectory: Newest[Trajectory] = Newest()
        self._health: Newest[Health] = Newest()
        self._grid: Newest[Grid] = Newest()
        self._all: tuple[Newest[Any], ...] = (
            *(self._state, self._map, self._grid, self._trajectory, self._events, self._plan),
            *(self._health, self._odometry, self._scan),
        )
        self._heard: set[Topic] = set()  # that were subscribed to
        self._life: str | None = None
        self._tiles = self._tiles_of(None)  # of this life
        self._earlier: tuple[str | None, Sequence[Any], Tiles] = None, (), self._tiles
        self._life_gate = threading.RLock()  # samples come in several threads
        self._signs = Signs(0.0)
        self._gate = threading.RLock()  # one of opening and closing at a time
        self._is_closed = False
        self._has_been_seen = threading.Event()

    # -- what the robot says -----------------------------------------------------------------------

    def state(self) -> Newest[State]:
        """Its state, a few times a second."""
        return self._state

    def map(self) -> Newest[Map]:
        """Its graph, each time it has grown."""
        return self._map

    def grid(self) -> Newest[Grid]:
        """Walls and floor, each time they have grown: tiles, which `raster()` joins to an array.

        Sent from the first call on; missing tiles are asked for.
        """
        self._subscribe(GRID, self._on_tiles)
        return self._grid

    def trajectory(self) -> Newest[Trajectory]:
        """The way driven, each time it has grown: `map_base` and `times` are arrays.

        Sent from the first call on.
        """
        self._hear(TRAJECTORY, Trajectory, self._trajectory)
        return self._trajectory

    def health(self) -> Newest[Health]:
        """How its program and its links are doing, once a second; sent from the first call on."""
        self._hear(HEALTH, Health, self._health)
        return self._health

    def events(self) -> EventStream:
        """What happens, one after another; those of the last minutes first."""
        return EventStream(self._events)

    def plan(self) -> Newest[Plan]:
        """Where it goes, and why, each time that this changes."""
        return self._plan

    def odometry(self) -> Newest[Odometry]:
        """Its pose and its speed, many times a second; sent from the first call on."""
        self._hear(ODOMETRY, Odometry, self._odometry)
        return self._odometry

    def scan(self) -> Newest[Scan]:
        """What its laser sees; sent from the first call on."""
        self._hear(SCAN, Scan, self._scan)
        return self._scan

    @property
    def life(self) -> str | None:
        """Which start of the robot's program speaks: its id on the network, None before a word.

        When it changes, all that an earlier one has said is forgotten.
        """
        return self._life

    @property
    def presence(self) -> Presence:
        """Whether the robot is there."""
        return self._signs.presence(time.perf_counter(), linked=self._is_linked())

    def others(self) -> list[str]:
        """The names of all robots on this network now. Raises GvgbotError if it is closed."""
        assert self._session is not None, "the robot is not connected: use `with`"
        try:
            return names_on(self._session)
        except zenoh.ZError as error:
            raise GvgbotError("the connection to the robot is closed") from error

    def _is_linked(self) -> bool:
        if self._session is None:
            return False
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    # -- what it can be asked for ------------------------------------------------------------------
    #
    # Each is sent at once; `await` what it returns, or call its `result()`, for what the robot does
    # now. Both raise Refused with its reason, GvgbotError if there is no answer.

    def pause(self) -> Asking:
        """Stand still, until `resume`."""
        return self._ask("pause")

    def resume(self) -> Asking:
        """Go on with what was paused."""
        return self._ask("resume")

    def stop(self) -> Asking:
        """End the exploration, and save the map."""
        return self._ask("stop")

    def home(self) -> Asking:
        """Drive to where it started."""
        return self._ask("home")

    @overload
    def goto(self, place: int, /) -> Asking: ...
    @overload
    def goto(self, place: float, y: float, /) -> Asking: ...
    def goto(self, place: float, y: float | None = None, /) -> Asking:
        """Drive to a vertex by its id, or to a point x, y, m, in the map frame."""
        if y is None:
            return self._ask("goto", Goto(vertex=operator.index(place)))  # type: ignore[arg-type]
        return self._ask("goto", Goto(x=place, y=y))

    def patrol(self, *vertices: int) -> Asking:
        """Drive from vertex to vertex, over and over; to all if none is named, as by `*[]`."""
        return self._ask("patrol", Patrol(vertices=vertices))

    def coverage(self) -> Asking:
        """Drive over every edge once."""
        return self._ask("coverage")

    def explore(self) -> Asking:
        """Go on exploring, also after the end."""
        return self._ask("explore")

    def relocalise(self) -> Asking:
        """Look around, and find its place in the map again."""
        return self._ask("relocalise")

    def save(self) -> Asking:
        """Save the map now."""
        return self._ask("save")

    def set(self, key: str, value: bool | float | str) -> Asking:
        """Change one of the configuration's keys that can be changed while the robot runs."""
        return self._ask("set", Set(key=key, value=value))

    def _ask(self, name: RequestName, arguments: Arguments | None = None) -> Asking:
        assert self._session is not None, "the robot is not connected: use `with`"
        return ask(self._session, self.name, name, arguments or Nothing())

    # -- coming and going --------------------------------------------------------------------------

    def open(self) -> None:
        """Connect, and look for the robot; blocks. Raises GvgbotError if nobody answers."""
        session = open_session(self.endpoint, self._patience_s, self._zenoh_file)
        with self._gate:
            self._session = session
            if self._is_closed:  # by somebody who did not want to wait
                self._session.close()
                return
            self._begin(session)
        self._has_been_seen.wait(SETTLING)

    def _begin(self, session: zenoh.Session) -> None:
        via_router = bool(session.info.routers_zid())
        self._signs = Signs(time.perf_counter(), via_router=via_router)
        session.liveliness().declare_subscriber(alive_key(self.name), self._on_token, history=True)
        self._hear(STATE, State, self._state)
        self._hear(MAP, Map, self._map)
        self._hear(EVENTS, Events, self._events)
        self._hear(PLAN, Plan, self._plan)

    def _hear(self, topic: Topic, payload: type[T], newest: Newest[T]) -> None:
        """Put each sample of a topic into a box from now on, if that is still to do."""
        self._subscribe(topic, partial(self._on_sample, topic, payload, newest))

    def _subscribe(self, topic: Topic, on_sample: Callable[[zenoh.Sample], None]) -> None:
        """Hear a topic from now on, if that is still to do, and the last sample before."""
        with self._gate:
            assert self._session is not None, "the robot is not connected: use `with`"
            if topic not in self._heard and not self._is_closed:
                self._heard.add(topic)
                subscribe(self._session, topic, topic.key(self.name), on_sample)

    def _on_sample(
        self, topic: Topic, payload: type[T], newest: Newest[T], sample: zenoh.Sample
    ) -> None:
        encoding, data = str(sample.encoding), sample.payload.to_bytes()
        with self._life_gate:  # until it is put among what the same one has said
            self._note_life(sample)
            newest.put(partial(decoded, topic, payload, encoding, data))
        if topic is STATE:
            self._signs.heard_at = time.perf_counter()

    def _note_life(self, sample: zenoh.Sample) -> None:
        """Forget what was said before, if another start of the robot's program has sent this.

        Unless the one before that speaks again, as when two robots have one name. And tell a router
        from a robot that is one for its team.
        """
        if self._session is None or sample.source_info is None:
            return
        life = str(sample.source_info.source_id.zid)
        if life == self._life:
            return
        earlier, said, tiles = self._earlier
        if life == earlier:
            self._signs.doubled_at = time.perf_counter()
        else:
            said, tiles = [None] * len(self._all), self._tiles_of(life)
        swapped = [box.swap(read) for box, read in zip(self._all, said, strict=True)]
        self._earlier = self._life, swapped, self._tiles
        self._life, self._tiles = life, tiles
        routers = {str(one) for one in self._session.info.routers_zid()}
        self._signs.via_router = bool(routers) and life not in routers

    def _on_tiles(self, sample: zenoh.Sample) -> None:
        with self._life_gate:
            self._note_life(sample)
            try:
                self._tiles.take(_grid_in(sample))
            except GvgbotError as error:
                self._grid.put(partial(_fail, error))

    def _tiles_of(self, life: str | None) -> Tiles:
        return Tiles(self._grid, partial(self._ask_for_tiles, life))

    def _ask_for_tiles(self, life: str | None) -> None:
        """Ask for the whole grid of a life, without waiting."""
        replies = list[zenoh.Reply]()

        def answered() -> None:
            with self._life_gate:
                sample = answer_of(life, replies) if life == self._life else None
                if sample is not None:
                    self._take_all(sample)
                elif life in (self._life, self._earlier[0]):  # too early, or another speaks
                    timer = threading.Timer(_ASK_AGAIN_S, self._ask_for_tiles, [life])
                    timer.daemon = True
                    timer.start()

        assert self._session is not None
        with contextlib.suppress(zenoh.ZError):  # closed meanwhile
            self._session.get(
                GRID.key(self.name),
                zenoh.handlers.Callback(replies.append, answered),
                timeout=PATIENCE_S,
                consolidation=zenoh.ConsolidationMode.NONE,  # each of those who have the name
            )

    def _take_all(self, sample: zenoh.Sample) -> None:
        try:
            self._tiles.take_all(_grid_in(sample))
        except GvgbotError as error:
            self._tiles.give_up()
            self._grid.put(partial(_fail, error))

    def _on_token(self, sample: zenoh.Sample) -> None:
        self._signs.has_token = sample.kind == zenoh.SampleKind.PUT
        self._signs.token_at = time.perf_counter()
        self._has_been_seen.set()

    def close(self) -> None:
        """Leave the network, and end all iterations."""
        for newest in self._all:
            newest.close()
        with self._gate:
            self._is_closed = True
            if self._session is not None:
                with contextlib.suppress(zenoh.ZError):  # the other end is frozen
                    self._session.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        try:
            await asyncio.to_thread(self.open)
        except asyncio.CancelledError:  # the thread goes on until the patience ends
            self.close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        try:
            await asyncio.to_thread(self.close)
        except asyncio.CancelledError:  # perhaps before a thread was free for it
            self.close()
            raise


def _grid_in(sample: zenoh.Sample) -> Grid:
    """Raises GvgbotError if it is of another version, or damaged."""
    return decoded(GRID, Grid, str(sample.encoding), sample.payload.to_bytes())


def _fail(error: GvgbotError) -> NoReturn:
    raise error
