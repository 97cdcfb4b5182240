"""`gvgbot explore`."""

import argparse
import json

from gvgbot.cli.arguments import Commands, add_overrides, number, path, say, seed

MOST_ROBOTS = 8


def add_explore(commands: Commands) -> None:
    """Add `gvgbot explore`."""
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
        help="a built-in world (office, cave, floor_plan:7 and others), or a map_server YAML "
        "(default: that of the configuration; office in sim.yaml)",
    )
    explore.add_argument(
        "--start",
        nargs=3,
        type=number,
        metavar=("X", "Y", "THETA"),
        help="where to start in the world: metres, metres, radians (default: a built-in world's "
        "own start, else 0 0 0)",
    )
    explore.add_argument(
        "--seed",
        type=seed,
        metavar="N",
        help="draws all errors of the devices (default: that of the configuration; 1 in sim.yaml)",
    )
    explore.add_argument(
        "--robots",
        type=robots,
        default=1,
        metavar="N",
        help="so many robots explore together, 1 to 8; the others start anywhere, by the seed",
    )
    explore.add_argument("--config", type=path, metavar="C.yaml", help="default: sim.yaml")
    add_overrides(explore)
    explore.add_argument(
        "--out", type=path, metavar="DIR", help="run directory (default: a new one in runs/)"
    )
    explore.add_argument(
        "--real-time", action="store_true", help="at the pace of a real robot, not faster"
    )
    explore.set_defaults(command=_explore)


def robots(text: str) -> int:
    """A number of robots that can explore together. Raises ArgumentTypeError."""
    if not text.isdecimal() or not 1 <= int(text) <= MOST_ROBOTS:
        raise argparse.ArgumentTypeError(f"{text!r}: it can be 1 to {MOST_ROBOTS} robots")
    return int(text)


def _explore(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config
    from gvgbot.stop_signals import StopSignals

    config = load_config(options.config, _overrides(options))
    where = {"out": options.out, "real_time": options.real_time}
    if options.robots > 1:
        from gvgbot.expedition import explore_together

        with StopSignals(unblocks=False) as signals:
            return explore_together(config, options.robots, say, signals, **where)
    from gvgbot import daemon

    with StopSignals(unblocks=False) as signals:
        return daemon.explore(config, say, signals, **where)


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
    """The text as a YAML string: a world named 7 stays a name, and any file's name can be told."""
    return json.dumps(text)
