"""E1: of all lines between walls, those that a robot fits through and that lead somewhere."""

import numpy as np

from benchmarks.figures import drawing, worlds
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import RUNS, explored
from benchmarks.reference_gvg import reference_gvg
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.gvg.reduction import ReductionConfig, reduce_graph
from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan

DIAMETERS = np.arange(0.2, 1.3, 0.1)  # m
SHOWN = 0.5  # m: of the paper's robot
LOOK_EVERY = 10  # points of the reference's lines
BEARINGS = np.arange(1440) * np.deg2rad(0.25) - np.pi
REACH = 30.0  # m
BARE = 0.12  # m: less than walls' points are apart would make edges between those


def find() -> Finding:
    world = worlds.alcoves()
    seen = _seen(world)
    pure = _graph(seen, BARE, reduced=False)
    kept = {float(d): _graph(seen, float(d), reduced=True) for d in DIAMETERS}
    wide = {float(d): _graph(seen, float(d), reduced=False) for d in DIAMETERS}
    best = min(kept, key=lambda d: abs(d - SHOWN))
    chosen = kept[best]
    path = worlds.saved(world, RUNS / "worlds")
    summary = explored(path, f"twin.start={worlds.ALCOVES_START}").summary

    figure, (left, middle, right) = drawing.stage(1, 3, (13.0, 2.6), ratios=[2.5, 2.5, 1.6])
    for axes, graph, title in (
        (left, pure, f"all lines: {len(pure.edges)} edges"),
        (middle, chosen, f"D = {SHOWN} m, corners cut off: {len(chosen.edges)} edges"),
    ):
        drawing.walls(axes, world)
        drawing.lines(axes, (edge.polyline for edge in graph.edges.values()))
        places = [node.position for node in graph.nodes.values() if len(node.branches) >= 3]
        axes.plot(*np.array(places).T, "o", color=drawing.VERTEX, ms=5)
        drawing.labelled(axes, title)
    right.plot(list(wide), [len(g.edges) for g in wide.values()], "o-", label="width alone")
    right.plot(list(kept), [len(g.edges) for g in kept.values()], "s-", label="and corners cut off")
    right.axvline(SHOWN, color=drawing.PALE, lw=0.8)
    right.set_yscale("log")
    right.legend(fontsize=7)
    drawing.labelled(right, "edges that are left", "D, m", "edges")
    meetpoints = sum(len(node.branches) >= 3 for node in chosen.nodes.values())
    found = (meetpoints, len(chosen.edges), summary["vertices"], summary["edges"])
    return Finding(
        title="Spurious edges",
        claim="A building whose Voronoi graph has some twenty edges into its walls is reduced to "
        "two meetpoints by leaving out what the robot does not fit through.",
        verdict=f"{len(pure.edges)} edges become {found[1]} between {meetpoints} meetpoints at "
        f"D = {SHOWN} m; width alone leaves {len(wide[best].edges)}. "
        f"A robot that explored it found {found[2]} vertices and {found[3]} edges.",
        holds=found == (2, 3, 2, 3),
        figure=drawing.save(figure, "e1"),
        explained="Two blocks, with niches in all walls. Left: the lines that are as far from two "
        "pieces of wall. Middle: what the robot's rules leave. Right: how many edges there are, "
        "by the diameter D of the robot.",
    )


def _seen(world: World) -> LocalMap:
    """The whole world as a local map, seen from everywhere and without errors."""
    graph = reference_gvg(world, (2.0, 5.0), 0.177).graph
    places = np.concatenate([line[::LOOK_EVERY] for *_, line in graph.edges(data="line")])
    x0, y0, x1, y1 = world.extent
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    outside_in = places[np.argsort(-np.hypot(*(places - centre).T))]
    seen = LocalMap(LocalMapConfig(half_width_m=26.0, memory_m=200.0))
    for x, y in outside_in.tolist():
        ranges = world.cast(Pose(x, y), BEARINGS, REACH)
        scan = Scan(0.0, ranges, -np.pi, float(BEARINGS[1] - BEARINGS[0]), 0.05, REACH)
        seen.insert(scan, Pose(x, y), 0.0)
    return seen


def _graph(seen: LocalMap, diameter: float, *, reduced: bool) -> LocalGvg:
    rules = ReductionConfig() if reduced else ReductionConfig(min_reach=0.01, merge_m=0.0)
    roughness = rules.roughness_m if reduced else 0.0
    robot = np.array([2.0, 5.0])
    fine = fine_graph(seen, robot, min_clearance=diameter / 2, roughness=roughness)
    return reduce_graph(fine, rules)
