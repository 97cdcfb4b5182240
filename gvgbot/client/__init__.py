"""Watch a robot from another program, on the same machine or over the network.

    with gvgbot.client.connect("sim") as robot:
        for state in robot.state():
            print(state.phase, state.pose)

The same with `async with` and `async for`. What its configuration permits can be asked of it:

    answer = await robot.goto(7)            # in a program with a loop
    answer = robot.goto(1.5, -2.0).result()  # in one without
"""

from gvgbot.client.asking import Asking, Refused
from gvgbot.client.network import DEFAULT_ENDPOINT, only_robot, robots
from gvgbot.client.presence import Presence
from gvgbot.client.robot import Robot, connect
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.tiles import Grid, Raster, Tile
from gvgbot.topics import (
    Event,
    Health,
    LinkHealth,
    Map,
    MapEdge,
    MapVertex,
    Odometry,
    Plan,
    Scan,
    State,
    Trajectory,
)

__all__ = [
    "DEFAULT_ENDPOINT",
    "Asking",
    "Event",
    "Grid",
    "GvgbotError",
    "Health",
    "LinkHealth",
    "Map",
    "MapEdge",
    "MapVertex",
    "Odometry",
    "Plan",
    "Presence",
    "Raster",
    "Refused",
    "Robot",
    "Scan",
    "State",
    "Tile",
    "Trajectory",
    "UsageError",
    "connect",
    "only_robot",
    "robots",
]
