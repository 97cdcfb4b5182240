"""The simulated robot: one world, one body, and the twins of both devices on in-memory streams."""

import asyncio
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from gvgbot.clock import Clock
from gvgbot.config import Config
from gvgbot.drivers.body import BodyConfig, RobotBody
from gvgbot.drivers.cable import Cable
from gvgbot.drivers.hokuyo.models import MODELS, Model, Parameters
from gvgbot.drivers.hokuyo.twin import HokuyoTwin
from gvgbot.drivers.kobuki.twin import KobukiTwin
from gvgbot.drivers.link_faults import FaultyLink
from gvgbot.drivers.people import People, Walkways
from gvgbot.drivers.sight import Sight
from gvgbot.drivers.start import check_start, warn_of_small_space
from gvgbot.drivers.transport import serve_twin
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.worlds import open_world

_DOCK_IN_SIGHT = 6.0  # m; a dock's beams end before
_SECTOR_S = 0.03  # of a sweep, in which a body moves evenly,
_DRIVEN_M, _TURNED_RAD = 0.1, 1.0  # and by no more than this, unless somebody puts it elsewhere


@dataclass(frozen=True, slots=True)
class Place:
    """A world, where the robot starts in it, and where people walk, if there are any."""

    world: World
    start: Pose
    walkways: Walkways | None = None


def open_place(config: Config) -> Place:
    """The configured world.

    Raises WorldError if it cannot be had, the start does not fit, or people have no room.
    """
    world, default = open_world(config.twin.world, unknown_is_wall=config.twin.unknown == "wall")
    start = Pose(*config.twin.start) if config.twin.start is not None else default or Pose()
    check_start(world, start, config.robot.radius_m)
    warn_of_small_space(world, start, config.robot.radius_m)
    return Place(world, start, Walkways(world, start) if _people_count(config, world) else None)


def _people_count(config: Config, world: World) -> int:
    return world.people if config.twin.people is None else config.twin.people


@cache
def _sectors(parameters: Parameters, steps: int, count: int) -> list[tuple[Array, Array]]:
    """Of each sector of a sweep's first steps when its beams are seen, s after the beginning (N,).

    And the bearings of these (N,), rad.
    """
    bearings = parameters.bearings[:steps]
    bearings.setflags(write=False)
    late = parameters.step_time * (parameters.first_step + np.arange(len(bearings)))
    return list(zip(np.array_split(late, count), np.array_split(bearings, count), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class _Eye:
    """What the laser on a body sees; it may hang upside down."""

    body: RobotBody
    sight: Sight
    model: Model
    base_laser: Pose
    is_flipped: bool

    def sweep(self, stamp: float, steps: int) -> Array:
        """Ranges (steps,), m, of a sweep that begins at a stamp, the body going on meanwhile.

        No longer than until the last of them is seen: who looks at it then is not to see more.
        """
        ((late, _),) = _sectors(self.model.parameters, steps, 1)
        begin, end = stamp + float(late[0]), stamp + float(late[-1])
        self.body.advance(end)
        stands = self.body.pose_at(begin) == self.body.pose_at(end)
        count = 1 if stands else math.ceil((end - begin) / _SECTOR_S)
        sectors = _sectors(self.model.parameters, steps, count)
        return np.concatenate([self._look(stamp + late, bearings) for late, bearings in sectors])

    def _look(self, stamps: Array, bearings: Array) -> Array:
        """Ranges (N,), m, along bearings (N,), rad, of the laser, at these times (N,), s."""
        begin, end = (self.body.pose_at(float(stamps[i])).compose(self.base_laser) for i in (0, -1))
        turn = wrap_angle(end.theta - begin.theta)
        if begin.distance(end) > _DRIVEN_M or abs(turn) > _TURNED_RAD:
            begin, turn = end, 0.0
        share = np.linspace(-0.5, 0.5, len(stamps))
        turned = turn * share
        moved = share[:, None] * (end.position - begin.position)
        world_laser, reach = begin.towards(end, 0.5), self.model.usable_mm / 1000
        if not self.is_flipped:
            return self.sight.look(world_laser, bearings + turned, reach, moved)
        mirrored = (turned - bearings)[::-1]
        return self.sight.look(world_laser, mirrored, reach, moved[::-1])[::-1]


class Simulation:
    """Both twins in one world; `laser` and `base` are the drivers' ends of their streams.

    Whoever joins `laser_twin` and `base_twin` to other streams does not call `run`.
    """

    def __init__(
        self, config: Config, place: Place, clock: Clock, people: People | None = None
    ) -> None:
        """`people` are those whom other robots of this world meet as well."""
        self.place = place
        shape = BodyConfig(radius_m=config.robot.radius_m, wheel_base_m=config.base.wheel_base_m)
        seeds = np.random.SeedSequence(config.twin.seed).generate_state(4)
        laser_seed, base_seed, people_seed, glass_seed = (int(seed) for seed in seeds)
        if people is None and place.walkways is not None:
            count = _people_count(config, place.world)
            people = People(place.walkways, count, people_seed, clock.now())
        self.people = people
        self.body = RobotBody(place.world, place.start, shape, clock.now(), people)
        sight = Sight(place.world, people, glass_seed, self.body.others)
        model = MODELS[config.twin.laser.model]
        eye = _Eye(self.body, sight, model, config.laser.base_laser, config.laser.upside_down)
        self._clock = clock
        cable, laser_cable = Cable(), Cable()
        self._laser_has_usb = config.twin.laser.serial_baud == 0
        self.plug_base: Callable[[bool], None] = cable.plug  # of the link that is in use
        self.plug_laser: Callable[[bool], None] = laser_cable.plug
        self.laser_twin = FaultyLink(
            HokuyoTwin(config.twin.laser, eye.sweep, laser_seed, self._reboot_laser, clock.now()),
            config.twin.laser.link,
            laser_seed,
            self._pull_laser,
        )
        self.base_twin = FaultyLink(
            KobukiTwin(config.twin.base, self.body, base_seed, config.base.geometry, self._look),
            config.twin.base.link,
            base_seed,
            self._pull_base,
        )
        self.laser_twin.company = self.base_twin.company = [self.laser_twin, self.base_twin]
        self.laser, self._laser_end = laser_cable.host, laser_cable.device
        self.base, self._base_end = cable.host, cable.device

    def meet(self, others: Iterable["Simulation"]) -> None:
        """Share the world with other robots: they see each other, and bump into each other."""
        self.body.others += [other.body for other in others]

    def _look(self, bearing: float) -> float:
        """Distance (m) from the body to the next wall in a direction (rad) of its own."""
        world = self.place.world
        return float(world.cast(self.body.pose, np.array([bearing]), _DOCK_IN_SIGHT)[0])

    def _pull_laser(self, is_plugged: bool) -> None:
        self.plug_laser(is_plugged)

    def _reboot_laser(self, is_back: bool) -> None:
        """A laser on USB takes its link along when it reboots; a serial line stays."""
        if self._laser_has_usb:
            self.plug_laser(is_back)

    def _pull_base(self, is_plugged: bool) -> None:
        self.plug_base(is_plugged)

    async def run(self) -> None:
        """Let the devices work until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            laser = serve_twin(self.laser_twin, self._laser_end, self._clock)
            base = serve_twin(self.base_twin, self._base_end, self._clock)
            tasks.create_task(laser, name="laser twin")
            tasks.create_task(base, name="base twin")
