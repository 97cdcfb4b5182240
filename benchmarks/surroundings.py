"""What surrounds a robot on trial: its disk, its network, its owner's hand, its service manager."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from errno import ENOSPC
from pathlib import Path

from gvgbot.errors import GvgbotError
from gvgbot.geometry import Twist
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.requests import MESSAGEPACK, Answer, Asked
from gvgbot.service import Notifier
from gvgbot.topics import Payload


class Disk:
    """What is full now and then."""

    is_full = False

    def check(self) -> None:
        if self.is_full:
            raise OSError(ENOSPC, "No space left on device")


class FullFiles(MissionFiles):
    """A mission's files on such a disk."""

    def __init__(self, directory: Path, disk: Disk) -> None:
        super().__init__(directory)
        self._disk = disk

    def append(self, batch: bytes, *, sync: bool, after: int | None = None) -> None:
        self._disk.check()
        super().append(batch, sync=sync, after=after)

    def save(self, snapshot: bytes) -> None:
        self._disk.check()
        super().save(snapshot)


class FullDirectory(RunDirectory):
    """A run's directory on such a disk."""

    def __init__(self, path: Path, disk: Disk) -> None:
        super().__init__(path)
        self._disk = disk

    def write(self, contents: Mapping[str, bytes | str]) -> None:
        self._check()
        super().write(contents)

    def append_event(self, event: object) -> None:
        self._check()
        super().append_event(event)

    def _check(self) -> None:
        try:
            self._disk.check()
        except OSError as error:
            raise GvgbotError(f"cannot write {self.path}: {error.strerror}") from error


class Listeners:
    """A network on which now and then nobody listens, and through which the robot is asked."""

    def __init__(self) -> None:
        self.is_deaf, self.failures = False, 0
        self._handle: Callable[[Asked], Awaitable[Answer]] | None = None

    def publish(self, value: Payload, latest: Payload | None = None) -> None:
        pass

    def is_heard(self, payload: type[Payload]) -> bool:
        return not self.is_deaf

    async def answer(self) -> None:
        await asyncio.Event().wait()

    async def hear(self, handle: Callable[[Asked], Awaitable[Answer]]) -> None:
        self._handle = handle
        try:
            await asyncio.Event().wait()
        finally:  # the robot is dead, or has ended
            self._handle = None

    async def ask(self, name: str, data: bytes) -> bool:
        """Ask the robot for something, and whether it is there and does so."""
        if self._handle is None:
            return False
        answer = await self._handle(Asked(name, data, MESSAGEPACK, "a trial"))
        assert answer.text
        return answer.done


class Hand:
    """Somebody who may drive the robot."""

    def __init__(self) -> None:
        self._drive: Callable[[Twist], None] | None = None

    async def hear(self, drive: Callable[[Twist], None]) -> None:
        self._drive = drive
        try:
            await asyncio.Event().wait()
        finally:
            self._drive = None

    def drive(self, twist: Twist) -> None:
        """Let the robot drive so, if it is there."""
        if self._drive is not None:
            self._drive(twist)


class Manager(Notifier):
    """A service manager that takes down the longest time without a sign of life, s."""

    def __init__(self, now: Callable[[], float]) -> None:
        super().__init__(None)
        self._now, self._last = now, now()
        self.longest = 0.0

    def _send(self, message: str) -> None:
        if message == "WATCHDOG=1":
            self.longest = max(self.longest, self._now() - self._last)
            self._last = self._now()
