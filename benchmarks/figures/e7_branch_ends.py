"""E7: two small loops and two branches: how far off their ends are."""

import numpy as np

from benchmarks.figures import drawing, worlds
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import RUNS, Run, explored
from benchmarks.reference_gvg import reference_gvg

SEEDS = (1, 2)
PUBLISHED_M = 2.0  # at the end of a branch


def find() -> Finding:
    path = worlds.saved(worlds.branches(), RUNS / "worlds")
    settings = ("localisation=paper", f"twin.start={worlds.BRANCHES_START}")
    runs = [explored(path, *settings, seed=seed) for seed in SEEDS]
    rows = [_row(seed, run) for seed, run in zip(SEEDS, runs, strict=True)]
    figure, (left, right) = drawing.stage(1, 2, (11.0, 3.8), ratios=[1.3, 1])
    run = runs[0]
    drawing.walls(left, run.world, color=drawing.PALE)
    odometry = run.start.transform(run.trajectory("odometry").poses[:, :2])
    left.plot(*odometry.T, color=drawing.ODOMETRY, lw=0.8, label="wheels and gyro alone")
    for vertex in run.route.vertices:
        xx, xy, _, yy = vertex.covariance
        drawing.ellipse(left, [*vertex.position, xx, xy, yy], run.start, drawing.VERTEX)
    left.legend(fontsize=7)
    drawing.labelled(left, "vertices by odometry between them, ellipses of three sigma")
    for seed, row in zip(SEEDS, rows, strict=True):
        right.plot(
            [0.0, *worlds.BRANCH_ENDS],
            [float(cell) for cell in row[1:]],
            "o-",
            label=f"seed {seed}",
        )
    right.axhline(PUBLISHED_M, color=drawing.PALE)
    right.legend(fontsize=7)
    drawing.labelled(right, "error of vertices", "length of the branch, m; 0: on the loops", "m")
    worst = max(float(row[-1]) for row in rows)
    return Finding(
        title="Ends of branches",
        claim="Vertices of the loops are placed well, the ends of long branches about two metres "
        "off: nothing can lower their uncertainty.",
        verdict=f"On the loops vertices are {' and '.join(row[1] for row in rows)} m off (RMSE), "
        f"at the end of the branch of 45 m {' and '.join(row[-1] for row in rows)} m.",
        holds=worst < PUBLISHED_M,
        figure=drawing.save(figure, "e7"),
        explained=f"Two small loops with branches of 21 and 45 m, seeds {SEEDS[0]} and {SEEDS[1]}. "
        "The line is the error that was published.",
        table=(
            ("seed", "on the loops, m", *(f"end at {m:g} m" for m in worlds.BRANCH_ENDS)),
            *rows,
        ),
    )


def _row(seed: int, run: Run) -> tuple[str, ...]:
    """RMSE of the loops' vertices, and the errors at the branches' ends, m."""
    places = run.start.transform(np.array([v.position for v in run.route.vertices]))
    is_end = np.array([v.kind == "endpoint" for v in run.route.vertices])
    graph = reference_gvg(run.world, (run.start.x, run.start.y), 0.177).graph
    true = np.array([graph.nodes[n]["position"] for n in graph if graph.degree(n) >= 3])
    loops = np.array([np.hypot(*(true - place).T).min() for place in places[~is_end]])
    cells = [f"{np.sqrt(np.mean(loops**2)):.2f}"]
    tips = np.array([graph.nodes[n]["position"] for n in graph if graph.degree(n) == 1])
    for end in worlds.BRANCH_ENDS.values():
        tip = tips[np.hypot(*(tips - end).T).argmin()]
        cells.append(f"{np.hypot(*(places[is_end] - tip).T).min():.2f}")
    return str(seed), *cells
