"""Two robots meet where they cannot pass each other; each knows where the other one is."""

import asyncio
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from gvgbot.autonomy.control.company import Companion, moved
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.world import World
from gvgbot.driving import drive
from gvgbot.geometry import Pose, wrap_angle
from gvgbot.hal.messages import Odometry
from gvgbot.links import Devices, Links
from gvgbot.simulation import Place, Simulation
from gvgbot.team.chart import Chart
from gvgbot.team.member import Member, TeamConfig
from gvgbot.team.news import decode, encode
from gvgbot.worlds.canvas import Canvas

CONFIG = Config()
RADIUS = CONFIG.robot.radius_m
LEAST_GAP = 0.1  # m between both bodies
TOLD_EVERY = 0.2  # s
SOON = 5.0  # s
STARTS = Pose(2.0, 3.4, 1.57), Pose(8.2, 5.6, -1.57)


@dataclass(frozen=True)
class Tees:
    """Two tees of corridors, joined by one that is a metre wide, from west to east."""

    west: float  # the ends of the narrow corridor, m along x
    east: float
    mouths: float  # m that the wide corridors between it and the arms are long
    arms: float  # m to north and south

    def world(self) -> World:
        canvas = Canvas(self.east + self.mouths + 2.0, 9.0)
        for x, mouth in (
            (self.west - self.mouths, self.west),
            (self.east + self.mouths, self.east),
        ):
            canvas.carve_path([(x, 4.5 - self.arms), (x, 4.5 + self.arms)], 1.6)
            canvas.carve_path([(min(x, mouth), 4.5), (max(x, mouth), 4.5)], 1.6)
        canvas.carve_path([(self.west, 4.5), (self.east, 4.5)], 1.0)
        return canvas.world("twin tees")


TEES = Tees(3.6, 6.6, mouths=1.6, arms=2.0)


@dataclass(eq=False)
class Explorer:
    """One of the two, and where it has been."""

    start: Pose
    tees: Tees
    simulation: Simulation
    pipeline: Pipeline
    member: Member
    told: float = 0.0
    way: list[Pose] = field(default_factory=list)

    @property
    def here(self) -> Pose:
        return self.simulation.body.pose

    @property
    def has_crossed(self) -> bool:
        x = [pose.x for pose in self.way]
        return bool(x) and min(x) < self.tees.west and max(x) > self.tees.east

    def hear(self, other: "Explorer", *, goes_first: bool) -> None:
        """Be told where the other one is and what it drives along, and what it sees."""
        mind = other.pipeline
        course = other.member.course(other.told, mind.map_base, mind.track, mind.traffic.seen)
        self.member.hear(decode(encode(course)), other.told)
        self.member.look(other.told)
        companion = Companion("other", mind.map_base, goes_first, mind.track, radius=0.177)
        map_map = self.start.inverse().compose(other.here).compose(mind.map_base.inverse())
        self.pipeline.traffic.company = [moved(companion, map_map)]


@cache
def met() -> tuple["Explorer", "Explorer"]:
    both: tuple[Explorer, Explorer] = run_in_virtual_time(_met(TEES, STARTS))
    return both


@pytest.mark.slow
def test_two_robots_that_meet_in_a_narrow_corridor_both_get_to_the_other_side() -> None:
    one, two = met()
    assert one.has_crossed
    assert two.has_crossed
    gaps = [a.distance(b) - 2 * RADIUS for a, b in zip(one.way, two.way, strict=False)]
    assert LEAST_GAP <= min(gaps) < 2.0  # they did meet
    assert one.simulation.body.contacts == two.simulation.body.contacts == 0


@pytest.mark.slow
def test_two_robots_that_met_know_how_their_maps_lie() -> None:
    """By their lasers and by what they told each other, as they have no vertex in common yet."""
    one, two = met()
    for here, there in ((one, two), (two, one)):
        frame = here.member.frames[there.member.name]
        middle = there.start.inverse().transform(np.array([5.1, 4.5]))
        true = here.start.to(there.start)
        assert np.hypot(*(frame.transform(middle) - true.transform(middle))) < 0.15
        assert abs(wrap_angle(frame.theta - true.theta)) < 0.05


@pytest.mark.slow
def test_a_robot_that_has_finished_lets_another_one_pass() -> None:
    """It stands in the narrow corridor, where the other one has to come through."""
    starts = Pose(2.0, 3.4, 1.57), Pose(5.0, 4.5, np.pi)
    passer, finished = run_in_virtual_time(_met(TEES, starts, has_finished=True))
    assert passer.has_crossed
    gaps = [a.distance(b) - 2 * RADIUS for a, b in zip(passer.way, finished.way, strict=True)]
    assert LEAST_GAP <= min(gaps) < 2.0  # they did meet
    assert passer.simulation.body.contacts == finished.simulation.body.contacts == 0


async def _met(
    tees: Tees, starts: tuple[Pose, Pose], *, has_finished: bool = False
) -> tuple[Explorer, Explorer]:
    """Both, until each has crossed; or, if the second one has finished soon, the first one has."""
    clock, world = LoopClock(), tees.world()
    laser = HokuyoTwinConfig(model="URG-04LX")
    config = replace(CONFIG, twin=replace(CONFIG.twin, laser=laser))
    both = [
        Explorer(
            start,
            tees,
            Simulation(config, Place(world, start), clock),
            Pipeline(config.autonomy, config.exploration, RADIUS),
            Member(name, TeamConfig(), Chart, radius=RADIUS),
        )
        for name, start in zip(("one", "two"), starts, strict=True)
    ]
    for explorer, other in (both, both[::-1]):
        explorer.member.hear(other.member.news(0.0, Pose(), finished=False), 0.0)
    for explorer, other in (both, both[::-1]):
        explorer.simulation.meet([other.simulation])
    async with asyncio.TaskGroup() as tasks:
        lives = [tasks.create_task(_live(k, both, config, clock)) for k in range(2)]
        explorers = both[:1] if has_finished else both
        while clock.now() < 150.0 and not all(explorer.has_crossed for explorer in explorers):
            if has_finished and clock.now() > SOON:
                both[1].pipeline.mission.outcome = "explored"
            await asyncio.sleep(0.1)
            for explorer in both:
                explorer.way.append(explorer.here)
        for life in lives:
            life.cancel()
    return both[0], both[1]


async def _live(number: int, both: list[Explorer], config: Config, clock: LoopClock) -> None:
    explorer, other = both[number], both[1 - number]
    devices = Devices(Links(config, clock, explorer.simulation, None))

    def on_cycle(odometry: Odometry) -> None:
        if odometry.stamp >= explorer.told + TOLD_EVERY:
            explorer.told = odometry.stamp
            explorer.hear(other, goes_first=number == 1)

    await drive(config.robot, devices, explorer.pipeline, on_cycle=on_cycle, goes_on=lambda: True)
