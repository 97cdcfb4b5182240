"""`gvgbot monitor`, `web` and `ctl`: a robot seen and asked from elsewhere."""

import argparse
import signal
from collections.abc import Iterator
from contextlib import contextmanager

from gvgbot.cli.arguments import Commands, add_connection, host, say, tcp_port
from gvgbot.errors import extra_for


def add_monitor(commands: Commands) -> None:
    """Add `gvgbot monitor`."""
    monitor = commands.add_parser(
        "monitor",
        help="watch a robot in the terminal",
        description="Show the map, the state and the events of a robot as they come over the "
        "network, until q or Ctrl-C. Nothing that the monitor does can move the robot.",
        epilog="example: gvgbot monitor turtlebot2 --connect tcp/192.168.1.7:7447",
    )
    monitor.add_argument(
        "robot", nargs="?", metavar="ROBOT", help="its robot.name (default: the only one there is)"
    )
    add_connection(monitor)
    monitor.set_defaults(command=_monitor)


def _monitor(options: argparse.Namespace) -> int:
    with extra_for("the monitor needs rich", "tui", "rich"):
        from gvgbot.monitor.app import monitor

    return monitor(options.robot, options.connect, options.zenoh_file)


def add_web(commands: Commands) -> None:
    """Add `gvgbot web`."""
    web = commands.add_parser(
        "web",
        help="watch a robot in the browser",
        description="Serve a page with the live map, the state and the events of a robot, to this "
        "machine only unless --host says otherwise, until Ctrl-C. Whoever has the page open can "
        "ask the robot for what its telemetry.requests permits.",
        epilog="example: gvgbot web turtlebot2 --connect tcp/192.168.1.7:7447",
    )
    web.add_argument(
        "robot", nargs="?", metavar="ROBOT", help="its robot.name (default: the only one there is)"
    )
    web.add_argument(
        "--host",
        type=host,
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where to serve the page; 0.0.0.0 lets everybody in (default: %(default)s)",
    )
    web.add_argument(
        "--port",
        type=tcp_port,
        default=8080,
        metavar="N",
        help="default: %(default)s; 0 takes any that is free",
    )
    add_connection(web)
    web.set_defaults(command=_web)


def _web(options: argparse.Namespace) -> int:
    with extra_for("the page needs websockets", "web", "websockets"):
        from gvgbot.web.app import web

    connection = (options.robot, options.connect, options.zenoh_file)
    return web(*connection, host=options.host, port=options.port, say=say)


def add_ctl(commands: Commands) -> None:
    """Add `gvgbot ctl`."""
    ctl = commands.add_parser(
        "ctl",
        help="ask a robot for something",
        usage="%(prog)s [-h] [--connect ADDRESS] [--zenoh-file FILE]\n"
        "                  [ROBOT] REQUEST [WORD ...]",
        description="Ask a robot to pause, resume, stop (which ends the exploration), drive home, "
        "goto V (a vertex) or goto X Y (metres, map frame), patrol (vertices V V ..., or all, over "
        "and over), coverage (drive all edges), explore, relocalise, save (the map), or set KEY "
        "VALUE. Prints what it does now and exits 0, or says why it does not, and exits 1. A robot "
        "does what telemetry.requests permits.",
        epilog="example: gvgbot ctl turtlebot2 goto 7 --connect tcp/192.168.1.7:7447",
    )
    ctl.add_argument(
        "words",
        nargs="+",
        metavar="REQUEST",
        help="what to do, after the robot's robot.name if there are several, and before each WORD "
        "that the request takes: a vertex, metres, or a key and its value",
    )
    add_connection(ctl)
    ctl.set_defaults(command=_ctl)


def _ctl(options: argparse.Namespace) -> int:
    from gvgbot.ctl import ctl

    with _any_stop_at_once():
        return ctl(options.words, options.connect, options.zenoh_file, say)


@contextmanager
def _any_stop_at_once() -> Iterator[None]:
    """Let signals end the program: nothing is to be tidied up, and zenoh connects deaf to them."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.getsignal(number) for number in numbers}
    heeded = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in heeded:  # `nohup` has one of them ignored
        signal.signal(number, signal.SIG_DFL)
    try:
        yield
    finally:
        for number, handler in heeded.items():
            signal.signal(number, handler)
