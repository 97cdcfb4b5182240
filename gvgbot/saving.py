"""Saves a session's map when somebody asks for that, one time after the other."""

import asyncio

from gvgbot.clock import OffLoop
from gvgbot.session import Session


class Saving:
    """Who asks while others wait shares the next saving; `off_loop` runs what takes long."""

    def __init__(self, session: Session, off_loop: OffLoop) -> None:
        self._session, self._off_loop = session, off_loop
        self._one_at_a_time = asyncio.Lock()
        self._asked = self._done = 0  # of those asked for, done are the first so many

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
