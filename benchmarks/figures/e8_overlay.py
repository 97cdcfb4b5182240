"""E8: the graph laid over the occupancy grid, with ellipses."""

from dataclasses import dataclass

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import Run, explored
from gvgbot.geometry import Array, Pose

WORLD = "office"
FREE = 250  # of a pixel


@dataclass(frozen=True)
class Grid:
    """Pixels, the first row on top; m a pixel; the lower left corner, m, map frame."""

    grey: NDArray[np.uint8]
    size: float
    corner: tuple[float, float]

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least and greatest x, then y."""
        (x, y), (height, width) = self.corner, self.grey.shape
        return x, x + width * self.size, y, y + height * self.size

    def is_free(self, points: Array) -> NDArray[np.bool_]:
        """Of points (N, 2)."""
        columns, rows = np.floor((points - self.corner) / self.size).astype(int).T
        return np.asarray(self.grey[len(self.grey) - 1 - rows, columns] >= FREE)


def find() -> Finding:
    run = explored(WORLD)
    figure, (axes,) = drawing.stage(1, 1, (8.0, 5.6))
    grid = _grid(run)
    axes.imshow(grid.grey, cmap="gray", extent=grid.extent, vmin=0, vmax=255, zorder=0)
    places = {vertex.id: vertex.position for vertex in run.route.vertices}
    drawing.lines(axes, (edge.polyline for edge in run.route.edges), lw=1.6)
    straight = [np.array([places[e.start], places[e.end]]) for e in run.route.edges]
    drawing.lines(axes, straight, color=drawing.ODOMETRY, ls=":", lw=1.2)
    for vertex in run.route.vertices:
        xx, xy, _, yy = vertex.covariance
        drawing.ellipse(axes, [*vertex.position, xx, xy, yy], Pose(), drawing.ROBOT, sigmas=9.0)
    axes.set(xticks=[], yticks=[])
    drawing.labelled(axes, "grid, edges as driven (blue) and straight (dotted), ellipses threefold")
    points = np.concatenate([edge.polyline for edge in run.route.edges])
    share = float(np.mean(grid.is_free(points)))
    return Finding(
        title="Overlay on the grid",
        claim="Graph and grid of one run fit each other.",
        verdict=f"{share:.1%} of the points of the edges are on free cells of the grid.",
        holds=share > 0.99,
        figure=drawing.save(figure, "e8"),
        explained="The built-in `office`. Ellipses are three times as large as those of three "
        "sigma, which could hardly be seen.",
    )


def _grid(run: Run) -> Grid:
    about = yaml.safe_load((run.path / "map.yaml").read_text(encoding="utf-8"))
    (x, y, _), size = about["origin"], about["resolution"]
    return Grid(np.array(Image.open(run.path / "map.pgm")), size, (x, y))
