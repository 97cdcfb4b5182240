"""What the figures have in common: stages, walls, graphs, ellipses, and where they are saved."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose

FOLDER = Path(__file__).parents[2] / "docs" / "images" / "figures"
WALL, EDGE, ODOMETRY, ROBOT, VERTEX, PALE = (
    "#3b4252", "#1f77b4", "#d9822b", "#c0392b", "#2a9d5c", "#9aa5b1",
)  # fmt: skip
SIGMAS = 3.0
DPI = 90


def stage(
    rows: int, columns: int, size: tuple[float, float], *, ratios: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row; size in inches."""
    mpl.use("Agg")
    shares = {"width_ratios": ratios} if ratios is not None else None
    figure, axes = plt.subplots(
        rows, columns, figsize=size, layout="constrained", squeeze=False, gridspec_kw=shares
    )
    return figure, list(axes.ravel())


def save(figure: Figure, name: str) -> str:
    """Write the figure; its path, seen from docs/."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / f"{name}.png", dpi=DPI, metadata={"Software": None})
    plt.close(figure)
    return f"images/figures/{name}.png"


def walls(axes: Axes, world: World, *, color: str = WALL) -> None:
    """The world in its own frame, m, without ticks."""
    x0, y0, x1, y1 = world.extent
    axes.imshow(
        np.where(world.occupied, 1.0, np.nan),
        origin="lower",
        extent=(x0, x1, y0, y1),
        cmap=ListedColormap([color]),
        interpolation="nearest",
        zorder=0,
    )
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xticks=[], yticks=[], aspect="equal")


def lines(axes: Axes, polylines: Iterable[Array], **style: Any) -> None:
    """Polylines (N, 2) in one colour."""
    for line in polylines:
        axes.plot(*np.asarray(line).T, **{"color": EDGE, "lw": 1.3, **style})


def ellipse(
    axes: Axes, place: Sequence[float], world_map: Pose, color: str, *, sigmas: float = SIGMAS
) -> None:
    """The ellipse of a row x, y, xx, xy, yy of the map frame, turned into the world's."""
    x, y, xx, xy, yy = place
    values, vectors = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]) + world_map.theta)
    (centre,) = world_map.transform(np.array([[x, y]]))
    minor, major = (2 * sigmas * np.sqrt(np.maximum(values, 0.0))).tolist()
    axes.add_patch(
        Ellipse(tuple(centre), major, minor, angle=angle, fill=False, ec=color, lw=1.1, zorder=4)
    )
    axes.plot(*centre, ".", color=color, ms=3, zorder=5)


def labelled(axes: Axes, title: str, x: str = "", y: str = "") -> None:
    """Title and labels in one size."""
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(labelsize=7)


def shades(count: int) -> list[tuple[float, ...]]:
    """As many colours, told apart."""
    return [tuple(colour) for colour in mpl.colormaps["viridis"](np.linspace(0.0, 0.9, count))]
