"""What must not happen to a robot in a trial, by the truth of the simulation."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import ndimage

from benchmarks.faults import LAYER, Fault
from benchmarks.reference_gvg import reference_gvg
from benchmarks.rigs.lives_rig import GoingWorld
from benchmarks.small_worlds import one_ring
from benchmarks.standers import Standers
from gvgbot.config import load_config
from gvgbot.geometry import Array, Pose
from gvgbot.session import Session
from gvgbot.simulation import Place

STILL_MPS, SPEED_MPS = 0.03, 0.12  # standing; touching something faster than this is a collision
VERTEX_M = 0.6  # from the nearest true one, a vertex is false,
FELT_M = 1.5  # unless it is so near to something that was felt and is taken for a fact,
STOOD_M = 2.0  # or to somebody, before whom the way ends,
PLACE_M = 0.75  # from the true pose, the robot is not where it believes
SETTLING_S = 10.0  # after a fault in one of
DISTURBING = {"link", "device", "sensing", "world", "process"}  # it may find its place again
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


class Judge:
    """Looks again and again at the truth of a trial, and takes down in a verdict what is wrong."""

    def __init__(
        self, verdict: Verdict, faults: list[Fault], world: GoingWorld, place: Place
    ) -> None:
        self._verdict, self._faults, self._world = verdict, faults, world
        self.shall_stand_from = math.inf  # s; a while after the robot was asked to, or ended
        self._contacts, self._fastest = 0, 0.0
        self._is_mute, self._rolls_until = False, -math.inf  # s; nobody can tell the base to stop
        self._felt: list[Array] = []  # places where it felt a cliff or a bump (2,), m
        self._standers = Standers(place.world)

    def shall_stand_by(self, stamp: float) -> None:
        """Expect the robot to stand from then on, if not from before."""
        self.shall_stand_from = min(self.shall_stand_from, stamp)

    def look(self, session: Session | None, now: float) -> None:
        """Judge the robot as it is now; without a session none is alive."""
        self._world.body.advance(now)
        self._note_mute(session, now)
        self._judge_contact(now)
        self._judge_stops(now)
        self._judge_place(session, now)
        if self._world.people is not None:
            self._standers.look(self._world.people.centres, self._world.body.pose, now)

    def look_at_map(self, session: Session, now: float) -> None:
        """Every vertex must be where there is one in truth.

        But for that of a ring, which stands for no meetpoint: somebody may have hidden the branch.
        """
        if not session.journey.world_base:
            return
        world_map, mapper = _world_map(session), session.pipeline.mapper
        is_exploring = self._verdict.outcome is None  # and may come back to look
        people = self._standers
        stood = people.standing(now) + people.unseen
        stood += people.stood if is_exploring else []
        excused = [(place, FELT_M) for place in self._felt] + [(place, STOOD_M) for place in stood]
        of_rings = {vertex.id for vertex in mapper.graph.rings()}
        for vertex in mapper.graph.vertices.keys() - of_rings:
            place = world_map.transform(mapper.belief.map_vertex(vertex).position)
            off = float(np.hypot(*(_true_vertices() - place).T).min())
            if off > VERTEX_M and all(math.dist(place, by) > near for by, near in excused):
                self._verdict.hurt("false vertex", f"vertex {vertex}, {off:.2f} m from any")

    def _note_mute(self, session: Session | None, now: float) -> None:
        """Note from when on nobody tells the base what to do: it rolls on until it stops itself."""
        was_mute = self._is_mute
        self._is_mute = session is None or any(
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
            self._verdict.hurt("contact at speed", f"{fastest:.2f} m/s at {now:.1f} s")
        self._contacts, self._fastest = body.contacts, abs(body.linear)

    def _judge_stops(self, now: float) -> None:
        speed = self._world.body.linear
        if now > self.shall_stand_from and abs(speed) > STILL_MPS:
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
        self._verdict.hurt("does not stop", f"{speed:.2f} m/s at {now:.1f} s, though {why}")

    def _judge_place(self, session: Session | None, now: float) -> None:
        if session is None or session.pipeline.is_lost or not session.journey.world_base:
            return
        disturbing = (fault for fault in timed(self._faults) if LAYER[fault.name] in DISTURBING)
        if any(fault.at <= now < fault.at + fault.lasts + SETTLING_S for fault in disturbing):
            return
        truth = _world_map(session).inverse().compose(self._world.body.pose)
        off = truth.distance(session.pipeline.map_base)
        if off > PLACE_M:
            closures = session.tally.closures
            oracle = "wrong closure" if closures else "wrong place"
            self._verdict.hurt(oracle, f"{off:.2f} m off at {now:.1f} s")


def timed(faults: Iterable[Fault]) -> Iterator[Fault]:
    """Those that are not there from the start to the end."""
    return (fault for fault in faults if fault.lasts < math.inf)


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


def clearance(place: Place, pose: Pose) -> float:
    """How far, m, a pose is from the nearest wall of the world."""
    res, (x0, y0) = place.world.resolution_m, place.world.origin
    return float(_distances()[int((pose.y - y0) / res), int((pose.x - x0) / res)])
