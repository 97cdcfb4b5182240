"""What the map may lack, found beside the control loop of a daemon."""

import asyncio
from collections.abc import Awaitable, Callable

from gvgbot.autonomy.estimate import still
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.geometry import Array
from gvgbot.survey import survey

_DRIVEN_ON_M = 0.1  # since a survey was begun


class LiveSurvey:
    """What the map may lack, found off the loop: that takes longer than a robot may be deaf."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = self._past = pipeline
        self._wanted = asyncio.Event()
        self._found: Array | None = None
        self._travelled = 0.0  # by the pipeline, when the survey began

    def places(self) -> Array | None:
        """The places (N, 2), m, map frame; None while they are looked for.

        What was found for a robot that has driven on since is of no use.
        """
        if self._wanted.is_set():
            return None
        found, self._found = self._found, None
        if found is not None and self._pipeline.travelled < self._travelled + _DRIVEN_ON_M:
            return found
        self._travelled, self._past = self._pipeline.travelled, still(self._pipeline)
        self._wanted.set()
        return None

    async def make(self, off_loop: Callable[[Callable[[], None]], Awaitable[None]]) -> None:
        """Make surveys that are wanted, until cancelled."""
        while True:
            await self._wanted.wait()
            await off_loop(self._look)
            self._wanted.clear()

    def _look(self) -> None:
        self._found = survey(self._past)
