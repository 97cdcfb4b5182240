"""The composition root: configuration to devices to one TaskGroup, and a map at the end."""

import asyncio
import time
from dataclasses import replace
from pathlib import Path

from gvgbot import __version__
from gvgbot.autonomy import events
from gvgbot.autonomy.loop import Loop
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, VirtualTimeLoop
from gvgbot.config import Config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.transport import SerialStream
from gvgbot.errors import GvgbotError
from gvgbot.geometry import Pose
from gvgbot.hal.guard import Guard
from gvgbot.hal.messages import Odometry
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.progress import Progress
from gvgbot.report import Journey, map_files, world_files
from gvgbot.simulation import Place, Simulation, open_place


def explore(config: Config, *, out: Path | None, real_time: bool) -> int:
    """Explore a simulated world, print where the map is, and return the exit status.

    Raises UsageError for a world or directory that cannot be used, GvgbotError when a device fails.
    """
    place = open_place(config)
    with RunDirectory.create(out, world=place.world.name) as directory:
        session = Session(config, directory, place)
        factory = None if real_time else VirtualTimeLoop
        try:
            with asyncio.Runner(loop_factory=factory) as runner:
                runner.run(session.run())
        finally:
            session.save()
    return session.conclude()


class Session:
    """One exploration: devices, autonomy and what they leave in the run directory."""

    def __init__(self, config: Config, directory: RunDirectory, place: Place | None) -> None:
        self.config, self.directory, self.place = config, directory, place
        self.pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
        self.journey = Journey()
        self._progress = Progress()
        self._simulation: Simulation | None = None
        self._base: KobukiBase | None = None
        self._counts = {events.LoopClosed: 0, events.Recovery: 0}
        self._contacts, self._in_contact = 0, False
        self._started = time.perf_counter()
        self._first_stamp: float | None = None
        self._last_stamp = 0.0

    async def run(self) -> None:
        """Explore until there is an outcome. Raises GvgbotError when a device fails."""
        clock = LoopClock()
        try:
            async with asyncio.TaskGroup() as tasks:
                laser, base = self._open_devices(clock)
                loop = Loop(
                    laser,
                    base,
                    self.pipeline,
                    Guard(self.config.robot.limits, self.config.robot.radius_m),
                    on_events=self._on_events,
                    on_cycle=self._on_cycle,
                )
                serving = [
                    tasks.create_task(laser.run(), name="laser"),
                    tasks.create_task(base.run(), name="base"),
                ]
                if self._simulation is not None:
                    serving.append(tasks.create_task(self._simulation.run(), name="twins"))
                await loop.run()
                for task in serving:
                    task.cancel()
        except* GvgbotError as failures:
            raise _first(failures) from None

    def _open_devices(self, clock: LoopClock) -> tuple[HokuyoLaser, KobukiBase]:
        config = self.config
        if self.place is None:
            laser_stream, base_stream = (
                SerialStream(device.port, device.baud) for device in (config.laser, config.base)
            )
        else:
            self._simulation = Simulation(config, self.place, clock)
            laser_stream, base_stream = self._simulation.laser, self._simulation.base
            if config.twin.base.odometry == "wheels":
                config = replace(config, base=replace(config.base, heading="wheels"))
        self._base = KobukiBase(base_stream, config.base, clock)
        return HokuyoLaser(laser_stream, config.laser, clock), self._base

    def _on_events(self, happened: list[events.Event]) -> None:
        for event in happened:
            self.directory.append_event(event)
            if type(event) in self._counts:
                self._counts[type(event)] += 1

    def _on_cycle(self, odometry: Odometry) -> None:
        if self._first_stamp is None:
            self._first_stamp = odometry.stamp
        self._last_stamp = odometry.stamp
        world_base: Pose | None = None
        if self._simulation is not None:
            self._simulation.body.advance(odometry.stamp)
            world_base = self._simulation.body.pose
        contact = None if self._base is None else self._base.contact
        touching = contact is not None and contact.bumper
        self._contacts += touching and not self._in_contact
        self._in_contact = touching
        self.journey.record(odometry, self.pipeline, world_base)
        self._progress.show(self.pipeline, odometry.stamp)

    def save(self) -> None:
        """Write the map as it is now, and the summary."""
        self._progress.clear()
        title = "map" if self.place is None else self.place.world.name
        files = map_files(self.pipeline, self.journey, title)
        if self.place is not None:
            files |= world_files(self.place.world)
        self.directory.write(files)
        self.directory.write_summary(self._summary())

    def _summary(self) -> dict[str, object]:
        mission, graph = self.pipeline.mission, self.pipeline.mapper.graph
        return {
            "outcome": mission.outcome or "stopped",
            "reason": mission.reason or "stopped from outside",
            "distance_m": self.pipeline.travelled,
            "duration_s": self._last_stamp - (self._first_stamp or 0.0),
            "wall_s": time.perf_counter() - self._started,
            "vertices": len(graph.vertices),
            "edges": len(graph.edges),
            "loop_closures": self._counts[events.LoopClosed],
            "contacts": self._contacts,
            "recoveries": self._counts[events.Recovery],
            "seed": self.config.twin.seed,
            "version": __version__,
            "config": self.config,
        }

    def conclude(self) -> int:
        """Print the outcome and where the map is; the exit status."""
        mission, graph = self.pipeline.mission, self.pipeline.mapper.graph
        print(
            f"{mission.outcome}: {mission.reason}; {len(graph.vertices)} vertices, "
            f"{len(graph.edges)} edges, {self.pipeline.travelled:.0f} m driven"
        )
        print(f"map:     {self.directory.path / 'map.geojson'}")
        print(f"picture: {self.directory.path / 'map.png'}")
        return 0 if mission.outcome == "explored" else 1


def _first(failures: BaseExceptionGroup[GvgbotError]) -> GvgbotError:
    failure = failures.exceptions[0]
    return _first(failure) if isinstance(failure, BaseExceptionGroup) else failure
