"""Keeps a session's events and map on the disk while the robot goes on, and saves when asked to."""

import asyncio
import contextlib

import structlog

from gvgbot.autonomy.events import Event, Finished, VertexAdded
from gvgbot.clock import OffLoop
from gvgbot.errors import GvgbotError
from gvgbot.session import Session

SAVE_EVERY = 30.0  # s at least between two savings while the map grows

log = structlog.get_logger()


class Saving:
    """Writes what happens, and the map as it grows; `off_loop` runs what takes long.

    Who asks for a saving while others wait shares the next one.
    """

    def __init__(self, session: Session, off_loop: OffLoop) -> None:
        self._session, self._off_loop = session, off_loop
        self._one_at_a_time = asyncio.Lock()
        self._asked = self._done = 0  # of those asked for, done are the first so many
        self._grown, self._finished = asyncio.Event(), asyncio.Event()
        self._happened = asyncio.Event()  # something that is to be written
        self._trouble = ""  # why the map is not on the disk as it should be

    async def save(self) -> str:
        """Save, and return where. Raises GvgbotError if that cannot be.

        A saving that begins later than somebody asked is what was asked for.
        """
        self._asked += 1
        mine = self._asked
        async with self._one_at_a_time:
            if self._done < mine:
                done = self._asked
                await self._off_loop(self._session.saving(unfinished="still exploring"))
                self._done = done
        return str(self._session.directory.path)

    def on_events(self, happened: list[Event]) -> None:
        """Have what happened written, and the map saved if that may have changed it."""
        self._session.note_events(happened)
        self._happened.set()
        if any(isinstance(event, VertexAdded) for event in happened):
            self._grown.set()
        if any(isinstance(event, Finished) for event in happened):
            self.finish()

    def finish(self) -> None:
        """Have the map saved soon, however lately that was done: it is not going to grow."""
        self._grown.set()
        self._finished.set()

    async def keep_written(self) -> None:
        """Write what happens, until cancelled: a slow disk must not hold up the loop."""
        while True:
            await self._happened.wait()
            self._happened.clear()
            await self._off_loop(self._session.write_events)

    async def keep_saved(self) -> None:
        """Save now and then while the map grows, and when it is finished, until it is saved."""
        pipeline = self._session.pipeline
        if pipeline.mission.outcome is not None:  # before a restart
            self._grown.set()
        while True:
            await self._grown.wait()
            self._grown.clear()
            await self._try()
            if self._trouble:
                self._grown.set()
            elif pipeline.mission.outcome is not None and pipeline.errands.is_resting:
                log.info("standing still until stopped", map=str(self._session.directory.path))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(SAVE_EVERY):
                    await self._finished.wait()
            self._finished.clear()

    async def _try(self) -> None:
        """Save the map, and the events that could not be written before; say once if it fails."""
        before, self._trouble = self._trouble, ""
        self._happened.set()
        try:
            await self.save()
        except GvgbotError as error:
            self._trouble = str(error)
            if self._trouble != before:
                log.warning("map not saved", reason=self._trouble)
