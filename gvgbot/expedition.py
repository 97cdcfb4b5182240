"""Several simulated robots explore one world together; each has its own mind, devices and files."""

import asyncio
import contextlib
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import structlog

from gvgbot import __version__
from gvgbot.clock import LoopClock, VirtualTimeLoop
from gvgbot.config import Config
from gvgbot.drivers.people import Walkways
from gvgbot.driving import CARRIED, drive
from gvgbot.errors import UsageError, WorldError, reason_of
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Odometry
from gvgbot.links import Devices, Links
from gvgbot.live.team import member_of, steered
from gvgbot.maps import geojson
from gvgbot.maps.joined_graph import joined_graph
from gvgbot.maps.joined_grid import joined_grid
from gvgbot.maps.map_server import encode_map_server, read_map_server
from gvgbot.maps.occupancy import OccupancyGrid
from gvgbot.maps.picture import draw_map
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.maps.run_directory import MAP, PICTURE, RunDirectory
from gvgbot.report import with_room_of, world_files
from gvgbot.service import set_up_logging
from gvgbot.session import Session, Tally
from gvgbot.simulation import Place, Simulation, open_place
from gvgbot.stop_signals import StopSignals
from gvgbot.team.member import Member
from gvgbot.team.news import Course, News, decode, encode
from gvgbot.team.troubles import Troubles

log = structlog.get_logger()


_APART_M = 2.0  # between two starts, at least
_TRIES = 1000  # to draw a start


def explore_together(
    config: Config,
    count: int,
    say: Callable[[str], None],
    signals: StopSignals,
    *,
    out: Path | None,
    real_time: bool,
) -> int:
    """Explore a simulated world with several robots, say where the map is; the exit status.

    Raises UsageError for a world or directory that cannot be used, or that has no room for all, and
    if it shall be recorded or has virtual walls; KeyboardInterrupt if a signal ended it.
    """
    if config.recording.path is not None:
        raise UsageError("recording.path: a team is not recorded; record a robot that is alone")
    if config.autonomy.virtual_walls:
        raise UsageError(
            "autonomy.virtual_walls: they are on the map of one robot; explore without --robots"
        )
    set_up_logging(sys.stderr, os.environ, "warning")
    places = _places(config, open_place(config), count)
    with contextlib.ExitStack() as stack:
        directory = stack.enter_context(RunDirectory.create(out, world=places[0].world.name))
        stack.enter_context(directory.told_if_interrupted(say))
        robots = [
            _Robot.made(stack, config, number, one, directory.path)
            for number, one in enumerate(places)
        ]
        try:
            factory = None if real_time else VirtualTimeLoop
            signals.run(_explore(robots, config), factory)
        except Exception as error:
            for robot in robots:
                robot.session.failure = robot.session.failure or reason_of(error)
            raise
        finally:
            for robot in robots:
                robot.session.save()
            joined = _save(directory, robots)
    return _conclude(directory, robots, joined, say)


def _places(config: Config, place: Place, count: int) -> list[Place]:
    """The world as each robot finds it. Raises WorldError if there is no room."""
    starts = _starts(config, place, count)
    walkways = place.walkways and Walkways(place.world, place.start, starts[1:])
    return [replace(place, start=start, walkways=walkways) for start in starts]


def _starts(config: Config, place: Place, count: int) -> list[Pose]:
    """Where the robots start: the first one where it would alone, the others by the seed.

    Raises WorldError if there is no room.
    """
    rng = np.random.default_rng(np.random.SeedSequence([config.twin.seed, count]))
    no_room = WorldError(f"world {place.world.name}: no room for {count} robots; take fewer")
    try:
        free, starts = Walkways(place.world, place.start).points, [place.start]
    except WorldError:
        raise no_room from None
    for _ in range(_TRIES):
        if len(starts) == count:
            return starts
        x, y = free[rng.integers(len(free))].tolist()
        start = Pose(x, y, float(rng.uniform(-np.pi, np.pi)))
        if all(start.distance(other) >= _APART_M for other in starts):
            starts.append(start)
    raise no_room


@dataclass(slots=True, eq=False)
class _Robot:
    session: Session
    member: Member
    told: float = -math.inf  # stamp of its news
    steered: float = -math.inf  # stamp of its course
    ended: float | None = None  # stamp of its outcome, or of the end of its time
    sent_bytes: int = 0
    is_broken: bool = False  # and cannot even tell of it

    @property
    def is_over(self) -> bool:
        """Whether it has done all it can."""
        return self.ended is not None

    @classmethod
    def made(
        cls, stack: contextlib.ExitStack, config: Config, number: int, place: Place, out: Path
    ) -> "_Robot":
        """A robot with a name, errors and a run directory of its own."""
        name = f"robot-{number + 1}"
        seeds = np.random.SeedSequence(config.twin.seed).generate_state(number + 1)
        seed = config.twin.seed if number == 0 else int(seeds[number])
        config = replace(
            config,
            robot=replace(config.robot, name=name),
            twin=replace(
                config.twin, seed=seed, start=(place.start.x, place.start.y, place.start.theta)
            ),
        )
        directory = stack.enter_context(RunDirectory.create(out / name, world=name))
        session = Session(config, directory, place)
        return cls(session, member_of(config.robot, config.team, session.pipeline))


class _Air:
    """What robots tell each other by, in a world with troubles."""

    def __init__(self, robots: list[_Robot], troubles: Troubles, clock: LoopClock) -> None:
        self.robots, self.troubles = robots, troubles
        self._clock, self._began = clock, clock.now()

    async def until(self, seconds: float) -> None:
        """Wait until so many seconds after the beginning."""
        await self._clock.sleep_until(self._began + seconds)

    @property
    def is_quiet(self) -> bool:
        """Whether nobody explores any more."""
        return all(robot.is_over for robot in self.robots)

    def send(self, told: News | Course, robot: _Robot) -> None:
        """Let the others hear something, as bytes, if the network is there."""
        data, seconds = encode(told), self._clock.now() - self._began
        if self.troubles.is_silent(self.robots.index(robot), seconds):
            return
        robot.sent_bytes += len(data)
        for number, other in enumerate(self.robots):
            if other is not robot and not self.troubles.is_silent(number, seconds):
                other.member.hear(decode(data), self._clock.now())


async def _explore(robots: list[_Robot], config: Config) -> None:
    """Let all of them explore until each has an outcome, or there is no more time."""
    clock = LoopClock()
    troubles = Troubles(config.twin.team, len(robots), config.twin.seed)
    air = _Air(robots, troubles, clock)
    simulations: list[Simulation] = []
    for robot in robots:
        people = simulations[0].people if simulations else None
        place = _place(robot.session)
        simulations.append(Simulation(robot.session.config, place, clock, people))
    for robot, simulation in zip(robots, simulations, strict=True):
        robot.session.simulation = simulation
        simulation.meet(other for other in simulations if other is not simulation)
    async with asyncio.TaskGroup() as tasks:
        for robot in robots:
            tasks.create_task(_live(robot, air, clock), name=robot.member.name)


def _place(session: Session) -> Place:
    assert session.place is not None
    return session.place


async def _live(robot: _Robot, air: _Air, clock: LoopClock) -> None:
    """One robot's exploration; it stands in the world, and tells the others, until all are done."""
    session, number = robot.session, air.robots.index(robot)
    sets_out, breaks_down = air.troubles.sets_out_s(number), air.troubles.breaks_down_s(number)
    await air.until(sets_out)
    devices = Devices(Links(session.config, clock, session.simulation, session.tap))
    limit, lasts = session.config.twin.time_limit_s, breaks_down - sets_out
    trouble = await drive(
        session.config.robot,
        devices,
        session.pipeline,
        on_events=session.on_events,
        on_cycle=partial(_on_cycle, robot, air, devices),
        goes_on=lambda: not air.is_quiet,  # and keeps out of the way of who explores
        limit_s=min(limit, lasts),
    )
    if trouble is not None and not robot.is_over:
        robot.is_broken = lasts < limit
        broken = f"it broke down after {breaks_down:.0f} s, as configured"
        session.failure = broken if robot.is_broken else trouble
    if not robot.is_over:
        robot.ended = clock.now()
    while not (air.is_quiet or robot.is_broken):
        _tell(robot, air, clock.now())
        await clock.sleep_until(clock.now() + session.config.team.tell_every_s)


def _on_cycle(robot: _Robot, air: _Air, devices: Devices, odometry: Odometry) -> None:
    robot.session.on_cycle(odometry, devices.base.contact)
    pipeline, config = robot.session.pipeline, robot.session.config.team
    is_carried = pipeline.errands.is_carried  # and nobody is there to resume it
    if is_carried and not robot.is_over:
        robot.session.failure = CARRIED
    if not robot.is_over and (is_carried or pipeline.mission.outcome is not None):
        robot.ended, robot.told = odometry.stamp, -math.inf  # the others shall hear of it now
    if odometry.stamp >= robot.steered + config.steer_every_s:
        robot.steered = odometry.stamp
        air.send(steered(robot.member, pipeline, odometry.stamp), robot)
        robot.member.look(odometry.stamp)
        for met in robot.member.met:
            log.info("maps joined", robot=robot.member.name, other=met.robot)
        robot.member.met.clear()
    if odometry.stamp >= robot.told + config.tell_every_s:
        _tell(robot, air, odometry.stamp)


def _tell(robot: _Robot, air: _Air, stamp: float) -> None:
    """Let the others hear the news."""
    robot.told = stamp
    pipeline = robot.session.pipeline
    air.send(robot.member.news(stamp, pipeline.map_base, finished=robot.is_over), robot)


def _save(directory: RunDirectory, robots: list[_Robot]) -> list[_Robot]:
    """Write the map of all whose maps could be joined to one; which these are, that one first.

    It is the map of who knows most others, and of these the one with most vertices.
    """
    for robot in robots:
        robot.member.look(robot.told, at_last=True)
    first = max(robots, key=lambda r: (len(r.member.frames), len(_graph(r).vertices)))
    poses = {first.member.name: Pose()} | first.member.frames
    others = [robot for robot in robots if robot is not first and robot.member.name in poses]
    joined = [first, *others]
    graph, grid = joined_map(
        [(_graph(robot), _grid(robot), poses[robot.member.name]) for robot in joined],
        [way for robot in joined for way in _ways(robot, poses)],
    )
    world = _place(first.session).world
    files = world_files(world)
    files[MAP] = geojson.encode(graph)
    files |= encode_map_server(grid)
    files[PICTURE] = draw_map(graph, grid=grid, title=world.name)
    directory.write(files)
    directory.write_summary(_summary(robots, joined, poses, graph))
    return joined


def joined_map(
    maps: Sequence[tuple[RouteGraph, OccupancyGrid, Pose]], ways: Sequence[tuple[Array, float]]
) -> tuple[RouteGraph, OccupancyGrid]:
    """The maps of several robots as one, each with the pose of its frame in that of the result.

    `ways` are the parts of edges that they have driven, in the result: lines (N, 2) and their
    least clearances, m. The graph claims no more room than there is in the grid of all.
    """
    graph = joined_graph([(graph, pose) for graph, _, pose in maps], ways)
    grid = joined_grid([(grid, pose) for _, grid, pose in maps])
    return with_room_of(graph, grid), grid


def _ways(robot: _Robot, poses: dict[str, Pose]) -> list[tuple[Array, float]]:
    """The parts of edges that a robot has driven, in the joined map."""
    pose = poses[robot.member.name]
    parts = robot.session.pipeline.mission.parts()
    return [(pose.transform(line), clearance) for line, clearance in parts]


def _graph(robot: _Robot) -> RouteGraph:
    path = robot.session.directory.path / MAP
    return geojson.decode(path.read_text(encoding="utf-8"))


def _grid(robot: _Robot) -> OccupancyGrid:
    return read_map_server(robot.session.directory.path)


def _summary(
    robots: list[_Robot], joined: list[_Robot], poses: dict[str, Pose], graph: RouteGraph
) -> dict[str, object]:
    missions = [robot.session.pipeline.mission for robot in robots]
    tallies = [robot.session.tally for robot in robots]
    return {
        "outcome": _outcome(robots),
        "reason": "; ".join(
            f"{r.member.name}: {m.reason or r.session.failure or 'stopped from outside'}"
            for r, m in zip(robots, missions, strict=True)
        ),
        "robots": [robot.member.name for robot in robots],
        "joined": [robot.member.name for robot in joined],
        "frames": {name: (pose.x, pose.y, pose.theta) for name, pose in poses.items()},
        "distance_m": sum(robot.session.pipeline.past.travelled for robot in robots),
        "duration_s": lasted(tallies),
        "durations_s": [_duration(robot) for robot in robots],
        "vertices": len(graph.vertices),
        "edges": len(graph.edges),
        "sent_bytes": [robot.sent_bytes for robot in robots],
        "contacts": sum(robot.session.contacts for robot in robots),
        "seed": robots[0].session.config.twin.seed,
        "version": __version__,
    }


def _outcome(robots: list[_Robot]) -> str:
    """Explored, if that is what all say that can still say something."""
    outcomes = [r.session.pipeline.mission.outcome or "failed" for r in robots if not r.is_broken]
    return next((outcome for outcome in outcomes if outcome != "explored"), "explored")


def _duration(robot: _Robot) -> float:
    tally = robot.session.tally
    return lasted([tally if robot.ended is None else replace(tally, last_stamp=robot.ended)])


def lasted(tallies: Sequence[Tally]) -> float:
    """Seconds from the first control cycle of several robots to the last; 0 if there was none."""
    first = [tally.first_stamp for tally in tallies if tally.first_stamp is not None]
    return max(tally.last_stamp for tally in tallies) - min(first) if first else 0.0


def _conclude(
    directory: RunDirectory,
    robots: list[_Robot],
    joined: list[_Robot],
    say: Callable[[str], None],
) -> int:
    """Say the outcome and where the map is; the exit status."""
    for robot in robots:
        mission = robot.session.pipeline.mission
        say(
            f"{robot.member.name}: {mission.outcome or 'failed'}: "
            f"{mission.reason or robot.session.failure}; "
            f"{robot.session.pipeline.past.travelled:.0f} m driven in {_duration(robot):.0f} s"
        )
    say(f"maps joined: {len(joined)} of {len(robots)}")
    for line in directory.whereabouts:
        say(line)
    return 0 if _outcome(robots) == "explored" else 1
