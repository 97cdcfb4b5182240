"""A saved map in the formats of other programs."""

from collections.abc import Callable
from pathlib import Path

from gvgbot.errors import UsageError
from gvgbot.maps import geojson, graphml
from gvgbot.maps.atomic_files import write_files
from gvgbot.maps.canvas import Canvas
from gvgbot.maps.drawing import Drawing
from gvgbot.maps.pdf import pdf
from gvgbot.maps.picture import S, draw_map_on
from gvgbot.maps.saved_run import SavedRun
from gvgbot.maps.svg import svg

FORMATS: dict[str, Callable[[SavedRun], bytes]] = {
    ".png": lambda run: _map_on(Canvas, run).png(),
    ".svg": lambda run: svg(_map_on(Drawing, run)),
    ".pdf": lambda run: pdf(_map_on(Drawing, run)),
    ".graphml": lambda run: graphml.encode(run.graph),
    ".geojson": lambda run: geojson.encode(run.graph).encode(),
}


def export(directory: Path, out: Path) -> None:
    """Write the map of a run in the format that the file's name ends with.

    Raises UsageError if there is no such format, or the run cannot be read; GvgbotError if nothing
    can be written.
    """
    encode = FORMATS.get(out.suffix.lower())
    if encode is None:
        raise UsageError(f"{out}: let its name end in one of {', '.join(FORMATS)}")
    run = SavedRun.read(directory)
    if not out.parent.is_dir():
        raise UsageError(f"cannot write {out}: there is no directory {out.parent}")
    write_files(out.parent, {out.name: encode(run)})


def _map_on(sheet: Callable[[int, int], S], run: SavedRun) -> S:
    return draw_map_on(
        sheet,
        run.graph,
        grid=run.grid,
        estimate=run.estimate,
        odometry=run.odometry,
        title=run.name,
    )
