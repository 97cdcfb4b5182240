"""The robot that telemetry is timed with shows a whole map, as a daemon does."""

from typing import Any, cast

from benchmarks.bench_telemetry import VERTICES, Robot
from gvgbot.telemetry import Telemetry
from gvgbot.tiles import Grid
from gvgbot.topics import Map, Trajectory


class Published:
    """A network that keeps what is said."""

    def __init__(self) -> None:
        self.said: list[Any] = []

    def publish(self, value: Any, latest: bool = True) -> None:
        self.said.append(value)


def test_it_shows_graph_grid_and_way() -> None:
    network = Published()
    robot = Robot(cast(Telemetry, network))
    robot.fill()
    robot.on_map()
    assert {Map, Grid, Trajectory} <= {type(value) for value in network.said}
    (known,) = [value for value in network.said if isinstance(value, Map)]
    assert len(known.vertices) == VERTICES
