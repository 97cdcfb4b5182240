"""Tell the base to stand still, from outside the daemon: `python -m gvgbot.stop_base CONFIG`.

For the moment after the daemon has ended, whichever way it did.
"""

import asyncio
import sys
from pathlib import Path

from gvgbot.cli import status_of
from gvgbot.clock import LoopClock
from gvgbot.config import Config, load_config
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.transport import SerialStream
from gvgbot.geometry import STANDSTILL


def main(arguments: list[str]) -> int:
    """Stop the base of a configuration file; the exit status."""
    return status_of(lambda: _stop(load_config(Path(arguments[0]) if arguments else None)))


def _stop(config: Config) -> int:
    if not config.twin.enabled:
        asyncio.run(_write_stop(config))
    return 0


async def _write_stop(config: Config) -> None:
    """Raises DeviceLost if the port cannot be opened."""
    stream = SerialStream(config.base.port, config.base.baud)
    try:
        KobukiBase(stream, config.base, LoopClock()).drive(STANDSTILL)
    finally:
        stream.close()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
