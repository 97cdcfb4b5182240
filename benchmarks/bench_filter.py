"""Time of the filter with ever more vertices: motions, one in sight, a closed loop, the gates.

All but one with old poses of the robot in the state, as when walls tell where it is.

Run: python benchmarks/bench_filter.py [VERTICES ...]   (default: 100 500 2000)
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from benchmarks.report import report
from gvgbot.autonomy.slam.ekf import (
    Belief,
    OdometryNoise,
    distances,
    predict_in_place,
    update_in_place,
    update_vertex_in_place,
)
from gvgbot.autonomy.slam.trail import MOST, Laid, move
from gvgbot.geometry import Pose

SIZES = (100, 500, 2000)
TIMES = 5
KEYFRAME_MS = 250.0  # between two of them, at full speed
MOTION = Pose(0.25, 0.01, 0.05)


def belief_of(vertices: int) -> Belief:
    """A robot amid vertices, all of them correlated through some common errors."""
    rng = np.random.default_rng(vertices)
    n = 3 + 3 * vertices
    common = rng.normal(0.0, 0.05, (n, 6))
    P = common @ common.T
    P[np.diag_indices(n)] += 1e-3
    return Belief(rng.uniform(-3.0, 3.0, n), P, tuple(range(1, vertices + 1)))


def laid(look: int) -> Laid:
    """A look that is laid onto the walls of all looks before, at most forty."""
    looks = np.arange(max(1, look - 40), look)[:, None] + (0, 1)
    gains = np.repeat(0.8 / len(looks) * np.eye(3)[None], len(looks), axis=0)
    noise, some = 1e-6 * np.eye(3), 0.01 * np.eye(3)
    return Laid(Pose(0.25 * look), look, looks, gains, some, noise, noise, np.eye(3), some)


def cpu_ms(do: Callable[[], object]) -> float:
    """Median CPU time of a few goes, ms."""
    spent = []
    for _ in range(TIMES):
        begin = time.process_time()
        do()
        spent.append(time.process_time() - begin)
    return 1e3 * float(np.median(spent))


def bench(vertices: int) -> None:
    """Time one size of map."""
    belief, noise = belief_of(vertices), OdometryNoise()
    growth, R = noise.covariance(MOTION, 0.5), 0.01 * np.eye(3)
    seen = belief.map_base.to(belief.map_vertex(1))
    blind = cpu_ms(lambda: predict_in_place(belief, MOTION, growth))
    for look in range(2, MOST + 2):
        belief = move(belief, MOTION, growth, laid(look))
    steps: dict[str, Callable[[], object]] = {
        "motion": lambda: move(belief, MOTION, growth, laid(MOST + 2)),
        "vertex still in sight": lambda: update_vertex_in_place(belief, 1, seen, R[:2, :2]),
        "loop closed": lambda: update_in_place(belief, 1, seen, R),
        "gates of all vertices": lambda: distances(belief, np.zeros(2), R[:2, :2]),
    }
    report(f"{vertices} vertices: motion without walls", blind, "ms", at_most=KEYFRAME_MS)
    for name, do in steps.items():
        report(f"{vertices} vertices: {name}", cpu_ms(do), "ms", at_most=KEYFRAME_MS)


def main() -> None:
    """Time the sizes of the command line."""
    for vertices in [int(text) for text in sys.argv[1:]] or SIZES:
        bench(vertices)


if __name__ == "__main__":
    main()
