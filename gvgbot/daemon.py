"""The composition root: configuration to devices to one TaskGroup, and a map at the end."""

import asyncio
import contextlib
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

from gvgbot import __version__
from gvgbot.atomic_files import is_disk_full
from gvgbot.clock import LoopClock, VirtualTimeLoop
from gvgbot.config import Config
from gvgbot.driving import CARRIED, drive
from gvgbot.errors import GvgbotError, UsageError, extra_for, reason_of, underlying
from gvgbot.hal.messages import Odometry
from gvgbot.links import Devices, Links
from gvgbot.maps.picture import counts
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.persistence.start import begin, wanted
from gvgbot.progress import Progress
from gvgbot.recording import extra_needed
from gvgbot.robot import Robot
from gvgbot.ros2.node import Ros2Node
from gvgbot.service import (
    Notifier,
    give_back_large_arrays,
    set_up_logging,
    start_left_out_of_collections,
)
from gvgbot.session import Session
from gvgbot.simulation import Simulation, open_place
from gvgbot.stop_signals import StopSignals, standing_while_suspended
from gvgbot.strict_yaml import dump
from gvgbot.telemetry import Telemetry

if TYPE_CHECKING:  # it needs packages that only those have who want the live view
    from gvgbot.foxglove.server import FoxgloveServer

log = structlog.get_logger()


def explore(
    config: Config,
    say: Callable[[str], None],
    signals: StopSignals,
    *,
    out: Path | None,
    real_time: bool,
) -> int:
    """Explore a simulated world, say where the map is, and return the exit status.

    Raises UsageError for a world or directory that cannot be used, KeyboardInterrupt if a signal
    ended it; the map that there was by then is saved.
    """
    set_up_logging(sys.stderr, os.environ, "warning")
    give_back_large_arrays()
    place = open_place(config)
    with (
        RunDirectory.create(out, world=place.world.name) as directory,
        directory.told_if_interrupted(say),
    ):
        session, progress = Session(config, directory, place), Progress()
        factory = None if real_time else VirtualTimeLoop
        recording = recorded(session, patient=not real_time)
        try:
            with recording:
                signals.run(explore_once(session, progress), factory)
        except Exception as error:
            session.failure = reason_of(error)
            raise
        finally:
            progress.clear()
            Keeper(session, MissionFiles(directory.path)).finish()
            session.save()
    return _conclude(session, say)


async def explore_once(session: Session, progress: Progress) -> None:
    """Explore with the twins until there is an outcome, no more time, or nothing that it knows.

    The robot stands while a device is away; what is missing at the end is the session's failure.
    """
    assert session.place is not None
    clock, pipeline = LoopClock(), session.pipeline
    session.simulation = Simulation(session.config, session.place, clock)
    devices = Devices(Links(session.config, clock, session.simulation, session.tap))

    def on_cycle(odometry: Odometry) -> None:
        session.on_cycle(odometry, devices.base.contact)
        progress.show(pipeline, odometry.stamp)

    session.failure = await drive(
        session.config.robot,
        devices,
        pipeline,
        on_events=session.on_events,
        on_cycle=on_cycle,
        log=session.recorder,
        goes_on=lambda: pipeline.mission.outcome is None and not pipeline.errands.is_carried,
        limit_s=session.config.twin.time_limit_s,
    )
    if pipeline.errands.is_carried:  # nobody is there to resume it
        session.failure = CARRIED


def _conclude(session: Session, say: Callable[[str], None]) -> int:
    """Say the outcome and where the map is; the exit status."""
    mission, graph = session.pipeline.mission, session.pipeline.mapper.graph
    print(
        f"{mission.outcome or 'failed'}: {mission.reason or session.failure}; "
        f"{counts(graph.vertices, graph.edges)}, "
        f"{session.pipeline.past.travelled:.0f} m driven",
        file=sys.stdout if mission.outcome == "explored" else sys.stderr,
    )
    for line in session.directory.whereabouts:
        say(line)
    if session.recorder is not None:
        say(f"recording: {session.recorder.first}")
    return 0 if mission.outcome == "explored" else 1


def run(
    config: Config, signals: StopSignals, *, out: Path | None, known: Path | None, anew: bool
) -> int:
    """Be the daemon until a signal ends it; the exit status, 0 whatever was found by then.

    With a state directory it goes on with the map that it was making, unless `anew` or `out` say
    otherwise; `known` is the directory of a run whose map it begins with (default: `service.map`).

    Raises UsageError for a world or directory that cannot be used, GvgbotError if the network
    address is taken or the map cannot be written. Devices that are missing are waited for.
    """
    set_up_logging(sys.stderr, os.environ)
    give_back_large_arrays()
    place = open_place(config) if config.twin.enabled else None
    name = config.robot.name if place is None else place.world.name
    with contextlib.ExitStack() as stack:
        telemetry = _telemetry(config, stack)
        ros2, foxglove = _ros2(config, stack, telemetry), _foxglove(config, stack)
        asked = wanted(config, os.environ, out=out, known=known, anew=anew)
        start = begin(asked, world=name, stack=stack)
        session = Session(config, start.directory, place)
        keeper = Keeper(session, start.files, start.saved)
        network = "off" if telemetry is None else telemetry.addresses
        _announce(session, network, resumed=start.saved is not None)
        robot = Robot(
            session,
            Notifier.from_environment(),
            telemetry,
            keeper=keeper,
            neighbours=[near for near in (ros2, foxglove) if near is not None],
            driver=ros2,
            team=telemetry if config.team.enabled else None,
        )
        recording = recorded(session, patient=False)
        try:
            with recording, start_left_out_of_collections(), asyncio.Runner() as runner:
                runner.run(_serve(robot, signals))
        except* GvgbotError as failures:
            session.failure = reason_of(failures)
            raise underlying(failures) from None
        except* Exception as failures:
            session.failure = reason_of(failures)
            raise
        finally:
            _leave_map(session, keeper)
    return 0


def _leave_map(session: Session, keeper: Keeper) -> None:
    """Write what is known, if that is anything: each start without devices would leave a map."""
    if session.is_blank:
        session.directory.remove_blank()
        log.info("no map saved", reason="nothing was seen")
    else:
        keeper.finish()
        session.save()
        log.info("map saved", path=str(session.directory.path))


async def _serve(robot: Robot, signals: StopSignals) -> None:
    with standing_while_suspended(robot.stand):
        await robot.serve(signals.wait())


def recorded(session: Session, *, patient: bool) -> AbstractContextManager[object]:
    """What records a session, if that is wanted, until it is left.

    Who is not `patient` does without where the disk is full: a robot goes on after a power cut.
    Raises UsageError if nothing can be written there, GvgbotError without the packages for it.
    """
    if session.config.recording.path is None:
        return contextlib.nullcontext()
    about = {
        "title": session.title,
        "version": __version__,
        "config": dump(session.config),
        "resumed": "yes" if session.pipeline.past.keyframes else "no",
    }
    with session.directory.emptied_by_failure(), extra_needed():
        from gvgbot.recording.recorder import Recorder

        try:
            session.recorder = Recorder(session.config.recording, about, patient=patient)
        except UsageError as error:
            if patient or not is_disk_full(error.__cause__):
                raise
            log.warning("not recorded, exploring on", reason=str(error))
            return contextlib.nullcontext()
    session.recorder.map_base = lambda: session.pipeline.map_base
    log.info("recording", path=str(session.recorder.first))
    return session.recorder


def _telemetry(config: Config, stack: contextlib.ExitStack) -> Telemetry | None:
    if not config.telemetry.enabled:
        if config.team.enabled:
            raise UsageError("team.enabled needs the network: set telemetry.enabled=true as well")
        return None
    relays = config.team.enabled
    return stack.enter_context(Telemetry(config.telemetry, config.robot.name, relays=relays))


def _ros2(
    config: Config, stack: contextlib.ExitStack, telemetry: Telemetry | None
) -> Ros2Node | None:
    if not config.ros2.enabled:
        return None
    own = None if telemetry is None else telemetry.zid
    return stack.enter_context(Ros2Node(config.ros2, config.robot.name, telemetry=own))


def _foxglove(config: Config, stack: contextlib.ExitStack) -> "FoxgloveServer | None":
    if not config.foxglove.enabled:
        return None
    with extra_for("the live view needs foxglove-sdk", "foxglove", "foxglove"):
        from gvgbot.foxglove.server import FoxgloveServer
    return stack.enter_context(FoxgloveServer(config.foxglove, config.robot.name))


def _announce(session: Session, network: str, *, resumed: bool) -> None:
    config = session.config
    log.info(
        "started",
        version=__version__,
        robot=config.robot.name,
        world=None if session.place is None else session.place.world.name,
        laser="twin" if session.place else config.laser.port,
        base="twin" if session.place else config.base.port,
        network=network,
        out=str(session.directory.path),
        map="known" if resumed else "new",
    )
