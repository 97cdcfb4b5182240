"""What a recording holds, in the order in which it happened, as far as the files go."""

import os
import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import zstandard
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from gvgbot.errors import UsageError
from gvgbot.recording import Lived
from gvgbot.recording.files import GOES_ON, METADATA, part_path
from gvgbot.recording.messages import (
    BATTERY,
    CYCLE,
    EVENT,
    SCAN,
    decode_battery,
    decode_cycle,
    decode_scan,
)

_HEAD = struct.Struct("<BQ")  # of a record: what it is, and the bytes that follow
_KINDS = frozenset(Opcode)
_OF_MESSAGES = frozenset({Opcode.CHUNK, Opcode.CHANNEL, Opcode.MESSAGE})
_DAMAGE = (
    McapError,
    CRCValidationError,
    DecodeError,
    zstandard.ZstdError,
    struct.error,
    KeyError,  # of a channel, or of what a file says of itself
    OverflowError,  # of a size
    ValueError,
    msgspec.MsgspecError,
)


@dataclass(frozen=True, slots=True)
class About:
    """What a recording says of itself."""

    title: str  # of the world, or of the robot
    config: str  # YAML
    part: int  # files of the same recording that came before
    resumed: bool  # whether the run went on with a map that was there before


class Recording:
    """A file and those that follow it, read once from the first message to the last."""

    def __init__(self, path: Path) -> None:
        """Raises UsageError if the file cannot be read, or is no recording."""
        self._path = path
        self.about = _about(path)
        self.cut: list[Path] = []  # files that end in the middle
        self.joined: list[Path] = []  # files with more after their end, which is not read
        self.missing: Path | None = None  # a file that follows, without which none is read
        self.damaged = 0  # chunks of messages, of a second or so, that were passed over
        self.left_out = 0  # messages that the disk was too slow for
        self.requests = 0  # that were granted
        self.topics = set[str]()  # of the messages so far
        self._goes_on = False  # as the last file says

    def messages(self) -> Iterator[tuple[float, Lived]]:
        """What the robot was given, each with the time (s) when it was taken down.

        Raises UsageError if a file that follows cannot be read.
        """
        path, number = self._path, self.about.part
        first = _first(path, number)
        while path == self._path or path.exists():
            try:
                with path.open("rb") as file:
                    yield from self._messages(file, path)
            except OSError as error:
                raise UsageError(f"cannot read {path}: {error.strerror}") from error
            number += 1
            path = part_path(first, number)
        self.missing = path if self._goes_on or _goes_on(first, number) else None

    def _messages(self, file: BinaryIO, path: Path) -> Iterator[tuple[float, Lived]]:
        topics = _topics(file)
        opcode, self._goes_on = None, False
        for opcode, content in _records(file):
            self._goes_on |= opcode == Opcode.METADATA and GOES_ON.encode() in content
            if opcode in _OF_MESSAGES:
                try:
                    messages = list(self._lived(_parts(opcode, content), topics))
                except _DAMAGE:
                    self.damaged += 1
                else:
                    yield from messages
            elif opcode not in _KINDS:
                self.damaged += 1
        if opcode != Opcode.FOOTER:
            self.cut.append(path)
        elif file.read(1):
            self.joined.append(path)

    def _lived(
        self, records: Iterable[McapRecord], topics: dict[int, str]
    ) -> Iterator[tuple[float, Lived]]:
        """The messages among records."""
        for record in records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                topic, at = topics[record.channel_id], record.log_time / 1e9
                self.topics.add(topic)
                if topic == SCAN.topic:
                    yield at, decode_scan(record.data)
                elif topic == CYCLE.topic:
                    yield at, decode_cycle(record.data)
                elif topic == BATTERY.topic:
                    yield at, decode_battery(record.data)
                elif topic == EVENT.topic:
                    self._count(msgspec.json.decode(record.data))

    def _count(self, event: dict[str, Any]) -> None:
        match event:
            case {"event": "left_out", "messages": int(messages)}:
                self.left_out += messages
            case {"event": "requested", "done": True}:
                self.requests += 1


def _parts(opcode: int, content: bytes) -> Iterable[McapRecord]:
    """The records of a chunk, all or none, or one that is in no chunk."""
    data = ReadDataStream(BytesIO(content))
    if opcode == Opcode.CHUNK:
        return breakup_chunk(Chunk.read(data), validate_crc=True)
    return [Channel.read(data) if opcode == Opcode.CHANNEL else Message.read(data, len(content))]


def _topics(file: BinaryIO) -> dict[int, str]:
    """Of each channel, as the index at the end repeats them; none where that is missing or wrong.

    Else they are told in the first chunk only.
    """
    try:
        index = make_reader(file).get_summary()
    except (*_DAMAGE, MemoryError):
        index = None
    file.seek(0)
    channels = () if index is None else index.channels.values()
    return {channel.id: channel.topic for channel in channels}


def _about(path: Path) -> About:
    try:
        with path.open("rb") as file:
            for opcode, content in _records(file):
                if opcode != Opcode.METADATA:
                    continue
                found = Metadata.read(ReadDataStream(BytesIO(content)))
                if found.name == METADATA:
                    m = found.metadata
                    return About(m["title"], m["config"], int(m["part"]), m.get("resumed") == "yes")
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except _DAMAGE:
        pass
    raise UsageError(f"{path} holds nothing of a gvgbot recording: it is cut short, or another's")


def _records(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """The records of a file that are whole."""
    if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        return
    size = os.fstat(file.fileno()).st_size
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        if length > size - file.tell():
            return
        yield opcode, file.read(length)


def _first(path: Path, number: int) -> Path:
    """The first file of a recording, of which the path is that of a number."""
    ending = f".{number}{path.suffix}" if number else path.suffix
    if path.suffix == f".{number}" and not path.name.endswith(ending):
        return path.with_suffix("")  # its files are run, run.1, run.2
    return path.with_name(path.name.removesuffix(ending) + path.suffix)


def _goes_on(first: Path, number: int) -> bool:
    """Whether there are files of a recording after that of a number."""
    name = re.compile(rf"{re.escape(first.stem)}\.(\d+){re.escape(first.suffix)}")
    found = (name.fullmatch(path.name) for path in first.parent.iterdir())
    return any(int(one[1]) > number for one in found if one is not None)
