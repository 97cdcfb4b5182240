"""Watch a robot from another program, on the same machine or over the network.

    with gvgbot.client.connect("sim") as robot:
        for state in robot.state():
            print(state.phase, state.pose)

The same with `async with` and `async for`.
"""

from gvgbot.client.presence import Presence
from gvgbot.client.robot import DEFAULT_ENDPOINT, Robot, connect, robots
from gvgbot.topics import Event, LinkHealth, Map, MapEdge, MapVertex, State

__all__ = [
    "DEFAULT_ENDPOINT",
    "Event",
    "LinkHealth",
    "Map",
    "MapEdge",
    "MapVertex",
    "Presence",
    "Robot",
    "State",
    "connect",
    "robots",
]
