"""A robot that is killed and started again while its world goes on."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.rigs.run_rig import Cable, CabledLinks, at_once
from gvgbot.clock import Clock, LoopClock, OffLoop, run_in_virtual_time
from gvgbot.config import Config
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.robot import Robot
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import Place, Simulation

PATIENCE = 900.0  # s of the robot's time
LOOK = 0.1  # s between two looks at the robot


class GoingWorld(Simulation):
    """Both twins live on while nobody listens."""

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def go_on(self) -> None:
        await super().run()


def explored(session: Session) -> bool:
    """Whether there is an outcome."""
    return session.pipeline.mission.outcome is not None


def nothing(world: GoingWorld, out: Path) -> None:
    """What happens between two lives."""


@dataclass
class Lives:
    """Several lives of one robot; each ends with a kill when it is told, or when it is `over`.

    `between` is done to the world and to the run directory while the robot is dead for `dead_s`;
    `reboots` tells whether the computer starts anew meanwhile.
    """

    config: Config
    place: Place
    out: Path
    known: Path | None = None
    dead_s: float = 3.0
    reboots: bool = False
    between: Callable[[GoingWorld, Path], None] = nothing
    over: Callable[[Session], bool] = explored
    off_loop: OffLoop = at_once
    sessions: list[Session] = field(default_factory=list)
    keepers: list[Keeper] = field(default_factory=list)
    world: GoingWorld = field(init=False)

    def run(self, kills: Sequence[Callable[[Session, float], bool]]) -> Session:
        """The last session, saved as the daemon saves it."""
        run_in_virtual_time(self._run(kills))
        last = self.sessions[-1]
        self.keepers[-1].finish()
        with RunDirectory(self.out) as last.directory:
            last.save()
        return last

    async def _run(self, kills: Sequence[Callable[[Session, float], bool]]) -> None:
        clock = LoopClock()
        self.world = GoingWorld(self.config, self.place, clock)
        async with asyncio.TaskGroup() as tasks:
            going = tasks.create_task(self.world.go_on())
            for kill in kills:
                await self._live(clock, kill)
                await clock.sleep_until(clock.now() + self.dead_s)
                self.between(self.world, self.out)
            await self._live(clock, lambda session, _: False)
            going.cancel()

    async def _live(self, clock: Clock, kill: Callable[[Session, float], bool]) -> None:
        """Live until that is over, or until killed: no last word gets out."""
        files = MissionFiles(self.out)
        saved = MissionFiles(self.known).read() if self.known is not None else files.read()
        directory = RunDirectory(self.out)
        session = Session(self.config, directory, self.place)
        session.simulation = self.world
        boot = f"start {len(self.sessions)}" if self.reboots else None
        keeper = Keeper(session, files, saved, boot=boot)
        self.sessions.append(session)
        self.keepers.append(keeper)
        links = CabledLinks(self.config, clock, self.world)
        links.cable = Cable(self.world.base)

        async def ended() -> str:
            begun = clock.now()
            while not self.over(session):
                assert clock.now() - begun < PATIENCE, "that does not end"
                await clock.sleep_until(clock.now() + LOOK)
                if kill(session, clock.now()):
                    links.cable.is_cut = True
                    break
            return "SIGKILL"

        robot = Robot(session, Notifier(None), None, off_loop=self.off_loop, keeper=keeper)
        with directory:
            await robot.serve(ended(), links)


def at(stamp: float) -> Callable[[Session, float], bool]:
    """A kill at a time."""
    return lambda _, now: now >= stamp
