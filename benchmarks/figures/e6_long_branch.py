"""E6: three loops and a branch of forty metres: what is uncertain, and whether that is honest."""

import math

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import Run, explored
from gvgbot.geometry import Array

WORLD = "office"
SHOWN_M = 1e-3  # at least
GATE = 9.0  # squared Mahalanobis distance: three sigma


def find() -> Finding:
    runs = {"paper": explored(WORLD, "localisation=paper"), "full": explored(WORLD)}
    figure, (left, right) = drawing.stage(1, 2, (11.0, 4.4))
    _draw_ways(left, runs["paper"])
    for (name, run), color in zip(runs.items(), (drawing.ODOMETRY, drawing.EDGE), strict=True):
        metres, u_robot, _ = run.series()
        right.semilogy(metres, 3 * np.sqrt(u_robot), color=color, label=f"{name}: three sigma")
        right.semilogy(metres, _errors(run), color=color, lw=0.7, ls=":", label=f"{name}: error")
    right.set_ylim(bottom=SHOWN_M)
    right.legend(fontsize=7)
    drawing.labelled(right, "position of the robot", "m driven", "m")
    rows = [_row(name, run) for name, run in runs.items()]
    return Finding(
        title="Three loops and a long branch",
        claim="Before the first closure the true place lies inside the ellipse; along a branch "
        "without a loop the uncertainty grows, and only the way back lowers it.",
        verdict=f"The truth is inside three sigma on {rows[0][3]} of the way with odometry between "
        f"vertices, where the largest error is {rows[0][2]} m, and on {rows[1][3]} with scan "
        f"matching, where it is {rows[1][2]} m.",
        holds=all(row[-1] == "yes" for row in rows),
        figure=drawing.save(figure, "e6"),
        explained="The built-in `office`, the same seed for both.",
        table=(
            (
                "localisation",
                "largest sigma, m",
                "largest error, m",
                "inside three sigma",
                "also before the first closure",
            ),
            *rows,
        ),
    )


def _draw_ways(axes: Axes, run: Run) -> None:
    """Where the robot was, where it believed to be, and where wheels and gyro alone had it."""
    drawing.walls(axes, run.world, color=drawing.PALE)
    for name, color, label in (
        ("odometry", drawing.ODOMETRY, "wheels and gyro alone"),
        ("online", drawing.EDGE, "as believed at the time"),
        ("truth", drawing.WALL, "truth"),
    ):
        points = run.trajectory(name).poses[:, :2]
        placed = points if name == "truth" else run.start.transform(points)
        axes.plot(*placed.T, color=color, lw=1.0, label=label)
    axes.legend(fontsize=7, loc="lower right")
    drawing.labelled(axes, "odometry between vertices (`paper`)")


def _row(name: str, run: Run) -> tuple[str, ...]:
    _, u_robot, _ = run.series()
    return (
        f"`{name}`",
        f"{math.sqrt(float(u_robot.max())):.2f}",
        f"{_errors(run).max():.2f}",
        f"{float(np.mean(_gaps(run) < GATE)):.1%}",
        "yes" if _is_inside_at_first_closure(run) else "no",
    )


def _truth(run: Run, stamps: Array) -> Array:
    """Where the robot was at stamps, (N, 2), map frame."""
    truth = run.trajectory("truth")
    at = np.column_stack([np.interp(stamps, truth.stamps, axis) for axis in truth.poses[:, :2].T])
    return run.start.inverse().transform(at)


def _offsets(run: Run) -> Array:
    rows = run.trace["rows"]
    believed = np.array([row["robot"][:2] for row in rows])
    return believed - _truth(run, np.array([row["stamp"] for row in rows]))


def _errors(run: Run) -> Array:
    found: Array = np.hypot(*_offsets(run).T)
    return found


def _gaps(run: Run) -> Array:
    """Squared Mahalanobis distances of the truth at the keyframes but the first, which is exact."""
    gaps = [
        _gap(offset, row["robot"])
        for offset, row in zip(_offsets(run)[1:], run.trace["rows"][1:], strict=True)
    ]
    return np.array(gaps)


def _gap(offset: Array, place: list[float]) -> float:
    _, _, xx, xy, yy = place
    return float(offset @ np.linalg.solve(np.array([[xx, xy], [xy, yy]]), offset))


def _is_inside_at_first_closure(run: Run) -> bool:
    first = run.trace["closures"][0]
    believed = first["before"]["robot"]
    stamp = max(row["stamp"] for row in run.trace["rows"] if row["stamp"] < first["stamp"])
    (truth,) = _truth(run, np.array([stamp]))
    return _gap(np.array(believed[:2]) - truth, believed) < GATE
