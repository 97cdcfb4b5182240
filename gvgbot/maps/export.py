"""A saved map in the formats of other programs."""

from collections.abc import Callable
from pathlib import Path

from gvgbot.atomic_files import write_files
from gvgbot.errors import UsageError
from gvgbot.maps import graphml, route_server
from gvgbot.maps.outputs import check_output
from gvgbot.maps.picture_files import PICTURES
from gvgbot.maps.saved_run import SavedRun
from gvgbot.maps.show import picture_of

GRAPHS: dict[str, Callable[[SavedRun], bytes]] = {
    ".graphml": lambda run: graphml.encode(run.graph),
    ".geojson": lambda run: route_server.encode(run.graph).encode(),
}


def export(directory: Path, out: Path) -> str | None:
    """Write the map of a run in the format that the file's name ends with; what it is not good for.

    Raises UsageError if there is no such format, the run cannot be read, or a run needs the file
    that is there; GvgbotError if nothing can be written.
    """
    suffix = out.suffix.lower()
    if suffix not in PICTURES and suffix not in GRAPHS:
        raise UsageError(f"{out}: let its name end in one of {', '.join((*PICTURES, *GRAPHS))}")
    run = SavedRun.read(directory)
    check_output(out)
    write_files(out.parent, {out.name: _encoded(run, suffix)})
    if suffix == ".geojson" and not run.graph.edges:
        return "there is no edge in it, and Nav2's route server refuses a graph without one"
    return None


def _encoded(run: SavedRun, suffix: str) -> bytes:
    encode = PICTURES.get(suffix)
    return GRAPHS[suffix](run) if encode is None else encode(picture_of(run))
