"""Tell the base to stand still, from outside the daemon: `python -m gvgbot.stop_base CONFIG`.

For the moment after the daemon has ended, whichever way it did. The robot may be rolling, so this
loads nothing that it can do without: a small computer needs seconds for the whole program.
"""

import asyncio
import contextlib
import sys
from pathlib import Path

import yaml

from gvgbot.drivers.kobuki.driver import STANDSTILL_FRAME, KobukiConfig
from gvgbot.drivers.tcp import SCHEME, TcpStream
from gvgbot.drivers.transport import SerialStream
from gvgbot.errors import ConfigError, GvgbotError
from gvgbot.strict_yaml import load_text, packaged

_PATIENCE_S = 1.0  # until a base on the network has said something


def main(arguments: list[str]) -> int:
    """Stop the base of a configuration file, if it is a real one; the exit status."""
    try:
        config = _real_base(packaged(arguments[0])) if arguments else None
        if config is not None:
            asyncio.run(_write_stop(config))
    except GvgbotError as error:
        sys.stderr.write(f"gvgbot: {error}\n")
        return 1
    return 0


def _real_base(path: Path) -> KobukiConfig | None:
    """The section of the base; None if it is a twin. Raises ConfigError."""
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        base, twin = content.get("base") or {}, content.get("twin") or {}
        is_twin = twin.get("enabled", True)
    except (OSError, ValueError, AttributeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path}: not a configuration: {error}") from error
    return None if is_twin else load_text(KobukiConfig, yaml.safe_dump(base), str(path))


async def _write_stop(config: KobukiConfig) -> None:
    """Raises DeviceLost if the port cannot be opened, or takes no more bytes."""
    if config.port.startswith(SCHEME):
        await _write_to_network(config)
        return
    stream = SerialStream(config.port, config.baud)
    try:
        stream.write(STANDSTILL_FRAME)
    finally:
        stream.close()


async def _write_to_network(config: KobukiConfig) -> None:
    """The same over TCP: the connection is made by the first read, and what was written, sent."""
    stream = TcpStream(config.port)
    try:
        stream.write(STANDSTILL_FRAME)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                await stream.read()
    finally:
        stream.close()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
