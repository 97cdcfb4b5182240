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
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
from scipy import ndimage

from benchmarks.faults import LAYER, Fault
from benchmarks.reference_gvg import reference_gvg
from benchmarks.small_worlds import one_ring
from benchmarks.standers import Standers
from benchmarks.surroundings import Disk, FullDirectory, FullFiles, Hand, Listeners, Manager
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.drivers.hokuyo.twin import HokuyoTwin
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.people import Walkways
from gvgbot.errors import GvgbotError
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist
from gvgbot.maps import geojson
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT, SNAPSHOT_BEFORE, MissionFiles
from gvgbot.persistence.records import Damaged
from gvgbot.requests import REQUESTS
from gvgbot.robot import Robot
from gvgbot.session import Session
from gvgbot.simulation import Place
from tests.twin.lives_rig import GoingWorld
from tests.twin.run_rig import Cable, CabledLinks, at_once

LOOK_S = 0.05  # between two looks at the truth
END_S, QUIET_S = 60.0, 5.0  # it ends then, or so long after the last fault when all is explored
STILL_MPS, SPEED_MPS = 0.03, 0.12  # standing; touching something faster than this is a collision
VERTEX_M = 0.6  # from the nearest true one, a vertex is false,
FELT_M = 1.5  # unless it is so near to something that was felt and is taken for a fact,
STOOD_M = 2.0  # or to somebody, before whom the way ends,
PLACE_M = 0.75  # from the true pose, the robot is not where it believes
SETTLING_S = 10.0  # after a fault in one of
DISTURBING = {"link", "device", "sensing", "world", "process"}  # it may find its place again
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
# How long the robot may take to stand when it cannot see, is not heard, or shall not move, s:
# what the guard, the driver or the base wait, plus braking from full speed and the base's delay.
BLIND_S, MUTE_S, ABANDONED_S, FELT_S, ASKED_S = 2.0, 2.5, 3.0, 1.5, 2.0
STOPS = {
    "laser silence": BLIND_S,
    "laser unplug": BLIND_S,
    "laser stalled": BLIND_S,
    "laser unstable": BLIND_S,
    "laser frozen": BLIND_S,
    "laser blind": BLIND_S,
    "base silence": MUTE_S,
    "base unplug": ABANDONED_S,
    "base wheel drop": FELT_S,
    "base over-current": FELT_S,
    "carried": FELT_S,
}
MUTING = {"base silence", "base unplug"}  # nobody drives a base then that is driven by sight
BACKS_OFF = {"base bump": FELT_S, "base cliff": FELT_S}  # it may go back then, but not on


@dataclass
class Verdict:
    """What a trial was like. `violations` are the oracles that were hurt, each once."""

    violations: dict[str, str] = field(default_factory=dict)
    outcome: str | None = None
    lives: int = 0
    vertices: int = 0
    driven_m: float = 0.0
    contacts: int = 0
    duration_s: float = 0.0
    kept: int = 0  # blocks of memory that are allocated after it, and were not before

    def hurt(self, oracle: str, how: str) -> None:
        self.violations.setdefault(oracle, how)


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
        self._shall_stand_from = math.inf  # s; a while after it was asked to, or ended
        self._contacts, self._fastest = 0, 0.0
        self._is_mute, self._rolls_until = False, -math.inf  # s; nobody can tell the base to stop
        self._felt: list[Array] = []  # places where it felt a cliff or a bump (2,), m
        self._standers = Standers(self._place.world)

    async def run(self) -> None:
        """Live until the end, judged all the time."""
        self._clock = LoopClock()
        self._world = GoingWorld(self._config, self._place, self._clock)
        async with asyncio.TaskGroup() as tasks:
            work = [tasks.create_task(self._world.go_on()), tasks.create_task(self._judge())]
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
            self._shall_stand_from = math.inf  # the robot may have forgotten what it was asked
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
            self._session, self._shall_stand_from = None, clock.now() + ABANDONED_S
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
        self._judge_map(session)
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
        if _clearance(self._place, there) > self._config.robot.radius_m + 0.03:
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
                self._shall_stand_from = math.inf
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
            self._shall_stand_from = min(self._shall_stand_from, self._clock.now() + ASKED_S)
        elif is_done and name not in ("save", "set"):
            self._shall_stand_from = math.inf
        return is_done

    async def _talk_nonsense(self, fault: Fault) -> None:
        """Send what no client sends; no arguments at all may be right, so go on afterwards."""
        while self._clock.now() < fault.at + fault.lasts:
            name = str(self._rng.choice([*REQUESTS, "", "reboot"]))
            await self._say(name, self._rng.bytes(int(self._rng.integers(0, 40))))
            await self._clock.sleep_until(self._clock.now() + 0.1)
        await self._insist("resume")
        await self._insist("explore")

    # -- oracles -----------------------------------------------------------------------------------

    async def _judge(self) -> None:
        last = max((fault.at + fault.lasts for fault in self._timed()), default=0.0)
        while not self._is_over:
            now = self._clock.now()
            self._world.body.advance(now)
            self._note_mute(now)
            self._judge_contact(now)
            self._judge_stops(now)
            self._judge_place(now)
            if self._world.people is not None:
                self._standers.look(self._world.people.centres, self._world.body.pose, now)
            session = self._session
            is_done = session is not None and session.pipeline.mission.outcome is not None
            if session is not None and (now > END_S or (is_done and now > last + QUIET_S)):
                self._is_over, self._ends = True, "SIGTERM"
            await self._clock.sleep_until(now + LOOK_S)

    def _note_mute(self, now: float) -> None:
        """Note from when on nobody tells the base what to do: it rolls on until it stops itself."""
        was_mute = self._is_mute
        self._is_mute = self._session is None or any(
            fault.name in MUTING and fault.at <= now < fault.at + fault.lasts
            for fault in self._faults
        )
        if self._is_mute and not was_mute:
            self._rolls_until = now + ABANDONED_S

    def _judge_contact(self, now: float) -> None:
        body = self._world.body
        fastest = max(self._fastest, abs(body.linear))
        is_collision = fastest > SPEED_MPS and now > self._rolls_until
        if body.contacts > self._contacts and is_collision:
            self.verdict.hurt("contact at speed", f"{fastest:.2f} m/s at {now:.1f} s")
        self._contacts, self._fastest = body.contacts, abs(body.linear)

    def _judge_stops(self, now: float) -> None:
        speed = self._world.body.linear
        if now > self._shall_stand_from and abs(speed) > STILL_MPS:
            self._does_not_stop(now, "it was asked to stand, or has ended")
        for fault in self._faults:
            if not fault.at <= now < fault.at + fault.lasts:
                continue
            if fault.name in BACKS_OFF:
                self._felt.append(self._world.body.pose.position)
            if fault.name in STOPS and now > max(fault.at + STOPS[fault.name], self._rolls_until):
                moves = abs(speed) > STILL_MPS
            else:
                backs_off = fault.name in BACKS_OFF and now > fault.at + BACKS_OFF[fault.name]
                moves = backs_off and speed > STILL_MPS
            if moves:
                self._does_not_stop(now, str(fault))

    def _does_not_stop(self, now: float, why: str) -> None:
        speed = self._world.body.linear
        self.verdict.hurt("does not stop", f"{speed:.2f} m/s at {now:.1f} s, though {why}")

    def _judge_place(self, now: float) -> None:
        session = self._session
        if session is None or session.pipeline.is_lost or not session.journey.world_base:
            return
        disturbing = (fault for fault in self._timed() if LAYER[fault.name] in DISTURBING)
        if any(fault.at <= now < fault.at + fault.lasts + SETTLING_S for fault in disturbing):
            return
        truth = _world_map(session).inverse().compose(self._world.body.pose)
        off = truth.distance(session.pipeline.map_base)
        if off > PLACE_M:
            closures = session.tally.closures
            oracle = "wrong closure" if closures else "wrong place"
            self.verdict.hurt(oracle, f"{off:.2f} m off at {now:.1f} s")

    def _timed(self) -> Iterator[Fault]:
        return (fault for fault in self._faults if fault.lasts < math.inf)

    def _judge_map(self, session: Session) -> None:
        """Every vertex must be where there is one in truth.

        But for that of a ring, which stands for no meetpoint: somebody may have hidden the branch.
        """
        if not session.journey.world_base:
            return
        world_map, mapper = _world_map(session), session.pipeline.mapper
        is_exploring = self.verdict.outcome is None  # and may come back to look
        people = self._standers
        stood = people.standing(self._clock.now()) + people.unseen
        stood += people.stood if is_exploring else []
        excused = [(place, FELT_M) for place in self._felt] + [(place, STOOD_M) for place in stood]
        of_rings = {vertex.id for vertex in mapper.graph.rings()}
        for vertex in mapper.graph.vertices.keys() - of_rings:
            place = world_map.transform(mapper.belief.map_vertex(vertex).position)
            off = float(np.hypot(*(_true_vertices() - place).T).min())
            if off > VERTEX_M and all(math.dist(place, by) > near for by, near in excused):
                self.verdict.hurt("false vertex", f"vertex {vertex}, {off:.2f} m from any")


def _set_up(seed: int, faults: list[Fault], overrides: Sequence[str]) -> tuple[Config, Place]:
    place = one_ring()
    people = sum(fault.name == "person" for fault in faults)
    if people:
        place = replace(place, walkways=Walkways(place.world, place.start))
    laser = ("UTM-30LX", "URG-04LX")[seed % 2]
    settings = [f"twin.seed={seed}", f"twin.people={people}", f"twin.laser.model={laser}"]
    config = load_config(None, [*settings, *overrides])
    return config, place


def _world_map(session: Session) -> Pose:
    """The map's frame in the world."""
    journey = session.journey
    return journey.world_base[0].compose(journey.map_base[0].inverse())


@lru_cache
def _true_vertices() -> Array:
    """Where the world's GVG has vertices (N, 2), m."""
    place = one_ring()
    start = place.start.x, place.start.y
    graph = reference_gvg(place.world, start, load_config(None, []).robot.radius_m).graph
    return np.array([graph.nodes[node]["position"] for node in graph]).reshape(-1, 2)


@lru_cache
def _distances() -> Array:
    world = one_ring().world
    return np.asarray(ndimage.distance_transform_edt(~world.occupied)) * world.resolution_m


def _clearance(place: Place, pose: Pose) -> float:
    res, (x0, y0) = place.world.resolution_m, place.world.origin
    return float(_distances()[int((pose.y - y0) / res), int((pose.x - x0) / res)])


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
        except Exception as error:  # noqa: BLE001
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
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = "" if trace is None else f" ({Path(trace.tb_frame.f_code.co_filename).name}"
    where += "" if trace is None else f":{trace.tb_lineno})"
    return f"{type(error).__name__}: {error}{where}"
