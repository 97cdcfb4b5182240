"""E9: what comes of it if one part is otherwise."""

import numpy as np

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import RUNS, Run, explored
from benchmarks.figures.tours import Tour
from benchmarks.figures.worlds import BRANCHES_START, branches, saved
from benchmarks.score_run import score_run

PAPER = "localisation=paper"
CERTAINTY = "exploration.certainty"
IN_OFFICE = {
    "office: as shipped": (),
    "office: ears": ("exploration.policy=ears",),
    "office: odometry between vertices, and their positions": (PAPER,),
}
ON_BRANCHES = {
    "branches: odometry between vertices, and their positions": (PAPER,),
    "branches: the same, p_explore 0.5": (PAPER, f"{CERTAINTY}.p_explore=0.5"),
}
SEEDS = range(20)
NOISE = 0.5


def find() -> Finding:
    runs = {name: explored("office", *settings) for name, settings in IN_OFFICE.items()}
    path, start = saved(branches(), RUNS / "worlds"), f"twin.start={BRANCHES_START}"
    for name, (localisation, *settings) in ON_BRANCHES.items():
        runs[name] = explored(path, localisation, start, *settings)
    figure, (left, right) = drawing.stage(1, 2, (11.0, 3.8), ratios=[1.6, 1])
    for name, run in runs.items():
        metres, u_robot, _ = run.series()
        style = "-" if name in (next(iter(IN_OFFICE)), next(iter(ON_BRANCHES))) else "--"
        left.semilogy(metres, np.sqrt(np.maximum(u_robot, 1e-6)), style, lw=1.2, label=name)
    left.legend(fontsize=6)
    drawing.labelled(left, "uncertainty along the runs", "m driven", "sigma of the robot, m")
    nees = {
        "whole covariance": [Tour(NOISE, seed).drive().nees for seed in SEEDS],
        "robot and vertices apart": [
            Tour(NOISE, seed, independent=True).drive().nees for seed in SEEDS
        ],
    }
    right.boxplot(list(nees.values()), tick_labels=list(nees))
    right.axhline(2.0, color=drawing.PALE)
    right.set_yscale("log")
    drawing.labelled(right, f"NEES of vertices, {len(SEEDS)} tours of a grid; 2 is right")
    whole, apart = (float(np.mean(values)) for values in nees.values())
    return Finding(
        title="Ablations",
        claim="Each part is there for a reason.",
        verdict=f"Without what robot and vertices have in common the filter is overconfident: NEES "
        f"{apart:.1f} instead of {whole:.1f}, where 2 is right. The table has "
        "what else was changed.",
        holds=apart > 2 * whole,
        figure=drawing.save(figure, "e9"),
        explained="Left: one run each, the same seed. Right: the filter by itself. Where two "
        "rows are the same, so were the runs.",
        table=(
            ("run", "way, m", "closures", "largest sigma, m", "vertex RMSE, m", "recall"),
            *(_row(name, run) for name, run in runs.items()),
        ),
    )


def _row(name: str, run: Run) -> tuple[str, ...]:
    score = score_run(run.path)
    _, u_robot, _ = run.series()
    return (
        name,
        f"{run.summary['distance_m']:.0f}",
        str(run.summary["loop_closures"]),
        f"{np.sqrt(u_robot.max()):.2f}",
        f"{score['vertex_rmse_m']:.3f}",
        f"{score['recall']:.3f}",
    )
