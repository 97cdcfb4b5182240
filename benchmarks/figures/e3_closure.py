"""E3: what one loop closure does to the uncertainty of robot and map."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import Row, Run, explored

WORLD = "jittered:1"
MODES = ("paper", "full")


def find() -> Finding:
    figure, axes = drawing.stage(2, 2, (9.0, 9.0))
    rows, falls = [], []
    for mode, (left, right) in zip(MODES, (axes[:2], axes[2:]), strict=True):
        settings = ["exploration.policy=ears"]
        run = explored(WORLD, *settings, *(["localisation=paper"] if mode == "paper" else []))
        closure = max(run.trace["closures"], key=_fall)
        for when, stage in (("before", left), ("after", right)):
            _draw(stage, run, closure[when])
            drawing.labelled(stage, f"{mode}: {when} vertex {closure['closed'][0]} was known again")
        before, after = closure["before"], closure["after"]
        falls.append(_fall(closure))
        rows.append(
            (
                f"`{mode}`",
                f"{closure['travelled']:.0f}",
                f"{_u(before['robot']):.4f} to {_u(after['robot']):.4f}",
                f"{_u_map(before):.3f} to {_u_map(after):.3f}",
                f"{np.sqrt(_u(min(after['vertices'].items(), key=_by_age)[1])):.3f}",
            )
        )
    return Finding(
        title="Loop closure",
        claim="When a known vertex is recognised, the ellipses of robot and vertices shrink.",
        verdict=f"u_robot falls from {rows[0][2]} m² with odometry alone (`paper`), and from "
        f"{rows[1][2]} m² with scan matching (`full`); u_map from {rows[0][3]} and "
        f"{rows[1][3]} m².",
        holds=min(falls) > 0,
        figure=drawing.save(figure, "e3"),
        explained=f"The closure of `{WORLD}` that tells most, with ellipses of three sigma: robot "
        "red, vertices green. u is the trace of a position's covariance.",
        table=(
            ("localisation", "after m", "u_robot, m²", "u_map, m²", "sigma of first vertex, m"),
            *rows,
        ),
    )


def _u(place: list[float]) -> float:
    return place[2] + place[4]


def _u_map(state: Row) -> float:
    return sum(_u(place) for place in state["vertices"].values())


def _fall(closure: Row) -> float:
    return _u(closure["before"]["robot"]) - _u(closure["after"]["robot"])


def _by_age(vertex: tuple[str, list[float]]) -> int:
    return int(vertex[0])


def _draw(axes: Axes, run: Run, state: Row) -> None:
    drawing.walls(axes, run.world, color=drawing.PALE)
    for place in state["vertices"].values():
        drawing.ellipse(axes, place, run.start, drawing.VERTEX)
    drawing.ellipse(axes, state["robot"], run.start, drawing.ROBOT)
