"""`gvgbot twin`: both simulated devices in one world, on ports of their own, in real time."""

import asyncio
import contextlib
import shlex
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

from gvgbot.clock import LoopClock
from gvgbot.config import Config
from gvgbot.drivers.device_port import DevicePort
from gvgbot.drivers.pty import PtyPort
from gvgbot.drivers.tcp import SCHEME
from gvgbot.drivers.tcp_port import TcpPort
from gvgbot.drivers.transport import serve_twin
from gvgbot.errors import UsageError
from gvgbot.simulation import Place, Simulation, open_place
from gvgbot.stop_signals import StopSignals


def serve(
    config: Config,
    links: tuple[str | None, str | None],
    same_robot: Sequence[str],
    announce: Callable[[str], None],
) -> int:
    """Serve the twins until a signal comes, and tell where they are; the exit status.

    `same_robot` is the configuration once more, as words of a command that finds them there.
    Raises UsageError for a world that cannot be used or a link that cannot be made.
    """
    files = [Path(link).absolute() for link in links if link and not link.startswith(SCHEME)]
    if len(set(files)) < len(files):
        raise UsageError(f"{links[0]} cannot be both the laser and the base: name two links")
    place = open_place(config)
    with StopSignals() as signals, asyncio.Runner() as runner:
        runner.run(_serve(config, place, links, same_robot, announce, signals.wait))
    return 0


async def _serve(
    config: Config,
    place: Place,
    links: tuple[str | None, str | None],
    same_robot: Sequence[str],
    announce: Callable[[str], None],
    stopped: Callable[[], Awaitable[object]],
) -> None:
    simulation = Simulation(config, place, LoopClock())
    with contextlib.ExitStack() as stack:
        laser, base = (stack.enter_context(contextlib.closing(_port(link))) for link in links)
        announce(_greeting(place, laser, base, same_robot))
        await serve_on(simulation, laser, base, stopped())


async def serve_on(
    simulation: Simulation, laser: DevicePort, base: DevicePort, stopped: Awaitable[object]
) -> None:
    """Serve the twins of a simulation on these ports until `stopped` returns."""
    clock = LoopClock()
    simulation.plug_base = base.plug
    simulation.plug_laser = laser.plug
    async with asyncio.TaskGroup() as tasks:
        serving = [
            tasks.create_task(serve_twin(simulation.laser_twin, laser, clock), name="laser twin"),
            tasks.create_task(serve_twin(simulation.base_twin, base, clock), name="base twin"),
        ]
        await stopped
        for task in serving:
            task.cancel()


def _port(link: str | None) -> DevicePort:
    """What clients will open there. Raises UsageError."""
    if link is not None and link.startswith(SCHEME):
        return TcpPort(link)
    return PtyPort(None if link is None else Path(link))


def _greeting(place: Place, laser: DevicePort, base: DevicePort, same_robot: Sequence[str]) -> str:
    start = place.start
    found = ("twin.enabled=false", f"laser.port={laser.path}", f"base.port={base.path}")
    words = [*same_robot, *(word for setting in found for word in ("--set", setting))]
    return (
        f"world: {place.world.name}, start {start.x:g} {start.y:g} {start.theta:g}\n"
        f"laser: {laser.path}\n"
        f"base:  {base.path}\n"
        f"try: gvgbot check {shlex.join(words)}"
    )
