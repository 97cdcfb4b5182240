"""MCAP files that follow each other: run.mcap, run.1.mcap, ... each whole in itself.

Chunks are small and go out at once, so that whatever ends the program costs the last second only,
and a power failure a megabyte.
"""

import errno
import glob
import os
import shutil
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgspec
from mcap.writer import CompressionType, Writer

from gvgbot.recording.messages import CHANNELS, Channel
from gvgbot.recording.schemas import DESCRIPTORS

CHUNK_BYTES = 65_536
METADATA = "gvgbot"  # the name of the record that says what a file belongs to
GOES_ON = "gvgbot.goes_on"  # the name of the one that says that another file follows
SYNC_EVERY_BYTES = 1_000_000  # that a power failure may cost
SPARE_BYTES = 50_000_000  # of its disk: the mission takes some 30 MB an hour, and its map a few
_EVENT_SCHEMA = {
    "type": "object",
    "properties": {"event": {"type": "string"}, "stamp": {"type": "number"}},
}


class Entry(NamedTuple):
    """One message: when it was taken down and when it was true, in ns, and its bytes."""

    channel: Channel
    logged: int
    stamp: int
    data: bytes


def part_path(first: Path, number: int) -> Path:
    """The file that follows after so many others."""
    return first if number == 0 else first.with_suffix(f".{number}{first.suffix}")


def free_path(wanted: Path) -> Path:
    """The path, or the next like it (run-2.mcap) at which there is nothing of a recording yet."""
    path, number = wanted, 1
    while path.exists() or any(path.parent.glob(f"{glob.escape(path.stem)}.*{path.suffix}")):
        number += 1
        path = wanted.with_stem(f"{wanted.stem}-{number}")
    return path


def check_room(folder: Path) -> None:
    """Raises OSError unless there is more room on the disk of a folder than the mission needs."""
    if not _has_room(folder):
        raise OSError(errno.ENOSPC, f"less than {SPARE_BYTES / 1e6:.0f} MB are left")


def _has_room(folder: Path) -> bool:
    return shutil.disk_usage(folder).free >= SPARE_BYTES


class McapFiles:
    """Files of limited size, of which the oldest go when there are too many bytes in all.

    So they do when the disk is nearly full; then the last one ends, too.
    """

    def __init__(
        self, first: Path, about: Mapping[str, str], *, file_bytes: float, total_bytes: float
    ) -> None:
        """`about` goes into each file. Raises OSError if the first cannot be made."""
        self._first, self._about = first, dict(about)
        self._file_bytes, self._total_bytes = file_bytes, total_bytes
        self._part = 0
        self._done: deque[tuple[Path, int]] = deque()  # files that are finished, and their bytes
        self._open()

    def _open(self) -> None:
        self.path = part_path(self._first, self._part)
        file = self.path.open("xb")
        try:
            self._start(file)
        except OSError:
            self.abandon()
            self.path.unlink()  # it holds nothing
            raise

    def _start(self, file: BinaryIO) -> None:
        self._file, self._synced = file, 0
        self._writer = Writer(self._file, CHUNK_BYTES, CompressionType.ZSTD)
        self._writer.start(library="gvgbot")
        self._writer.add_metadata(METADATA, self._about | {"part": str(self._part)})
        schemas = {"": 0}
        for channel in CHANNELS:
            if channel.schema not in schemas:
                schemas[channel.schema] = _register_schema(self._writer, channel)
        self._channels = {
            channel: self._writer.register_channel(
                channel.topic, channel.encoding, schemas[channel.schema]
            )
            for channel in CHANNELS
        }
        self._file.flush()

    def write(self, entries: Sequence[Entry]) -> None:
        """Add messages. Raises OSError; the files are of no more use then."""
        for entry in entries:
            number = self._channels[entry.channel]
            self._writer.add_message(number, entry.logged, entry.data, entry.stamp)
        self._file.flush()
        size = self._file.tell()
        if size - self._synced > SYNC_EVERY_BYTES:
            os.fsync(self._file.fileno())
            self._synced = size
            self._spare_disk()
        if size > self._file_bytes:
            self._writer.add_metadata(GOES_ON, {})
            self.finish()
            self._make_room()
            self._part += 1
            self._open()
            self._spare_disk()

    def finish(self) -> None:
        """End the file with its index. Raises OSError."""
        with self._file:
            self._writer.finish()
        self._done.append((self.path, self.path.stat().st_size))

    def _make_room(self) -> None:
        """For one more file. The newest stays, though it is a little larger than it should be."""
        sizes = [size for _, size in self._done]
        while len(sizes) > 1 and sum(sizes) + self._file_bytes > self._total_bytes:
            self._done.popleft()[0].unlink(missing_ok=True)
            sizes.pop(0)

    def _spare_disk(self) -> None:
        """Leave room for the mission. Raises OSError if that is the end of this file."""
        while self._done and not _has_room(self.path.parent):
            self._done.popleft()[0].unlink(missing_ok=True)
        try:
            check_room(self.path.parent)
        except OSError:
            self.finish()
            raise

    def abandon(self) -> None:
        """Let go of the file as it is."""
        try:
            self._file.close()
        except OSError:
            return  # what could not be written still cannot be


def _register_schema(writer: Writer, channel: Channel) -> int:
    if channel.encoding == "json":
        data = msgspec.json.encode(_EVENT_SCHEMA)
        return int(writer.register_schema(channel.schema, "jsonschema", data))
    return int(writer.register_schema(channel.schema, channel.encoding, DESCRIPTORS))
