"""A byte stream that lets somebody listen to both directions."""

from collections.abc import Callable
from typing import Protocol

from gvgbot.drivers.transport import ByteStream


class Tap(Protocol):
    """Listens to a link, of the laser or the base."""

    def __call__(self, link: str, data: bytes, *, said: bool) -> None:
        """What was heard from a device, or said to it."""


class TappedStream:
    """Passes everything on, and tells of it; other abilities of the stream stay its own."""

    def __init__(
        self,
        inner: ByteStream,
        heard: Callable[[bytes], None],
        said: Callable[[bytes], None],
    ) -> None:
        """`heard` gets what comes from the device, `said` what goes to it."""
        self._inner, self._heard, self._said = inner, heard, said
        set_baud = getattr(inner, "set_baud", None)
        if set_baud is not None:
            self.set_baud = set_baud

    async def read(self) -> bytes:
        """Whatever has arrived. Raises DeviceLost when the other end is gone."""
        data = await self._inner.read()
        self._heard(data)
        return data

    def write(self, data: bytes) -> None:
        """Send without waiting. Raises DeviceLost when the other end is gone, or takes no more."""
        self._inner.write(data)
        self._said(data)

    def close(self) -> None:
        """Give the link up."""
        self._inner.close()
