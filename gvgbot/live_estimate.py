"""The best estimate of a known map, found beside the control loop of a daemon."""

import asyncio
from collections.abc import Awaitable, Callable

from gvgbot.autonomy.estimate import Estimate, smoothed, still
from gvgbot.autonomy.pipeline import Pipeline


class LiveEstimate:
    """The best estimate, found off the loop: of a large map it takes longer than a hang may."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = self._past = pipeline
        self._wanted = asyncio.Event()
        self._found: Estimate | None = None

    def newest(self) -> Estimate | None:
        """The estimate of the moment when it was first asked for, once; None until it is there."""
        found, self._found = self._found, None
        if found is None and not self._wanted.is_set():
            self._past = still(self._pipeline)
            self._wanted.set()
        return found

    async def make(self, off_loop: Callable[[Callable[[], None]], Awaitable[None]]) -> None:
        """Make estimates that are wanted, until cancelled."""
        while True:
            await self._wanted.wait()
            await off_loop(self._find)
            self._wanted.clear()

    def _find(self) -> None:
        self._found = smoothed(self._past)
