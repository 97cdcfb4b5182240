"""The robot that telemetry is timed with shows a whole map, as a daemon does."""

from typing import cast

from benchmarks.bench_telemetry import VERTICES, Robot
from benchmarks.rigs.run_rig import Network
from gvgbot.telemetry import Telemetry


def test_it_shows_graph_grid_and_way() -> None:
    network = Network()
    robot = Robot(cast(Telemetry, network))
    robot.fill()
    robot.on_map()
    assert network.grids
    assert network.trajectories
    (known,) = network.maps
    assert len(known.vertices) == VERTICES
