"""Where a picture or an export of a run may go."""

from pathlib import Path

from gvgbot.errors import UsageError
from gvgbot.maps.map_server import SEEN
from gvgbot.maps.run_directory import EVENTS, MAP

# what cannot be made anew of a run, in formats that can be asked for: its pictures can
_KEPT = {MAP, "team.geojson", SEEN, "world.png"}


def check_output(out: Path) -> None:
    """Raises UsageError for a file in no directory, or one that a run needs to be read again."""
    if not out.parent.is_dir():
        raise UsageError(f"cannot write {out}: there is no directory {out.parent}")
    if out.name in _KEPT and (out.parent / EVENTS).exists():
        raise UsageError(f"cannot write {out}: a run needs what is there; name another file")
