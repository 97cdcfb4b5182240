"""One robot with one schedule of faults, in virtual time, and everything that must not happen.

The whole daemon drives the twins through a small world. Kills abandon it and build it anew from
its files. What is judged is the truth of the simulation, not what the robot believes.
"""

import asyncio
import gc
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

import msgspec
import numpy as np

from benchmarks.faults import Fault
from benchmarks.judge import ABANDONED_S, ASKED_S, Judge, Verdict, clearance, timed
from benchmarks.rigs.lives_rig import GoingWorld
from benchmarks.rigs.run_rig import Cable, CabledLinks, at_once
from benchmarks.small_worlds import one_ring
from benchmarks.surroundings import Disk, FullDirectory, FullFiles, Hand, Listeners, Manager
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.drivers.hokuyo.twin import HokuyoTwin
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.people import Walkways
from gvgbot.errors import GvgbotError, underlying
from gvgbot.geometry import STANDSTILL, Pose, Twist
from gvgbot.maps import geojson
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT, SNAPSHOT_BEFORE, MissionFiles
from gvgbot.persistence.records import Damaged
from gvgbot.requests import REQUESTS
from gvgbot.robot import Robot
from gvgbot.session import Session
from gvgbot.simulation import Place

LOOK_S = 0.05  # between two looks at the truth
END_S, QUIET_S = 60.0, 5.0  # it ends then, or so long after the last fault when all is explored
PATIENCE_S = 1.0  # before the robot is asked once more for what it refused
HAND_S, STEADY_S = 0.1, 3.0  # who drives by hand says so as often, and changes his mind
WATCHDOG_S = 5.0  # without a sign of life, a service manager would restart the daemon
ENDS_S = 5.0  # after a signal; a service manager would kill it later
JOURNAL_BYTES_PER_S = 100_000
TAIL = 200  # bytes at the end of a file in which it is damaged
KEPT = 1_000  # blocks of memory that a trial may leave behind; a robot is several times as many
NOISE = LinkFaultConfig(
    jitter_s=0.005,
    flipped_bits_per_kb=2.0,
    lost_bytes_per_kb=1.0,
    inserted_bytes_per_kb=1.0,
    cut_messages_per_k=50.0,
)


class Trial:
    """A robot, its world, and what befalls both."""

    def __init__(
        self, seed: int, faults: list[Fault], out: Path, overrides: Sequence[str] = ()
    ) -> None:
        self.verdict = Verdict()
        self._faults, self._out = faults, out
        self._rng = np.random.default_rng((seed, 22))
        self._config, self._place = _set_up(seed, faults, overrides)
        self._disk, self._network, self._hand = Disk(), Listeners(), Hand()
        self._clock: LoopClock
        self._world: GoingWorld
        self._session: Session | None = None  # of the robot that is alive
        self._cable: Cable
        self._ends = ""  # what the present life ends with, if it shall
        self._is_over = False
        self._damage = ""
        self._dead_s = 0.0
        self._judge: Judge

    async def run(self) -> None:
        """Live until the end, judged all the time."""
        self._clock = LoopClock()
        self._world = GoingWorld(self._config, self._place, self._clock)
        self._judge = Judge(self.verdict, self._faults, self._world, self._place)
        async with asyncio.TaskGroup() as tasks:
            work = [tasks.create_task(self._world.go_on()), tasks.create_task(self._look_on())]
            work += [tasks.create_task(self._befall(fault)) for fault in self._faults]
            while not self._is_over:
                await self._live()
            for task in work:
                task.cancel()
        if asyncio.all_tasks() != {asyncio.current_task()}:
            self.verdict.hurt("task left", str(asyncio.all_tasks()))
        self.verdict.duration_s = self._clock.now()

    # -- lives -------------------------------------------------------------------------------------

    async def _live(self) -> None:
        """From a start of the process to its end."""
        clock, files = self._clock, FullFiles(self._out, self._disk)
        self.verdict.lives += 1
        try:
            saved = files.read()
        except Damaged as error:
            self.verdict.hurt("map unreadable", str(error))
            saved, files = None, FullFiles(self._out, self._disk)
        with FullDirectory(self._out, self._disk) as directory:
            session = Session(self._config, directory, self._place)
            session.simulation = self._world
            keeper = Keeper(session, files, saved)
            links = CabledLinks(self._config, clock, self._world)
            links.cable = self._cable = Cable(self._world.base)
            self._session, self._ends = session, ""
            # the robot may have forgotten what it was asked
            self._judge.shall_stand_from = math.inf
            manager = Manager(clock.now)
            robot = Robot(
                session,
                manager,
                self._network,
                off_loop=at_once,
                keeper=keeper,
                driver=self._hand,
            )
            try:
                async with asyncio.timeout(None) as patience:
                    await robot.serve(self._ended(patience), links)
            except TimeoutError:
                self.verdict.hurt("does not end", f"after {self._ends} for {ENDS_S:g} s")
            self._session, self._judge.shall_stand_from = None, clock.now() + ABANDONED_S
            if manager.longest > WATCHDOG_S:
                self.verdict.hurt("cycles late", f"no sign of life for {manager.longest:.1f} s")
            if self._ends == "SIGTERM":
                keeper.finish()
                with suppress(GvgbotError):  # the disk may be full; the command would say so
                    session.save()
        if self._is_over:
            self._conclude(session)
            return
        self._spoil()
        await clock.sleep_until(clock.now() + self._dead_s)

    async def _ended(self, patience: asyncio.Timeout) -> str:
        while not self._ends:
            await self._clock.sleep_until(self._clock.now() + LOOK_S)
        patience.reschedule(asyncio.get_running_loop().time() + ENDS_S)
        self._cable.is_cut = self._ends == "SIGKILL"
        return self._ends

    def _spoil(self) -> None:
        """Damage the files of the dead robot."""
        path = self._out / (SNAPSHOT if "snapshot" in self._damage else JOURNAL)
        is_the_only_one = path.name == SNAPSHOT and not (self._out / SNAPSHOT_BEFORE).exists()
        if not self._damage or not path.exists() or is_the_only_one:
            return
        data, status = bytearray(path.read_bytes()), path.stat()
        place = int(self._rng.integers(1, min(TAIL, len(data)) + 1))
        if "bit" in self._damage:
            data[-place] ^= 1 << int(self._rng.integers(8))
        else:
            del data[-place:]
        path.write_bytes(data)
        # A bad disk leaves the dates as they were.
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))

    def _conclude(self, session: Session) -> None:
        """What the robot leaves."""
        self.verdict.outcome = session.pipeline.mission.outcome
        self.verdict.vertices = len(session.pipeline.mapper.graph.vertices)
        self.verdict.contacts = self._world.body.contacts
        self.verdict.driven_m = self._world.body.distance_m
        self._judge.look_at_map(session, self._clock.now())
        self._disk.is_full = False
        session.save()
        try:
            geojson.decode((self._out / "map.geojson").read_text(encoding="utf-8"))
            json.loads((self._out / "summary.json").read_text(encoding="utf-8"))
            MissionFiles(self._out).read()
        except (GvgbotError, ValueError, OSError, Damaged) as error:
            self.verdict.hurt("map unreadable", str(error))
        journal = self._out / JOURNAL
        limit = JOURNAL_BYTES_PER_S * max(10.0, self._clock.now())
        if journal.exists() and journal.stat().st_size > limit:
            self.verdict.hurt("memory", f"the journal has {journal.stat().st_size} bytes")

    # -- faults ------------------------------------------------------------------------------------

    async def _befall(self, fault: Fault) -> None:
        """Let a fault happen when its time has come."""
        if fault.lasts == math.inf:  # it is there from the start
            return
        await self._clock.sleep_until(fault.at)
        device, _, what = fault.name.partition(" ")
        match device, what:
            case "laser" | "base", "noise":
                link = self._link(device)
                link.change(NOISE)
                await self._clock.sleep_until(fault.at + fault.lasts)
                link.change(LinkFaultConfig())
            case "laser" | "base", "silence" | "unplug":
                inject = cast(Callable[[str, float], None], self._link(device).inject)
                inject(what, fault.lasts)
            case "laser" | "base", _:
                twin = self._link(device).device
                assert isinstance(twin, HokuyoTwin | KobukiTwin)
                strike = cast(Callable[[str, float], None], twin.inject)
                strike(what, fault.lasts)
            case "carried", _:
                await self._carry(fault)
            case "kill," | "kill" | "restart", _ if self._session is not None:
                self._ends = "SIGTERM" if device == "restart" else "SIGKILL"
                self._damage, self._dead_s = what, fault.lasts
            case "disk", _:
                self._disk.is_full = True
                await self._clock.sleep_until(fault.at + fault.lasts)
                self._disk.is_full = False
            case "kill," | "kill" | "restart", _:
                pass  # it is dead already
            case "nobody", _:
                self._network.is_deaf = True
                await self._clock.sleep_until(fault.at + fault.lasts)
                self._network.is_deaf = False
            case "garbage", _:
                await self._talk_nonsense(fault)
            case "driven", _:
                await self._drive(fault)
            case _:
                await self._ask(fault)

    def _link(self, device: str) -> FaultyLink:
        return self._world.laser_twin if device == "laser" else self._world.base_twin

    async def _carry(self, fault: Fault) -> None:
        """Lift the robot, put it down a little beside, and let it go."""
        twin = self._world.base_twin.device
        assert isinstance(twin, KobukiTwin)
        twin.inject("wheel drop", fault.lasts)
        await self._clock.sleep_until(fault.at + fault.lasts / 2 + 0.5)
        body = self._world.body
        body.advance(self._clock.now())
        x, y = self._rng.uniform(-0.2, 0.2, 2).tolist()
        there = body.pose.compose(Pose(x, y, float(self._rng.uniform(-0.3, 0.3))))
        if clearance(self._place, there) > self._config.robot.radius_m + 0.03:
            body.pose = there

    async def _ask(self, fault: Fault) -> None:
        """Ask for something, as a person would, and to go on some time later."""
        arguments: dict[str, object] = {}
        if fault.name == "goto":
            arguments = {"vertex": int(self._rng.integers(0, 4))}
        elif fault.name == "set":
            arguments = {"key": "robot.limits.max_speed_mps", "value": 0.3}
        is_done = await self._request(fault.name, **arguments)
        if not is_done or not fault.lasts:
            return
        await self._clock.sleep_until(fault.at + fault.lasts)
        await self._insist("resume" if fault.name == "pause" else "explore")

    async def _drive(self, fault: Fault) -> None:
        """Drive without looking where."""
        twist, turns_at = STANDSTILL, fault.at
        while (now := self._clock.now()) < fault.at + fault.lasts:
            if now >= turns_at:
                linear, angular = self._rng.uniform((0.1, -0.5), (0.7, 0.5)).tolist()
                twist, turns_at = Twist(linear, angular), now + STEADY_S
            if self._session is not None and not self._session.pipeline.errands.is_paused:
                self._judge.shall_stand_from = math.inf
            self._hand.drive(twist)
            await self._clock.sleep_until(now + HAND_S)
        await self._insist("explore")

    async def _insist(self, name: str) -> None:
        """Ask until the robot is there and does it."""
        while not await self._request(name):
            await self._clock.sleep_until(self._clock.now() + PATIENCE_S)

    async def _request(self, name: str, **arguments: object) -> bool:
        """Whether the robot does what it is asked for."""
        return await self._say(name, msgspec.msgpack.encode(arguments))

    async def _say(self, name: str, data: bytes) -> bool:
        is_done = await self._network.ask(name, data)
        if is_done and name in ("pause", "stop"):
            self._judge.shall_stand_by(self._clock.now() + ASKED_S)
        elif is_done and name not in ("save", "set"):
            self._judge.shall_stand_from = math.inf
        return is_done

    async def _talk_nonsense(self, fault: Fault) -> None:
        """Send what no client sends; no arguments at all may be right, so go on afterwards."""
        while self._clock.now() < fault.at + fault.lasts:
            name = str(self._rng.choice([*REQUESTS, "", "reboot"]))
            await self._say(name, self._rng.bytes(int(self._rng.integers(0, 40))))
            await self._clock.sleep_until(self._clock.now() + 0.1)
        await self._insist("resume")
        await self._insist("explore")

    async def _look_on(self) -> None:
        """Judge all the time, and end the trial when there is nothing more to come."""
        last = max((fault.at + fault.lasts for fault in timed(self._faults)), default=0.0)
        while not self._is_over:
            now, session = self._clock.now(), self._session
            self._judge.look(session, now)
            is_done = session is not None and session.pipeline.mission.outcome is not None
            if session is not None and (now > END_S or (is_done and now > last + QUIET_S)):
                self._is_over, self._ends = True, "SIGTERM"
            await self._clock.sleep_until(now + LOOK_S)


def _set_up(seed: int, faults: list[Fault], overrides: Sequence[str]) -> tuple[Config, Place]:
    place = one_ring()
    people = sum(fault.name == "person" for fault in faults)
    if people:
        place = replace(place, walkways=Walkways(place.world, place.start))
    laser = ("UTM-30LX", "URG-04LX")[seed % 2]
    settings = [f"twin.seed={seed}", f"twin.people={people}", f"twin.laser.model={laser}"]
    settings.append("service.home_when_low=false")  # one that went home would explore no more
    config = load_config(None, [*settings, *overrides])
    return config, place


def trial(seed: int, faults: list[Fault], overrides: Sequence[str] = ()) -> Verdict:
    """The verdict on a schedule, the same each time; `overrides` are of the configuration."""
    verdict = once(seed, faults, overrides)
    if verdict.kept > KEPT:  # modules that were loaded and caches that were filled, or a leak
        again = once(seed, faults, overrides)
        if again.kept > KEPT:
            verdict.hurt("memory", f"{again.kept} blocks stay, each time")
    return verdict


def once(seed: int, faults: list[Fault], overrides: Sequence[str] = ()) -> Verdict:
    """The verdict but for memory, of which the first trial of a process always keeps some."""
    before = _blocks()
    with tempfile.TemporaryDirectory() as out:
        tried = Trial(seed, faults, Path(out), overrides)
        try:
            run_in_virtual_time(tried.run())
        except Exception as error:  # noqa: BLE001  # each is a finding
            tried.verdict.hurt("exception", _innermost(error))
        verdict = tried.verdict
    del tried
    verdict.kept = _blocks() - before
    return verdict


def _blocks() -> int:
    """How much is allocated by Python itself, but for what nobody can reach."""
    gc.collect()
    return sys.getallocatedblocks()


def _innermost(error: BaseException) -> str:
    error = underlying(error)
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = "" if trace is None else f" ({Path(trace.tb_frame.f_code.co_filename).name}"
    where += "" if trace is None else f":{trace.tb_lineno})"
    return f"{type(error).__name__}: {error}{where}"
