"""A one-value mailbox: the newest value wins, and nobody ever waits behind an old one."""

import asyncio
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """Hands the newest value from one task to another."""

    def __init__(self) -> None:
        self._value: T | None = None
        self._fresh = asyncio.Event()

    def put(self, value: T) -> None:
        """Replace whatever was there."""
        self._value = value
        self._fresh.set()

    async def next(self) -> T:
        """The newest value not taken before; waits for one."""
        await self._fresh.wait()
        self._fresh.clear()
        assert self._value is not None
        return self._value
