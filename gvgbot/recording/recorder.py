"""Takes down a run as it happens, and leaves the writing to a thread of its own.

The robot comes first: when the disk is too slow some messages are left out, when it is nearly full
the recording ends, and the log says so.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import msgspec
import structlog

from gvgbot.autonomy.loop import Cycle
from gvgbot.errors import UsageError
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Battery, Scan
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.files import Entry, McapFiles, check_room, free_path
from gvgbot.recording.messages import (
    BATTERY,
    CYCLE,
    EVENT,
    RAW,
    SCAN,
    TRANSFORM,
    Channel,
    encode_battery,
    encode_cycle,
    encode_scan,
    encode_transform,
    nanoseconds,
)

_BATTERY_EVERY = 60.0  # s, if it stays as it is
BATCH = 25  # messages that are handed over together
MOST_WAITING = 8_000_000  # bytes in memory; more are not kept for a disk that is slow

log = structlog.get_logger()


class Recorder:
    """One recording; a context manager that finishes it.

    With `patient`, whoever records waits for the disk; a robot must not.
    """

    def __init__(
        self,
        config: RecordingConfig,
        about: dict[str, str],
        *,
        patient: bool = False,
        files: Callable[..., McapFiles] = McapFiles,
    ) -> None:
        """Raises UsageError if there is no path, or nothing can be written there."""
        self.map_base: Callable[[], Pose] = Pose  # where the robot is believed to be
        self._patient = patient
        self._files = _opened(config, about, files)
        self.first = self._files.path  # another than configured if there was one already
        self._thread = ThreadPoolExecutor(1, "recording")
        self._batch: list[Entry] = []
        self._bytes = 0  # of the batch
        self._handed, self._written = 0, 0  # bytes, of all batches
        self._left_out = 0  # messages
        self._failed = False
        self._battery: Battery | None = None
        self._now = 0  # ns; the newest stamp there was

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._files.path

    @property
    def is_behind(self) -> bool:
        """Whether more waits to be written than should."""
        return self._handed - self._written > MOST_WAITING

    # -- what there is to record ---------------------------------------------------------------

    def on_scan(self, scan: Scan) -> None:
        """Take down a scan before it is looked at."""
        self._add(SCAN, scan.stamp, encode_scan(scan))

    def on_cycle(self, cycle: Cycle, battery: Battery | None) -> None:
        """Take down a control cycle, and the battery when there is news of it."""
        stamp = cycle.odometry.stamp
        self._add(CYCLE, stamp, encode_cycle(cycle))
        self._add(TRANSFORM, stamp, encode_transform(stamp, self.map_base()))
        if battery is not None and self._is_news(battery):
            self._battery = battery
            self._add(BATTERY, battery.stamp, encode_battery(battery))

    def _is_news(self, battery: Battery) -> bool:
        """Whether it has changed, or was last taken down long ago, perhaps in an older file."""
        last = self._battery
        if last is None or not 0.0 <= battery.stamp - last.stamp < _BATTERY_EVERY:
            return True
        return battery != replace(last, stamp=battery.stamp)

    def on_event(self, record: dict[str, Any]) -> None:
        """Take down an event, as its line in events.jsonl has it."""
        self._add(EVENT, record["stamp"], msgspec.json.encode(record))

    def on_bytes(self, link: str, data: bytes, *, said: bool) -> None:
        """Take down what was heard from a device, or said to it."""
        self._add(RAW[link][said], self._now / 1e9, data)

    # -- to the disk -----------------------------------------------------------------------------

    def _add(self, channel: Channel, stamp: float, data: bytes) -> None:
        at = nanoseconds(stamp)
        self._now = max(self._now, at)
        self._batch.append(Entry(channel, self._now, at, data))
        self._bytes += len(data)
        if len(self._batch) >= BATCH:
            self._hand_over()

    def _hand_over(self) -> None:
        """Give the batch to the thread, if that is not too far behind."""
        batch, size = self._batch, self._bytes
        self._batch, self._bytes = [], 0
        if self._failed:
            return
        if not self._patient and self.is_behind:
            if not self._left_out:
                log.warning("recording cannot keep up: messages are left out", path=str(self.path))
            self._left_out += len(batch)
            return
        if self._left_out:
            log.info("recording goes on", left_out=self._left_out)
            gap = {"event": "left_out", "stamp": self._now / 1e9, "messages": self._left_out}
            batch.insert(0, Entry(EVENT, self._now, self._now, msgspec.json.encode(gap)))
            self._left_out = 0
        self._handed += size
        writing = self._thread.submit(self._write, batch, size)
        if self._patient and self.is_behind:
            writing.result()

    def _write(self, batch: list[Entry], size: int) -> None:
        """In the thread."""
        if not self._failed:
            self._attempt(lambda: self._files.write(batch))
        self._written += size

    def _attempt(self, work: Callable[[], None]) -> None:
        try:
            work()
        except OSError as error:
            self._failed = True
            self._files.abandon()
            log.warning("recording ended", path=str(self.path), reason=error.strerror)

    def close(self) -> None:
        """Write what is left, and the index; waits for the disk."""
        self._hand_over()
        last: Future[None] = self._thread.submit(self._finish)
        self._thread.shutdown()
        last.result()

    def _finish(self) -> None:
        if not self._failed:
            self._attempt(self._files.finish)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _opened(
    config: RecordingConfig, about: dict[str, str], files: Callable[..., McapFiles]
) -> McapFiles:
    assert config.path is not None
    if config.path.is_dir():
        raise UsageError(f"recording.path: {config.path} is a directory; name a file in it")
    try:
        check_room(config.path.parent)
        return files(
            free_path(config.path),
            about,
            file_bytes=1e6 * config.file_mb,
            total_bytes=1e6 * config.total_mb,
        )
    except OSError as error:
        raise UsageError(f"recording.path: cannot write {config.path}: {error.strerror}") from error
