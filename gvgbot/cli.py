"""The command line: arguments in, exit status out, one clear line for every failure."""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn

from gvgbot import __version__
from gvgbot.errors import GvgbotError, UsageError

FAILURE, BAD_USAGE, INTERRUPTED = 1, 2, 130
MOST_FRAMES = 200
NO_ECHO_M = 80.0  # of the lasers that CARMEN logs were made with
NEGATIVE_NUMBER = re.compile(r"-\.?\d")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; wrong arguments raise SystemExit(2)."""
    options = _parser().parse_args(arguments)
    return status_of(lambda: options.command(options))


def status_of(command: Callable[[], int]) -> int:
    """The command's own exit status, or 1 if it failed, 2 if it was asked wrongly, 130 if stopped.

    The reason goes to stderr; only a mistake of the program leaves a traceback.
    """
    try:
        return command()
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)
    except UsageError as error:
        return _fail(str(error), BAD_USAGE)
    except GvgbotError as error:
        return _fail(str(error), FAILURE)
    except BrokenPipeError:  # whoever read our output has gone, as `head` does
        return FAILURE


def _fail(message: str, status: int) -> int:
    """Say why on stderr, a line each; the status."""
    for line in message.splitlines():
        print(f"gvgbot: {line}", file=sys.stderr)
    return status


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes -1e-3 for a number, not for an option."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._negative_number_matcher = NEGATIVE_NUMBER

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_USAGE, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="gvgbot",
        description="A robot that maps a building by itself, along its generalized Voronoi graph.",
    )
    parser.add_argument("--version", action="version", version=f"gvgbot {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_explore(commands)
    _add_run(commands)
    _add_twin(commands)
    _add_check(commands)
    _add_install_service(commands)
    _add_monitor(commands)
    _add_web(commands)
    _add_ctl(commands)
    _add_map(commands)
    _add_replay(commands)
    return parser


def _add_explore(commands: "argparse._SubParsersAction[_Parser]") -> None:
    explore = commands.add_parser(
        "explore",
        help="explore a simulated world and leave a map",
        description="Explore a simulated world through the twins of the devices, as fast as this "
        "machine can, and write a run directory with the map. Exits 0 only if all was explored.",
        epilog="example: gvgbot explore --world office --seed 3 --out runs/office-3",
    )
    explore.add_argument(
        "--world",
        metavar="NAME|YAML",
        help="a built-in world (office, cave, floor_plan:7 and others), or a map_server YAML",
    )
    explore.add_argument(
        "--start",
        nargs=3,
        type=number,
        metavar=("X", "Y", "THETA"),
        help="where to start in the world: metres, metres, radians (default: a built-in world's "
        "own start, else 0 0 0)",
    )
    explore.add_argument("--seed", type=seed, metavar="N", help="draws all errors of the devices")
    explore.add_argument("--config", type=Path, metavar="C.yaml", help="default: sim.yaml")
    _add_overrides(explore)
    explore.add_argument(
        "--out", type=Path, metavar="DIR", help="run directory (default: a new one in runs/)"
    )
    explore.add_argument(
        "--real-time", action="store_true", help="at the pace of a real robot, not faster"
    )
    explore.set_defaults(command=_explore)


def _add_run(commands: "argparse._SubParsersAction[_Parser]") -> None:
    run = commands.add_parser(
        "run",
        help="the daemon: explore with the devices of the configuration",
        description="Run the daemon in real time, on the devices of the configuration or on their "
        "twins, until it is stopped (SIGINT or SIGTERM). With a state directory (service.state_dir "
        "or $STATE_DIRECTORY) it goes on with the map that it was making when it ended.",
        epilog="example: gvgbot run turtlebot2.yaml --set service.state_dir=/var/lib/gvgbot",
    )
    run.add_argument(
        "config", nargs="?", type=Path, metavar="CONFIG", help="default: sim.yaml, no hardware"
    )
    _add_overrides(run)
    run.add_argument(
        "--out", type=Path, metavar="DIR", help="run directory (default: a new one in runs/)"
    )
    known = run.add_mutually_exclusive_group()
    known.add_argument(
        "--map", type=Path, metavar="RUN_DIR", help="begin with the map of an earlier run"
    )
    known.add_argument(
        "--new", action="store_true", help="begin a new map, whatever the state directory holds"
    )
    run.set_defaults(command=_run)


def _add_twin(commands: "argparse._SubParsersAction[_Parser]") -> None:
    twin = commands.add_parser(
        "twin",
        help="simulated devices on pseudo-terminals",
        description="Serve the twins of laser and base in one world, on pseudo-terminals that any "
        "program can open like a serial port, until stopped (SIGINT or SIGTERM).",
        epilog="example: gvgbot twin --laser-link /tmp/laser --base-link /tmp/base",
    )
    _add_config(twin)
    for name in ("laser", "base"):
        twin.add_argument(
            f"--{name}-link",
            metavar="P",
            help=f"a stable name for the {name}'s port, or tcp://host:number to be reached there",
        )
    twin.set_defaults(command=_twin)


def _add_check(commands: "argparse._SubParsersAction[_Parser]") -> None:
    check = commands.add_parser(
        "check",
        help="look at the devices without moving the robot",
        description="Open the devices of the configuration, or its twins, listen for some seconds, "
        "and say of each point whether it is as it should be. The robot does not move.",
        epilog="example: gvgbot check turtlebot2.yaml --set base.port=/dev/ttyUSB0",
    )
    _add_config(check)
    check.set_defaults(command=_check)


def _add_install_service(commands: "argparse._SubParsersAction[_Parser]") -> None:
    install = commands.add_parser(
        "install-service",
        help="make the robot a service of this machine",
        description="Write the systemd service, the names of the ports, the user and the "
        "configuration to where they belong, and say what each is for and what to run then. A "
        "configuration that is there already is kept.",
        epilog="example: sudo /opt/gvgbot/bin/gvgbot install-service turtlebot2.yaml",
    )
    install.add_argument(
        "config", nargs="?", type=Path, metavar="CONFIG", help="default: turtlebot2.yaml"
    )
    install.add_argument(
        "--user", action="store_true", help="a service of your own session, without root"
    )
    install.add_argument("--dry-run", action="store_true", help="only say what would be written")
    install.set_defaults(command=_install_service)


def _add_monitor(commands: "argparse._SubParsersAction[_Parser]") -> None:
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
    monitor.add_argument("--robot", dest="named", metavar="NAME", help="the same")
    _add_connection(monitor)
    monitor.set_defaults(command=_monitor)


def _add_web(commands: "argparse._SubParsersAction[_Parser]") -> None:
    web = commands.add_parser(
        "web",
        help="watch a robot in the browser",
        description="Serve a page with the live map, the state and the events of a robot, to this "
        "machine only unless --host says otherwise, until Ctrl-C. Who has the page open can ask "
        "the robot for what its telemetry.requests permits.",
        epilog="example: gvgbot web turtlebot2 --connect tcp/192.168.1.7:7447",
    )
    web.add_argument(
        "robot", nargs="?", metavar="ROBOT", help="its robot.name (default: the only one there is)"
    )
    web.add_argument(
        "--host",
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
    _add_connection(web)
    web.set_defaults(command=_web)


def _add_ctl(commands: "argparse._SubParsersAction[_Parser]") -> None:
    ctl = commands.add_parser(
        "ctl",
        help="ask a robot for something",
        usage="%(prog)s [-h] [--connect ADDRESS] [--zenoh-file FILE] [ROBOT] REQUEST [WORD ...]",
        description="Ask a robot to pause, resume, stop (which ends the exploration), drive home, "
        "goto V (a vertex) or goto X Y (metres, map frame), explore, relocalise, save (the map), "
        "or set KEY VALUE. Prints what it does now and exits 0, or says why it does not, and "
        "exits 1. A robot does what telemetry.requests permits.",
        epilog="example: gvgbot ctl turtlebot2 goto 7 --connect tcp/192.168.1.7:7447",
    )
    ctl.add_argument(
        "words",
        nargs="+",
        metavar="WORD",
        help="the robot's robot.name (default: the only one there is), and the request",
    )
    _add_connection(ctl)
    ctl.set_defaults(command=_ctl)


def _add_connection(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ADDRESS",
        help="of the robot or of a zenoh router (default: %(default)s)",
    )
    parser.add_argument(
        "--zenoh-file",
        type=Path,
        metavar="FILE",
        help="keys and passwords, and perhaps an address: a configuration of zenoh in JSON5",
    )


def _add_map(commands: "argparse._SubParsersAction[_Parser]") -> None:
    maps = commands.add_parser(
        "map",
        help="pictures and facts of a saved map",
        description="Look at the maps that runs left in their directories.",
        epilog="example: gvgbot map show runs/office-1 --animate",
    )
    actions = maps.add_subparsers(title="commands", metavar="COMMAND", required=True)
    show = actions.add_parser(
        "show",
        help="draw the map, or how it grew",
        description="Draw the map of a run as a PNG; with --frames N moments of the exploration "
        "side by side; with --animate as a GIF in which everything appears as it was found.",
        epilog="example: gvgbot map show runs/office-1 --animate --out film.gif",
    )
    show.add_argument("run", type=Path, metavar="RUN_DIR", help="the directory of a run")
    show.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="default: picture.png, strip.png or film.gif in the run directory",
    )
    show.add_argument("--animate", action="store_true", help="a GIF of the exploration")
    show.add_argument("--frames", type=frames, metavar="N", help="moments to draw, 2 to 200")
    show.set_defaults(command=_map_show)
    info = actions.add_parser(
        "info",
        help="counts, lengths, extent and accuracy",
        description="Say in a few lines what a map holds and how well it is known.",
        epilog="example: gvgbot map info runs/office-1",
    )
    info.add_argument("run", type=Path, metavar="RUN_DIR", help="the directory of a run")
    info.set_defaults(command=_map_info)
    export = actions.add_parser(
        "export",
        help="the map in another format",
        description="Write the map of a run in the format that the file's name ends with: .svg and "
        ".pdf to print, .png, .graphml for graph programs, .geojson for the Nav2 route server.",
        epilog="example: gvgbot map export runs/office-1 office.pdf",
    )
    export.add_argument("run", type=Path, metavar="RUN_DIR", help="the directory of a run")
    export.add_argument("file", type=Path, metavar="FILE", help="what to write")
    export.set_defaults(command=_map_export)
    _add_map_diff(actions)


def _add_map_diff(actions: "argparse._SubParsersAction[_Parser]") -> None:
    diff = actions.add_parser(
        "diff",
        help="how two maps of one place differ",
        description="Lay the second map on the first, and say which vertices and edges only one of "
        "them has, and how far apart the others are. Exits 0 if both maps have the same, 1 if not.",
        epilog="example: gvgbot map diff runs/office-1 runs/office-2 --out both.png",
    )
    diff.add_argument("a", type=Path, metavar="RUN_A", help="the directory of a run")
    diff.add_argument("b", type=Path, metavar="RUN_B", help="that of another")
    diff.add_argument("--out", type=Path, metavar="FILE", help="a PNG of both, side by side")
    diff.add_argument(
        "--tolerance",
        type=positive,
        default=0.5,
        metavar="M",
        help="metres that the same vertex or edge may be apart (default: %(default)s)",
    )
    diff.set_defaults(command=_map_diff)


def _add_replay(commands: "argparse._SubParsersAction[_Parser]") -> None:
    replay = commands.add_parser(
        "replay",
        help="map a recorded run once more",
        description="Let the robot's mind live through a recording (MCAP) again, or through a "
        "CARMEN log (ODOM and FLASER lines, plain or gzipped), and write a run directory. A "
        "recording leaves the map of its run, to the last byte, unless --config or --set change "
        "what the mind does.",
        epilog="example: gvgbot replay run.mcap --out runs/again",
    )
    replay.add_argument("log", type=Path, metavar="FILE", help="the recording or log")
    replay.add_argument(
        "--config",
        type=Path,
        metavar="C.yaml",
        help="default: that of the recorded run; carmen.yaml for a CARMEN log",
    )
    _add_overrides(replay)
    replay.add_argument(
        "--out", type=Path, metavar="DIR", help="run directory (default: a new one in runs/)"
    )
    replay.add_argument(
        "--no-echo",
        type=number,
        default=NO_ECHO_M,
        metavar="M",
        help="ranges of a CARMEN log from here on mean that nothing was hit (default: %(default)s)",
    )
    replay.add_argument(
        "--serve",
        action="store_true",
        help="play it on the network at the pace of life, for gvgbot monitor and web, until "
        "stopped (SIGINT or SIGTERM)",
    )
    replay.add_argument(
        "--speed",
        type=positive,
        default=1.0,
        metavar="N",
        help="with --serve: so many times faster than life",
    )
    replay.set_defaults(command=_replay)


def _add_config(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "config", nargs="?", type=Path, metavar="CONFIG", help="default: sim.yaml, no hardware"
    )
    _add_overrides(parser)


def _add_overrides(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a configuration key, such as twin.base.odometry=worn; repeatable",
    )


def number(text: str) -> float:
    """A finite number. Raises ValueError."""
    value = float(text)
    if not isfinite(value):
        raise ValueError(text)
    return value


def seed(text: str) -> int:
    """A whole number, not negative. Raises ValueError."""
    value = int(text)
    if value < 0:
        raise ValueError(text)
    return value


def tcp_port(text: str) -> int:
    """A number of a TCP port. Raises ValueError."""
    value = int(text)
    if not 0 <= value <= 65535:
        raise ValueError(text)
    return value


def positive(text: str) -> float:
    """A finite number above 0. Raises ValueError."""
    value = number(text)
    if value <= 0.0:
        raise ValueError(text)
    return value


def frames(text: str) -> int:
    """A number of pictures that still makes a film. Raises ValueError."""
    value = int(text)
    if not 2 <= value <= MOST_FRAMES:
        raise ValueError(text)
    return value


def _explore(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, _overrides(options))
    from gvgbot import daemon

    return daemon.explore(config, out=options.out, real_time=options.real_time)


def _run(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, options.overrides)
    from gvgbot import daemon

    return daemon.run(config, out=options.out, known=options.map, anew=options.new)


def _twin(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, options.overrides)
    from gvgbot import twin_server

    return twin_server.serve(config, options.laser_link, options.base_link, _say)


def _check(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, options.overrides)
    from gvgbot.check import check

    return check(config, _say)


def _install_service(options: argparse.Namespace) -> int:
    from gvgbot.installation import install_service

    return install_service(options.config, user=options.user, dry_run=options.dry_run, say=_say)


def _monitor(options: argparse.Namespace) -> int:
    try:
        from gvgbot.monitor.app import monitor
    except ModuleNotFoundError as error:
        if error.name is None or not error.name.startswith("rich"):
            raise
        raise GvgbotError("the monitor needs rich: pip install 'gvgbot[tui]'") from error

    return monitor(options.robot or options.named, options.connect, options.zenoh_file)


def _web(options: argparse.Namespace) -> int:
    try:
        from gvgbot.web.app import web
    except ModuleNotFoundError as error:
        if error.name is None or not error.name.startswith("websockets"):
            raise
        raise GvgbotError("the page needs websockets: pip install 'gvgbot[web]'") from error

    connection = (options.robot, options.connect, options.zenoh_file)
    return web(*connection, host=options.host, port=options.port, say=_say)


def _ctl(options: argparse.Namespace) -> int:
    from gvgbot.ctl import ctl

    return ctl(options.words, options.connect, options.zenoh_file, _say)


def _map_show(options: argparse.Namespace) -> int:
    from gvgbot.maps.show import show

    path = show(options.run, options.out, animate=options.animate, frames=options.frames)
    _say(f"picture: {path}")
    return 0


def _map_info(options: argparse.Namespace) -> int:
    from gvgbot.maps.saved_run import SavedRun
    from gvgbot.maps.show import facts

    for line in facts(SavedRun.read(options.run)):
        _say(line)
    return 0


def _map_export(options: argparse.Namespace) -> int:
    from gvgbot.maps.export import export

    export(options.run, options.file)
    _say(f"written: {options.file}")
    return 0


def _map_diff(options: argparse.Namespace) -> int:
    from gvgbot.maps.diff import diff

    is_equal, lines = diff(options.a, options.b, options.out, tolerance=options.tolerance)
    for line in lines:
        _say(line)
    return 0 if is_equal else FAILURE


def _replay(options: argparse.Namespace) -> int:
    from gvgbot.replay import Wanted, replay

    wanted = Wanted(
        path=options.log,
        config=options.config,
        overrides=options.overrides,
        no_echo_m=options.no_echo,
    )
    if not options.serve:
        return replay(wanted, _say, out=options.out)
    from gvgbot.playback import serve

    return serve(wanted, out=options.out, speed=options.speed)


def _say(text: str) -> None:
    """A line to a person, at once, even into a pipe."""
    print(text, flush=True)


def _overrides(options: argparse.Namespace) -> list[str]:
    """The --set options, then what the short options say about the twins."""
    overrides = list(options.overrides)
    if options.world is not None:
        overrides.append(f"twin.world={_quoted(options.world)}")
    if options.start is not None:
        overrides.append(f"twin.start={options.start}")
    if options.seed is not None:
        overrides.append(f"twin.seed={options.seed}")
    return overrides


def _quoted(text: str) -> str:
    """The text as a YAML string, so that a world named 7 stays a name."""
    escaped = text.replace("'", "''")
    return f"'{escaped}'"
