"""`gvgbot replay`."""

import argparse

from gvgbot.cli.arguments import Commands, add_overrides, path, positive, say
from gvgbot.errors import UsageError


def add_replay(commands: Commands) -> None:
    """Add `gvgbot replay`."""
    replay = commands.add_parser(
        "replay",
        help="map a recorded run once more",
        description="Let the robot's mind live through a recording (MCAP) again, or through a "
        "CARMEN log (lines of ODOM and of FLASER or ROBOTLASER1, plain or packed), and write a "
        "run directory. A recording leaves the map of its run, to the last byte, unless --config "
        "or --set change what the mind does.",
        epilog="example: gvgbot replay run.mcap --out runs/again",
    )
    replay.add_argument("log", type=path, metavar="FILE", help="the recording or log")
    replay.add_argument(
        "--config",
        type=path,
        metavar="C.yaml",
        help="default: that of the recorded run; carmen.yaml for a CARMEN log",
    )
    add_overrides(replay)
    replay.add_argument(
        "--out", type=path, metavar="DIR", help="run directory (default: a new one in runs/)"
    )
    replay.add_argument(
        "--no-echo",
        type=positive,
        metavar="M",
        help="ranges of a CARMEN log from here on mean that nothing was hit (default: 80.0)",
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
        metavar="N",
        help="with --serve: so many times faster than life (default: 1)",
    )
    replay.set_defaults(command=_replay)


def _replay(options: argparse.Namespace) -> int:
    from gvgbot.replay import Wanted, replay

    wanted = Wanted(
        path=options.log,
        config=options.config,
        overrides=options.overrides,
        no_echo_m=options.no_echo,
    )
    if not options.serve:
        if options.speed is not None:
            raise UsageError("--speed is about playing it on the network: give --serve, too")
        return replay(wanted, say, out=options.out)
    from gvgbot.playback import serve

    return serve(wanted, out=options.out, speed=options.speed or 1.0)
