"""A robot that drives on its devices until its mission is over."""

import asyncio
from collections.abc import Callable

from gvgbot.autonomy.events import Event
from gvgbot.autonomy.loop import Log, Loop
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import RobotConfig
from gvgbot.hal.guard import Guard
from gvgbot.hal.messages import Odometry
from gvgbot.links import Devices

CARRIED = "no walls that it knows are around it: it may have been carried"


async def drive(
    robot: RobotConfig,
    devices: Devices,
    pipeline: Pipeline,
    *,
    on_events: Callable[[list[Event]], None] = lambda happened: None,
    on_cycle: Callable[[Odometry], None] = lambda odometry: None,
    log: Log | None = None,
    goes_on: Callable[[], bool] | None = None,
    limit_s: float | None = None,
) -> str | None:
    """Serve the devices, and drive as `Loop` does; why that was not over in time, if it was not.

    The robot stands while a device is away.
    """
    loop = Loop(
        devices.laser,
        devices.base,
        pipeline,
        Guard(robot.limits, robot.radius_m),
        on_events=on_events,
        on_cycle=on_cycle,
        log=log,
        goes_on=goes_on,
    )
    trouble = None
    async with asyncio.TaskGroup() as tasks:
        serving = tasks.create_task(devices.run(), name="devices")
        try:
            async with asyncio.timeout(limit_s):
                await loop.run()
        except TimeoutError:
            trouble = devices.away or f"not explored after {limit_s:g} s"
        serving.cancel()
    return trouble
