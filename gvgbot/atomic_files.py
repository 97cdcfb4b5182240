"""Files that are either the old one or the new one, never half of each, even after a power cut."""

import contextlib
import errno
import os
from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from gvgbot.errors import GvgbotError


def write_files(directory: Path, contents: Mapping[str, bytes | str]) -> None:
    """Replace these files of the directory: all are on the disk before the first is renamed.

    Text is UTF-8. Raises GvgbotError if one cannot be written; then the old files stand, and
    nothing is left beside them, whatever the failure was.
    """
    aside = {directory / name: _aside(directory / name) for name in contents}
    try:
        for path, content in zip(aside.values(), contents.values(), strict=True):
            path.write_bytes(_encoded(content) if isinstance(content, str) else content)
        _sync_together(aside.values())
        for path, temporary in aside.items():
            temporary.replace(path)
        sync_directory(directory)
    except OSError as error:
        names = ", ".join(contents)
        remedy = "; make room" if is_disk_full(error) else ""
        raise GvgbotError(
            f"cannot write {names} to {directory}: {error.strerror}{remedy}"
        ) from error
    finally:
        for temporary in aside.values():
            _remove(temporary)


def replace_file(path: Path, content: bytes, keep: Path | None = None) -> None:
    """Put content in the place of a file, and the file in the place of `keep`. Raises OSError."""
    aside = _aside(path)
    try:
        aside.write_bytes(content)
        _sync(aside)
        if keep is not None and path.exists():
            path.replace(keep)
        aside.replace(path)
        sync_directory(path.parent)
    finally:
        _remove(aside)


def write_all(file: int, content: bytes) -> None:
    """Write all of it to a descriptor. Raises OSError; then a part may have been written."""
    left = memoryview(content)
    while left:
        left = left[os.write(file, left) :]


def is_disk_full(error: BaseException | None) -> bool:
    """Whether that is what was wrong: there is no room, or none for this user."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def sync_directory(path: Path) -> None:
    """Wait until its names are on the disk, where the filesystem has a way to do that."""
    with contextlib.suppress(OSError):
        directory = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)


def _encoded(text: str) -> bytes:
    """In UTF-8; a byte of a file's name that is none is spelt as JSON does it."""
    return text.encode(errors="backslashreplace")


def _aside(path: Path) -> Path:
    """Where a file is written before it takes its place."""
    return path.with_name(f".{path.name}.tmp")


def _sync_together(paths: Collection[Path]) -> None:
    """Wait until files are on the disk, which takes a slow one little longer than one of them."""
    try:
        with ThreadPoolExecutor(len(paths) or 1) as threads:
            list(threads.map(_sync, paths))
    except RuntimeError:  # no thread can be started
        for path in paths:
            _sync(path)


def _sync(path: Path) -> None:
    """Wait until a file is on the disk. Raises OSError."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):  # a disk that is read-only tells so again
        path.unlink(missing_ok=True)
