"""What `gvgbot map` does: pictures of a run that was saved, and its facts in words."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from gvgbot.atomic_files import write_files
from gvgbot.errors import UsageError
from gvgbot.maps import film
from gvgbot.maps.growth import Growth
from gvgbot.maps.outputs import check_output
from gvgbot.maps.picture import draw_map_on, known_corners
from gvgbot.maps.picture_files import PICTURES, Paint
from gvgbot.maps.route_graph import RouteGraph, RouteNode
from gvgbot.maps.saved_run import SavedRun, robots_in
from gvgbot.maps.surface import S
from gvgbot.words import counted

FRAMES = 60  # of a film, if nobody says how many


def show(directory: Path, out: Path | None, *, animate: bool, frames: int | None) -> Path:
    """Draw a run and return the path of the picture: a film, a strip of moments, or its last map.

    Raises UsageError if the run cannot be read or drawn so, or a run needs the file that is there;
    GvgbotError if nothing can be written.
    """
    name = "film.gif" if animate else "picture.png" if frames is None else "strip.png"
    out = out or directory / name
    suffix, fit = out.suffix.lower(), [".gif"] if animate else list(PICTURES)
    if suffix not in fit:
        film_needs = "; a GIF needs --animate" if suffix == ".gif" else ""
        raise UsageError(f"{out}: let its name end in {' or '.join(fit)}{film_needs}")
    run = SavedRun.read(directory)
    check_output(out)
    if animate:
        picture = film.gif(_growth(run, directory), frames or FRAMES)
    elif frames is not None:
        picture = PICTURES[suffix](_strip(_growth(run, directory), frames))
    else:
        picture = PICTURES[suffix](picture_of(run))
    write_files(out.parent, {out.name: picture})
    return out


def picture_of(run: SavedRun) -> Paint:
    """The map of a run as a picture."""

    def paint(sheet: Callable[[int, int], S], /) -> S:
        return draw_map_on(
            sheet,
            run.graph,
            grid=run.grid,
            estimate=run.estimate,
            odometry=run.odometry,
            virtual_walls=run.virtual_walls,
            title=run.name,
        )

    return paint


def _strip(growth: Growth, moments: int) -> Paint:
    def paint(sheet: Callable[[int, int], S], /) -> S:
        return film.draw_strip(sheet, growth, moments)

    return paint


def _growth(run: SavedRun, directory: Path) -> Growth:
    if len(run.estimate.stamps):
        return Growth.of(run)
    if several := ", ".join(map(str, robots_in(directory))):
        raise UsageError(f"{directory} is a run of several robots: name one of {several}")
    raise UsageError(f"{run.name} has nothing to animate: the robot never got going")


def facts(run: SavedRun) -> Iterator[str]:
    """What there is to know of a map, in lines."""
    graph, kinds = run.graph, Counter(vertex.kind for vertex in run.graph.vertices)
    if run.summary is not None:
        yield f"outcome    {run.summary.outcome}: {run.summary.reason}"
        yield f"driven     {run.summary.distance_m:.1f} m in {film.clock(run.summary.duration_s)}"
        if run.summary.loop_closures is not None:
            yield f"closures   {run.summary.loop_closures}"
    yield (
        f"vertices   {len(graph.vertices)}: {counted(kinds['meetpoint'], 'meetpoint')}, "
        f"{counted(kinds['endpoint'], 'endpoint')}"
    )
    yield f"frontiers  {sum(len(vertex.frontiers) for vertex in graph.vertices)} left"
    yield f"edges      {len(graph.edges)} of {sum(e.length for e in graph.edges):.1f} m in all"
    if graph.edges:
        yield f"narrowest  {min(edge.min_clearance for edge in graph.edges):.2f} m to the walls"
    if len(corners := known_corners(run.grid)):
        width, height = corners[1] - corners[0]
        yield f"extent     {width:.1f} m x {height:.1f} m, {_free_area(run):.0f} m^2 of it free"
    if graph.vertices:
        yield _accuracy(graph)


def _free_area(run: SavedRun) -> float:
    return float(np.count_nonzero(run.grid.cells == 0) * run.grid.resolution_m**2)


def _accuracy(graph: RouteGraph) -> str:
    sigmas = {vertex.id: _sigma(vertex) for vertex in graph.vertices}
    worst = max(sigmas, key=lambda number: sigmas[number])
    median = float(np.median(list(sigmas.values())))
    return (
        f"accuracy   sigma of a vertex {median:.3f} m (median), {sigmas[worst]:.3f} m at worst "
        f"(vertex {worst}), as the robot estimates it"
    )


def _sigma(vertex: RouteNode) -> float:
    """The standard deviation (m) of a vertex in the direction in which it is largest."""
    variances = np.linalg.eigvalsh(np.array(vertex.covariance).reshape(2, 2))
    return float(np.sqrt(max(0.0, variances[-1])))
