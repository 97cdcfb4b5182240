"""What takes long to find out about a pipeline, found beside the control loop of a daemon."""

import asyncio
from collections.abc import Callable
from typing import Generic, TypeVar

from gvgbot.autonomy.estimate import still
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import OffLoop

_DRIVEN_ON_M = 0.1  # since the work was begun

Result = TypeVar("Result")


class BesideLoop(Generic[Result]):
    """A function of a pipeline, off the loop: it takes longer than a robot may be deaf."""

    def __init__(self, pipeline: Pipeline, function: Callable[[Pipeline], Result]) -> None:
        self._pipeline = self._copy = pipeline
        self._function = function
        self._wanted = asyncio.Event()
        self._found: Result | None = None

    def newest(self) -> Result | None:
        """What is true of the moment when this was asked first, once; None while it is looked for.

        What was found for a robot that has driven on since is of no use.
        """
        if self._wanted.is_set():
            return None
        found, self._found = self._found, None
        if (
            found is not None
            and self._pipeline.past.travelled < self._copy.past.travelled + _DRIVEN_ON_M
        ):
            return found
        self._copy = still(self._pipeline)
        self._wanted.set()
        return None

    async def work(self, off_loop: OffLoop) -> None:
        """Find what is wanted, until cancelled."""
        while True:
            await self._wanted.wait()
            await off_loop(self._find)
            self._wanted.clear()

    def _find(self) -> None:
        self._found = self._function(self._copy)
