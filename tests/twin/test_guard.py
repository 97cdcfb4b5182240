"""The guard on the twins: whoever drives straight at a wall does not get there."""

import asyncio
import contextlib

import numpy as np
import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.errors import DeviceLost
from gvgbot.geometry import Twist
from gvgbot.hal.guard import Guard, GuardState
from gvgbot.hal.messages import Scan
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place

pytestmark = pytest.mark.twin

DEAD_TIME_S = 0.2  # of a Kobuki's firmware 1.2.0, from a command to the first change of odometry
LONG_ENOUGH_S = 60.0  # to cross the hall


async def drive_at_a_wall(model: str, speed: float, *more: str) -> tuple[float, int]:
    """The room that was left before the wall, m, and how often the robot touched it."""
    settings = {
        "twin.world": "hall",
        "twin.laser.model": model,
        "twin.base.dead_time_s": DEAD_TIME_S,
    }
    config = load_config(None, [f"{key}={value}" for key, value in settings.items()] + list(more))
    clock, place = LoopClock(), open_place(config)
    simulation = Simulation(config, place, clock)
    devices = Devices(Links(config, clock, simulation))
    guard, state = Guard(config.robot.limits, config.robot.radius_m), GuardState()
    scan: Scan | None = None

    async def look() -> None:
        nonlocal scan
        while True:
            with contextlib.suppress(DeviceLost):
                scan = await devices.laser.next_scan()

    async with asyncio.TaskGroup() as tasks:
        serving = [tasks.create_task(work) for work in (devices.run(), look())]
        while clock.now() < LONG_ENOUGH_S:
            odometry = await devices.base.next_odometry()
            state, twist, _ = guard.permit(
                state,
                Twist(speed, 0.0),
                stamp=odometry.stamp,
                odometry=odometry,
                scan=scan,
                contact=devices.base.contact,
            )
            devices.base.drive(twist)
        for task in serving:
            task.cancel()
    pose = simulation.body.pose
    away = np.hypot(*place.world.wall_offsets(pose.x, pose.y, 2.0).T).min()
    return float(away) - config.robot.radius_m, simulation.body.contacts


@pytest.mark.parametrize(("model", "speed"), [("UTM-30LX", 0.7), ("URG-04LX", 0.4)])
def test_the_robot_stops_before_a_wall_though_the_base_obeys_late(model: str, speed: float) -> None:
    room, contacts = run_in_virtual_time(drive_at_a_wall(model, speed))
    assert contacts == 0
    assert 0.0 < room < 0.1


def test_the_robot_stops_before_a_wall_though_the_base_brakes_no_harder_than_it_must() -> None:
    gentle = [f"{part}.max_braking_mps2=0.3" for part in ("robot.limits", "base")]
    room, contacts = run_in_virtual_time(drive_at_a_wall("UTM-30LX", 0.7, *gentle))
    assert contacts == 0
    assert 0.0 < room < 0.1
