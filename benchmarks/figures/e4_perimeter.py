"""E4: along the outer wall no loop closes for long, unless uncertainty calls the robot back."""

import math

import numpy as np

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.tours import NORTH, SOUTH, Tour

SEEDS = range(5)
LIMIT = 2.0  # m


def find() -> Finding:
    tours = {
        "around the first block": [Tour(1.0, s, came_from=NORTH).drive() for s in SEEDS],
        "outer wall on the left": [Tour(1.0, s, came_from=SOUTH).drive() for s in SEEDS],
        f"the same, back above {LIMIT:g} m": [
            Tour(1.0, s, came_from=SOUTH, limit=LIMIT).drive() for s in SEEDS
        ],
    }
    rows = [_row(name, some) for name, some in tours.items()]
    figure, (left, right) = drawing.stage(1, 2, (10.0, 3.4))
    for name, some in tours.items():
        left.plot(some[0].sigmas, label=name)
        known = np.cumsum([not arrival.is_known for arrival in some[0].arrivals])
        right.plot(known, label=name)
    left.legend(fontsize=7)
    drawing.labelled(left, "uncertainty of the robot", "crossings passed", "sigma, m")
    drawing.labelled(right, "crossings that are known", "crossings passed")
    (_, inside, _, _), (_, outside, high, _), (_, _, low, _) = rows
    return Finding(
        title="Outer perimeter",
        claim="With the outer wall on its left, the ear rule goes round the whole building first: "
        "eight vertices in a row without a closure, and a large uncertainty. Going back to what is "
        "certain, when the pose is not, cures it.",
        verdict=f"{outside} new crossings before the first closure along the outer wall, {inside} "
        f"around a block. The largest sigma of the robot falls from {high} to {low} m if it turns "
        f"back above {LIMIT:g} m.",
        holds=int(outside) > int(inside) and float(low) < float(high) / 2,
        figure=drawing.save(figure, "e4"),
        explained="Five by five crossings, ten metres apart, by odometry alone; the filter is the "
        "project's own, the way is simulated without walls. Means of five seeds, the lines are of "
        "the first.",
        table=(("start", "new before a closure", "largest sigma, m", "crossings passed"), *rows),
    )


def _row(name: str, tours: list[Tour]) -> tuple[str, str, str, str]:
    new = np.mean([tour.before_closure for tour in tours])
    sigma = np.mean([max(tour.sigmas) for tour in tours])
    passed = np.mean([len(tour.arrivals) for tour in tours])
    return name, f"{new:.0f}", f"{sigma:.1f}", f"{math.floor(passed)}"
