"""E5: crossings that look alike, told apart by where they are; and when that no longer works."""

import json
from pathlib import Path

import numpy as np

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import Row, explored
from benchmarks.figures.tours import BLOCK_M, Tour
from benchmarks.score_run import score_run

NOISES = (0.5, 1.0, 2.0, 4.0, 8.0)
SEEDS = range(15)
SETTINGS = ("exploration.policy=ears", "localisation=paper", "twin.time_limit_s=1200")
WORLDS = Path(__file__).parents[1] / "results" / "worlds.jsonl"


def find() -> Finding:
    shown = explored("grid", *SETTINGS)
    rows = [_row("full", _kept()), _row("paper", {**shown.summary, **score_run(shown.path)})]
    tours = {noise: [Tour(noise, seed).drive() for seed in SEEDS] for noise in NOISES}
    wrong = {noise: _share_wrong(some) for noise, some in tours.items()}
    sigma = {noise: np.mean([max(t.sigmas) for t in some]) for noise, some in tours.items()}
    begins = max((noise for noise, share in wrong.items() if share < 0.01), default=0.0)

    figure, (left, right) = drawing.stage(1, 2, (10.0, 4.4), ratios=[1, 1.15])
    drawing.walls(left, shown.world, color=drawing.PALE)
    left.plot(*shown.trajectory("truth").poses[:, :2].T, color=drawing.EDGE, lw=0.9)
    last = shown.trace["closures"][-1]["after"]
    for place in last["vertices"].values():
        drawing.ellipse(left, place, shown.start, drawing.VERTEX)
    drawing.ellipse(left, last["robot"], shown.start, drawing.ROBOT)
    drawing.labelled(left, "grid, by odometry between vertices, and its ellipses")
    clear = [np.mean([a.is_clear for t in some for a in t.arrivals]) for some in tours.values()]
    by_sigma = [float(sigma[noise]) for noise in NOISES]
    right.semilogx(by_sigma, clear, "o-", label="the gate alone tells which crossing it is")
    right.semilogx(by_sigma, list(wrong.values()), "s-", label="another one alike is in the gate")
    right.axvline(BLOCK_M, color=drawing.PALE)
    right.set_xticks(by_sigma, [f"{sigma:.1f}" for sigma in by_sigma])
    right.set_xticks([], minor=True)
    right.legend(
        fontsize=7, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False
    )
    drawing.labelled(
        right, f"{len(SEEDS)} tours each", "largest sigma of the robot, m", "share of arrivals"
    )
    complete = [row[1] == "explored" and row[2] == row[3] == "1.000" for row in rows]
    return Finding(
        title="A self-similar grid",
        claim="In a regular grid, where every crossing looks like the others, the position tells "
        "which one it is, and the map becomes complete.",
        verdict=f"With scan matching (`full`) the map is {'' if complete[0] else 'not '}complete "
        f"and right, by odometry between vertices (`paper`) {'as well' if complete[1] else 'not'}. "
        f"Without walls, one arrival in a hundred has another crossing of the same degree in its "
        f"gate as soon as noise is more than {begins:g} times the default of `odometry_noise` "
        f"(sigma up to {sigma[begins] if begins else 0.0:.1f} m, at {BLOCK_M:g} m from crossing "
        "to crossing).",
        holds=all(complete),
        figure=drawing.save(figure, "e5"),
        explained="Left: the exploration by odometry between vertices, which gets 1200 s. "
        "Right: the gate of three sigma by itself, without the walls that recognition looks at "
        "as well, against the noise.",
        table=(
            ("localisation", "outcome", "recall", "precision", "closures", "vertex RMSE, m"),
            *rows,
        ),
    )


def _kept() -> Row:
    """The exploration of the grid as shipped, from the table of built-in worlds."""
    rows = [json.loads(line) for line in WORLDS.read_text(encoding="utf-8").splitlines()]
    found: Row = next(r for r in rows if (r["world"], r["laser"]) == ("grid", "UTM-30LX"))
    return found


def _row(name: str, found: Row) -> tuple[str, ...]:
    shares = (f"{found[key]:.3f}" for key in ("recall", "precision"))
    closures, rmse = str(found["loop_closures"]), f"{found['vertex_rmse_m']:.2f}"
    return f"`{name}`", str(found["outcome"]), *shares, closures, rmse


def _share_wrong(tours: list[Tour]) -> float:
    found = [arrival.others_of_degree > 0 for tour in tours for arrival in tour.arrivals]
    return float(np.mean(found))
