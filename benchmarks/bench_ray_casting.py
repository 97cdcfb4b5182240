"""Time of one laser sweep and of one step of the robot body, at random free places of a world.

Run: python benchmarks/bench_ray_casting.py [WORLD ...]   (built-in names or map_server YAML files)
"""

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.report import report_fact
from gvgbot.drivers.body import RobotBody
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.worlds import open_world

BEARINGS = np.deg2rad(np.linspace(-135.0, 135.0, 1081))
RADIUS = 0.18  # m
SWEEPS = 500
WORLDS = ("office", "cave", "floor_plan")


def free_poses(world: World, rng: np.random.Generator) -> list[Pose]:
    """Random places that are clear of walls."""
    x0, y0, x1, y1 = world.extent
    poses: list[Pose] = []
    while len(poses) < SWEEPS:
        x, y, theta = rng.uniform((x0, y0, -np.pi), (x1, y1, np.pi))
        if world.clear_of_walls(x, y) > RADIUS:
            poses.append(Pose(x, y, theta))
    return poses


def report_times(what: str, action: Callable[[Pose], object], poses: list[Pose]) -> None:
    """Median and 95th percentile of the CPU time that the action takes, in ms."""
    times = []
    for pose in poses:
        begin = time.thread_time()
        action(pose)
        times.append(time.thread_time() - begin)
    for share in (50, 95):
        report_fact(f"{what}, p{share}", 1e3 * float(np.percentile(times, share)), "ms")


def drive(world: World, pose: Pose) -> None:
    """Fifty control periods of slow driving."""
    body = RobotBody(world, pose)
    body.command(0.05, 0.5)
    for k in range(1, 51):
        body.advance(0.02 * k)


def main() -> None:
    """Time each world."""
    rng = np.random.default_rng(1)
    for name in sys.argv[1:] or WORLDS:
        world, _ = open_world(name)
        poses = free_poses(world, rng)
        for reach in (5.6, 30.0):
            world.cast(poses[0], BEARINGS, reach)
            sweep = partial(world.cast, bearings=BEARINGS, max_range=reach)
            report_times(f"{name}: 1081 beams to {reach} m", sweep, poses)
        report_times(f"{name}: 50 steps of the body", partial(drive, world), poses)


if __name__ == "__main__":
    main()
