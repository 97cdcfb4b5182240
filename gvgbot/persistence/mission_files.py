"""The files that a mission lives in: a journal that grows, and a snapshot with the one before it.

What was written stays readable whatever ends the process: the journal up to its last whole record,
the snapshot or the one before. Functions that write raise OSError, and may be called again.
"""

import contextlib
import io
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from gvgbot.atomic_files import replace_file, write_all
from gvgbot.autonomy.memory import Growth, Memory
from gvgbot.persistence.mission_state import (
    VERSION,
    Batch,
    Count,
    Header,
    Rows,
    Saved,
    Snapshot,
    journey_of,
)
from gvgbot.persistence.records import Damaged, packed, record, records, unpacked

JOURNAL, SNAPSHOT, SNAPSHOT_BEFORE = "journal.gvg", "snapshot.gvg", "snapshot-before.gvg"

# When a journal was changed that lacks what happened last, and a snapshot that lacks that the robot
# stands: the year 2000, which FAT knows as well.
_BEHIND = 946_684_800.0


class MissionFiles:
    """The files of one mission in its directory."""

    def __init__(self, directory: Path) -> None:
        self._journal = directory / JOURNAL
        self._snapshot = directory / SNAPSHOT
        self._before = directory / SNAPSHOT_BEFORE
        self._ends: list[int] = []  # of the whole records of the journal: its head, the batches
        self._is_whole = True  # the newest snapshot, as far as that is known
        self._is_read = False  # the mission that is here goes on
        self._is_ours = False  # what is here was written here

    @property
    def is_begun(self) -> bool:
        """Whether there is a journal that goes on."""
        return bool(self._ends)

    @property
    def is_read(self) -> bool:
        """Whether the mission that is here goes on, even if its journal cannot."""
        return self._is_read

    # -- reading -----------------------------------------------------------------------------------

    def read(self) -> Saved | None:
        """The mission, with as much of its past as is whole; None if there is no snapshot.

        Raises Damaged if there is one that cannot be read, or is of a later version.
        """
        snapshot = self._newest_snapshot()
        if snapshot is None:
            return None
        self._is_read = True
        past: list[Growth] = []
        parts: list[Rows] = []
        counts: list[Count] = []
        newest = snapshot.beat
        for batch in self._batches():
            if batch.first != len(past):
                break
            past += batch.growth
            parts.append(batch.rows)
            rows = counts[-1].rows if counts else 0
            counts.append(Count(len(past), rows + len(batch.rows.stamps)))
            newest = max(newest, batch.beat, key=lambda beat: beat.stamp)
        is_current = self._is_current()
        if _begins_after(past, snapshot.memory):
            past, parts, counts, is_current = [], [], [], False
        journey = journey_of(parts, len(past))
        memory = _counted(snapshot.memory, past)
        if _is_dated_back(self._snapshot):
            memory = replace(memory, intent=replace(memory.intent, is_paused=True))
        return Saved(memory, past, journey, newest, counts, is_current, snapshot.known)

    def _newest_snapshot(self) -> Snapshot | None:
        trouble: Damaged | None = None
        for path in (self._snapshot, self._before):
            try:
                header, body = _two_records(path)
                _check(header, "gvgbot snapshot")
                return unpacked(body, Snapshot)
            except FileNotFoundError:
                continue
            except Damaged as error:
                trouble = trouble or Damaged(f"{path}: {error}")
                self._is_whole = self._is_whole and path != self._snapshot
        if trouble is not None:
            raise trouble
        return None

    def _batches(self) -> Iterator[Batch]:
        """The batches of the journal, up to the first that is not whole."""
        try:
            data = self._journal.read_bytes()
        except OSError:  # the snapshot goes on alone
            return
        for number, (payload, end) in enumerate(records(data)):
            try:
                if number == 0:
                    _check(payload, "gvgbot journal")
                else:
                    yield unpacked(payload, Batch)
            except Damaged:
                return
            self._ends.append(end)

    def _is_current(self) -> bool:
        return self._journal.is_file() and not _is_dated_back(self._journal)

    # -- writing -----------------------------------------------------------------------------------

    def begin(self) -> None:
        """Begin an empty journal, and forget a mission that does not go on. Raises OSError."""
        if not (self._is_read or self._is_ours):
            for path in (self._snapshot, self._before):
                path.unlink(missing_ok=True)
        start = record(packed(Header("gvgbot journal", VERSION)))
        replace_file(self._journal, start)
        self._ends, self._is_ours = [len(start)], True

    def append(self, batch: bytes, *, sync: bool, after: int | None = None) -> None:
        """Add a batch (MessagePack) to the journal; `sync` if it must outlive a power cut.

        It takes the place of all but the first `after` batches, if that is given. Raises OSError;
        then it may be tried again, and nothing before it is lost. Where somebody has removed the
        journal, it is not begun any more then, and has to be told all.
        """
        if not self.is_begun:
            self.begin()
        if after is not None:
            del self._ends[after + 1 :]
        framed, end = record(batch), self._ends[-1]
        with self._opened() as journal:
            journal.truncate(end)  # what an earlier attempt may have left
            journal.seek(end)
            try:
                write_all(journal.fileno(), framed)
                if sync:
                    os.fsync(journal.fileno())
            except OSError:
                with contextlib.suppress(OSError):
                    journal.truncate(end)  # the map may have room there
                raise
        self._ends.append(end + len(framed))

    def _opened(self) -> io.FileIO:
        """The journal. Raises OSError; whether it was removed, or its disk pulled out, is noted."""
        try:
            return self._journal.open("r+b", buffering=0)
        except FileNotFoundError:
            if self._journal.parent.is_dir():
                self._ends.clear()
            raise

    def fall_behind(self) -> None:
        """Note that the robot lives through what is not kept, until something is added again.

        The journal is dated back: there is room for that on the fullest disk.
        """
        with contextlib.suppress(OSError):
            if self._is_current():
                os.utime(self._journal, (_BEHIND, _BEHIND))

    def note_rest(self, *, rests: bool) -> None:
        """Note whether the robot stands, which the snapshot cannot tell: in the same way.

        It outlives a power cut. Who reads it finds a robot that is paused.
        """
        with contextlib.suppress(OSError):
            if _is_dated_back(self._snapshot) != rests:
                with self._snapshot.open("rb") as snapshot:
                    os.utime(snapshot.fileno(), (_BEHIND, _BEHIND) if rests else None)
                    os.fsync(snapshot.fileno())

    def forget(self) -> None:
        """Let nothing go on from what was written."""
        if self.is_begun:
            with contextlib.suppress(OSError):
                for path in (self._snapshot, self._before, self._journal):
                    path.unlink(missing_ok=True)
                self._ends.clear()

    def save(self, snapshot: bytes) -> None:
        """Replace the snapshot (MessagePack) at once; the old one stays beside it.

        One that was found damaged does not take the place of the whole one before it. Raises
        OSError; then the old ones stand.
        """
        content = record(packed(Header("gvgbot snapshot", VERSION))) + record(snapshot)
        replace_file(self._snapshot, content, keep=self._before if self._is_whole else None)
        self._is_whole = True


def _is_dated_back(path: Path) -> bool:
    try:
        return path.stat().st_mtime == _BEHIND
    except OSError:
        return False


def _begins_after(past: list[Growth], memory: Memory) -> bool:
    """Whether a journal is that of a map which was begun anew after a snapshot of the one before.

    The snapshot of the new map was damaged, or there was no room for it.
    """
    if not past or memory.last is None:
        return False
    return past[0].keyframe.stamp > memory.last.stamp


def _counted(memory: Memory, past: list[Growth]) -> Memory:
    """The memory, with its keyframes counted as in the journal.

    One that lost some and goes on has the memory's last keyframe in the place of those. On a map
    that was imported all have the same stamp.
    """
    for number, grown in reversed(list(enumerate(past, 1))):
        if memory.last is not None and grown.keyframe.stamp == memory.last.stamp:
            return replace(memory, keyframes=number)
    return memory


def _two_records(path: Path) -> tuple[bytes, bytes]:
    """Raises Damaged, FileNotFoundError."""
    try:
        found = [payload for payload, _ in records(path.read_bytes())]
    except FileNotFoundError:
        raise
    except OSError as error:
        raise Damaged(error.strerror or "cannot be read") from error
    if len(found) != 2:
        raise Damaged("it is cut short or altered")
    return found[0], found[1]


def _check(header: bytes, content: str) -> None:
    """Raises Damaged if a file is another one, or of a later version."""
    found = unpacked(header, Header)
    if found.content != content:
        raise Damaged(f"it is a {found.content}")
    if found.version > VERSION:
        raise Damaged(f"it is of version {found.version}, and this program knows {VERSION}")
