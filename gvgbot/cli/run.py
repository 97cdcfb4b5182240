"""`gvgbot run`, the daemon, and `gvgbot install-service`, which makes it one of a machine."""

import argparse
import sys

from gvgbot.cli.arguments import Commands, add_config, path, say


def add_run(commands: Commands) -> None:
    """Add `gvgbot run`."""
    run = commands.add_parser(
        "run",
        help="the daemon: explore with the devices of the configuration",
        description="Run the daemon in real time, on the devices of the configuration or on their "
        "twins, until it is stopped (SIGINT or SIGTERM). With a state directory (service.state_dir "
        "or $STATE_DIRECTORY) it goes on with the map that it was making when it ended.",
        epilog="example: gvgbot run turtlebot2.yaml --set service.state_dir=/var/lib/gvgbot",
    )
    add_config(run)
    run.add_argument(
        "--out",
        type=path,
        metavar="DIR",
        help="a new run directory, with which no later start goes on (default: one in runs/, or in "
        "that of the state directory)",
    )
    run.add_argument(
        "--map",
        type=path,
        metavar="RUN_DIR",
        help="begin with the map of an earlier run (default: service.map, if set)",
    )
    run.add_argument(
        "--new",
        action="store_true",
        help="begin a new map, or with that of --map or service.map once more, whatever the state "
        "directory holds",
    )
    run.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    try:
        from gvgbot.stop_signals import StopSignals
    except KeyboardInterrupt:
        return 0  # it was stopped before it had begun
    with StopSignals() as signals:  # what is imported under it might swallow an exception
        from gvgbot.config import doubt_of_devices, load_config

        config = load_config(options.config, options.overrides)
        doubt = doubt_of_devices(options.config, options.overrides)
        if doubt:
            print(f"gvgbot: warning: the devices are simulated: {doubt}", file=sys.stderr)
        from gvgbot import daemon

        return daemon.run(config, signals, out=options.out, known=options.map, anew=options.new)


def add_install_service(commands: Commands) -> None:
    """Add `gvgbot install-service`."""
    install = commands.add_parser(
        "install-service",
        help="make the robot a service of this machine",
        description="Write the systemd service, the names of the ports, the user and the "
        "configuration to where they belong, and say what each is for and what to run then. A "
        "configuration that is there already is kept.",
        epilog="example: sudo /opt/gvgbot/bin/gvgbot install-service turtlebot2.yaml",
    )
    install.add_argument(
        "config", nargs="?", type=path, metavar="CONFIG", help="default: turtlebot2.yaml"
    )
    install.add_argument(
        "--user", action="store_true", help="a service of your own session, without root"
    )
    install.add_argument("--dry-run", action="store_true", help="only say what would be written")
    install.set_defaults(command=_install_service)


def _install_service(options: argparse.Namespace) -> int:
    from gvgbot.installation import install_service

    return install_service(options.config, user=options.user, dry_run=options.dry_run, say=say)
