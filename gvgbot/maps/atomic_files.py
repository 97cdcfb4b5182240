"""Files that are either the old one or the new one, never half of each."""

from collections.abc import Mapping
from pathlib import Path

from gvgbot.errors import GvgbotError


def write_files(directory: Path, contents: Mapping[str, bytes | str]) -> None:
    """Replace these files of the directory: all are written aside before the first is renamed.

    Text is UTF-8. Raises GvgbotError if one cannot be written; then the old files stand, and
    nothing is left beside them, whatever the failure was.
    """
    aside = {directory / name: directory / f".{name}.tmp" for name in contents}
    try:
        for path, content in zip(aside.values(), contents.values(), strict=True):
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        for path, temporary in aside.items():
            temporary.replace(path)
    except OSError as error:
        names = ", ".join(contents)
        raise GvgbotError(f"cannot write {names} to {directory}: {error.strerror}") from error
    finally:
        for temporary in aside.values():
            temporary.unlink(missing_ok=True)
