"""`gvgbot twin` and `gvgbot check`: the devices alone, simulated or looked at."""

import argparse

from gvgbot.cli.arguments import Commands, add_config, same_robot, say


def add_twin(commands: Commands) -> None:
    """Add `gvgbot twin`."""
    twin = commands.add_parser(
        "twin",
        help="simulated devices on pseudo-terminals",
        description="Serve the twins of laser and base in one world, on pseudo-terminals that any "
        "program can open like a serial port, until stopped (SIGINT or SIGTERM).",
        epilog="example: gvgbot twin --laser-link /tmp/laser --base-link /tmp/base",
    )
    add_config(twin)
    for name in ("laser", "base"):
        twin.add_argument(
            f"--{name}-link",
            metavar="P",
            help=f"a stable name for the {name}'s port, or tcp://host:number to be reached there",
        )
    twin.set_defaults(command=_twin)


def _twin(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, options.overrides)
    from gvgbot import twin_server

    links = (options.laser_link, options.base_link)
    return twin_server.serve(config, links, same_robot(options), say)


def add_check(commands: Commands) -> None:
    """Add `gvgbot check`."""
    check = commands.add_parser(
        "check",
        help="look at the devices without moving the robot",
        description="Open the devices of the configuration, or its twins, listen for some seconds, "
        "and say of each point whether it is as it should be. The robot does not move.",
        epilog="example: gvgbot check turtlebot2.yaml --set base.port=/dev/ttyUSB0",
    )
    add_config(check)
    check.set_defaults(command=_check)


def _check(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config

    config = load_config(options.config, options.overrides)
    from gvgbot.check import check

    return check(config, say)
