"""`gvgbot map`: pictures, facts and other formats of saved maps."""

import argparse
import shlex

from gvgbot.cli.arguments import Commands, add_overrides, frames, path, positive, same_robot, say
from gvgbot.errors import UsageError, extra_for
from gvgbot.words import counted


def add_map(commands: Commands) -> None:
    """Add `gvgbot map`."""
    maps = commands.add_parser(
        "map",
        help="pictures and facts of a saved map",
        description="Look at the maps that runs left in their directories.",
        epilog="example: gvgbot map show runs/office-1 --animate",
    )
    actions = maps.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for add in (_add_show, _add_info, _add_export, _add_diff, _add_import):
        add(actions)


def _add_show(actions: Commands) -> None:
    show = actions.add_parser(
        "show",
        help="draw the map, or how it grew",
        description="Draw the map of a run; with --frames N moments of the exploration side by "
        "side; with --animate a film in which everything appears as it was found.",
        epilog="example: gvgbot map show runs/office-1 --animate --out film.gif",
    )
    show.add_argument("run", type=path, metavar="RUN_DIR", help="the directory of a run")
    show.add_argument(
        "--out",
        type=path,
        metavar="FILE",
        help="what to write: .png, .svg or .pdf, .gif with --animate (default: picture.png, "
        "strip.png or film.gif in the run directory)",
    )
    show.add_argument("--animate", action="store_true", help="a GIF of the exploration")
    show.add_argument("--frames", type=frames, metavar="N", help="moments to draw, 2 to 200")
    show.set_defaults(command=_show)


def _add_info(actions: Commands) -> None:
    info = actions.add_parser(
        "info",
        help="counts, lengths, extent and accuracy",
        description="Say in a few lines what a map holds and how well it is known.",
        epilog="example: gvgbot map info runs/office-1",
    )
    info.add_argument("run", type=path, metavar="RUN_DIR", help="the directory of a run")
    info.set_defaults(command=_info)


def _add_export(actions: Commands) -> None:
    export = actions.add_parser(
        "export",
        help="the map in another format",
        description="Write the map of a run in the format that the file's name ends with: "
        ".svg and .pdf to print, .png, .graphml for graph programs, .geojson for the Nav2 route "
        "server, straight from node to node. With --ros-bag write a recording (MCAP) as a bag of "
        "ROS 2: scans, odometry, transforms, and the map as it grew.",
        epilog="example: gvgbot map export runs/office-1 office.pdf",
    )
    export.add_argument(
        "run", type=path, metavar="RUN_DIR", help="the directory of a run, or a recording"
    )
    export.add_argument("file", type=path, metavar="FILE", help="what to write")
    export.add_argument("--ros-bag", action="store_true", help="FILE is the new directory of a bag")
    export.add_argument(
        "--sensors-only",
        action="store_true",
        help="leave the map and the robot's place in it out of the bag, for programs that map",
    )
    export.set_defaults(command=_export)


def _add_import(actions: Commands) -> None:
    importing = actions.add_parser(
        "import",
        help="a run made of a ROS map, to drive in",
        description="Make a run of a map that somebody else has made (map_server YAML and image): "
        "the GVG of its largest free space, unless that lies around the building, with the walls "
        "to find the robot's place by. The map frame is that of the file; unknown pixels stay "
        "unknown.",
        epilog="example: gvgbot map import floor.yaml --out runs/floor",
    )
    importing.add_argument("map", type=path, metavar="MAP.yaml", help="the map")
    importing.add_argument(
        "--out", type=path, metavar="RUN_DIR", required=True, help="the directory of the new run"
    )
    importing.add_argument(
        "--config", type=path, metavar="C.yaml", help="of the robot; default: sim.yaml"
    )
    add_overrides(importing)
    importing.set_defaults(command=_import)


def _import(options: argparse.Namespace) -> int:
    from gvgbot.config import load_config
    from gvgbot.map_import import import_map

    config = load_config(options.config, options.overrides)
    vertices, edges = import_map(options.map, options.out, config)
    say(f"imported: {counted(vertices, 'vertex', 'vertices')}, {counted(edges, 'edge')}")
    words = ["gvgbot", "run", *same_robot(options), "--map", str(options.out)]
    if config.twin.enabled:
        words += ["--set", f"twin.world={options.map}"]
    say(f"to drive in it: {shlex.join(words)}")
    return 0


def _add_diff(actions: Commands) -> None:
    diff = actions.add_parser(
        "diff",
        help="how two maps of one place differ",
        description="Lay the second map on the first, and say which vertices and edges only one of "
        "them has, and how far apart the others are. Exits 0 if both maps have the same, 1 if not.",
        epilog="example: gvgbot map diff runs/office-1 runs/office-2 --out both.png",
    )
    diff.add_argument("a", type=path, metavar="RUN_A", help="the directory of a run")
    diff.add_argument("b", type=path, metavar="RUN_B", help="that of another")
    diff.add_argument(
        "--out", type=path, metavar="FILE", help="both, side by side: .png, .svg or .pdf"
    )
    diff.add_argument(
        "--tolerance",
        type=positive,
        default=0.5,
        metavar="M",
        help="metres that the same vertex or edge may be apart (default: %(default)s)",
    )
    diff.set_defaults(command=_diff)


def _show(options: argparse.Namespace) -> int:
    from gvgbot.maps.show import show

    picture = show(options.run, options.out, animate=options.animate, frames=options.frames)
    say(f"picture: {picture}")
    return 0


def _info(options: argparse.Namespace) -> int:
    from gvgbot.maps.saved_run import SavedRun
    from gvgbot.maps.show import facts

    for line in facts(SavedRun.read(options.run)):
        say(line)
    return 0


def _export(options: argparse.Namespace) -> int:
    from gvgbot.maps.export import export

    if options.ros_bag:
        return _export_bag(options)
    if options.sensors_only:
        raise UsageError("--sensors-only is about bags: give --ros-bag, too")
    flaw = export(options.run, options.file)
    say(f"written: {options.file}")
    if flaw is not None:
        say(f"but:     {flaw}")
    return 0


def _export_bag(options: argparse.Namespace) -> int:
    with extra_for("bags need rosbags", "ros2", "rosbags"):
        from gvgbot.ros_bag import export_bag

    for line in export_bag(options.run, options.file, sensors_only=options.sensors_only):
        say(line)
    say(f"written: {options.file}")
    return 0


def _diff(options: argparse.Namespace) -> int:
    from gvgbot.maps.diff import diff

    is_equal, lines = diff(options.a, options.b, options.out, tolerance=options.tolerance)
    for line in lines:
        say(line)
    return 0 if is_equal else 1
