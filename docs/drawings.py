"""Draws images/*.svg of the explanation pages, from built-in worlds and the robot's own code.

python -m docs.drawings
"""

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from benchmarks.reference_gvg import reference_gvg
from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.drivers.world import World
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist
from gvgbot.hal.guard import GuardConfig
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.hal.sweep import free_distance
from gvgbot.worlds import builtin

IMAGES = Path(__file__).parent / "images"
RADIUS = 0.177  # m, of a Kobuki
WALL, EDGE, DISC, ROBOT, SEEN = "#3b4252", "#1f77b4", "#d9822b", "#c0392b", "#eef4fa"
SHOWN = (1.4, 2.4, 17.6, 13.4)  # m: the part of the office that is drawn, least x and y first


def draw_equidistance() -> None:
    """Walls, the lines midway between them, and discs that touch two walls, and three."""
    world, start = builtin("office")
    graph = reference_gvg(world, (start.x, start.y), RADIUS).graph
    figure, axes = _stage(8.0, 5.6)
    _walls(axes, world)
    for *_, line in graph.edges(data="line"):
        axes.plot(*np.asarray(line).T, color=EDGE, lw=1.8)
    inside = [n for n, p in graph.nodes(data="position") if _is_shown(p)]
    for node in inside:
        _vertex(axes, graph.nodes[node]["position"], is_meetpoint=graph.degree(node) >= 3)
    middle = np.array([(SHOWN[0] + SHOWN[2]) / 2, SHOWN[1]])
    meetpoints = [node for node in inside if graph.degree(node) >= 3]
    meetpoint = min(meetpoints, key=lambda n: np.hypot(*(graph.nodes[n]["position"] - middle)))
    _disc(axes, world, graph.nodes[meetpoint]["position"], contacts=3)
    line = max((np.asarray(line) for a, _, line in graph.edges(meetpoint, data="line")), key=len)
    _disc(axes, world, line[len(line) // 2], contacts=2)
    axes.set(xlim=SHOWN[0::2], ylim=SHOWN[1::2])
    _save(figure, "equidistance")


def draw_sight() -> None:
    """What one scan sees of the office, and the part of the graph that is certain from it."""
    world, start = builtin("office")[0], Pose(9.0, 4.0, math.pi)
    scan = _scan(world, start)
    pipeline = Pipeline(AutonomyConfig(), ExplorationConfig(), RADIUS)
    pipeline.control(Odometry(0.0, Pose(), STANDSTILL))
    pipeline.control(Odometry(0.2, Pose(), STANDSTILL))
    pipeline.perceive(scan)
    figure, axes = _stage(8.0, 5.6)
    ends = start.transform(np.nan_to_num(scan.ranges, posinf=10.0)[:, None] * _directions(scan))
    axes.add_patch(Polygon(np.vstack([start.position, ends]), color=SEEN, zorder=0))
    _walls(axes, world)
    for edge in pipeline.gvg.edges.values():
        axes.plot(*start.transform(edge.polyline).T, color=EDGE, lw=2.2)
    for node in pipeline.gvg.nodes.values():
        place = start.transform(node.position[None])[0]
        if node.is_meetpoint or node.is_endpoint:
            _vertex(axes, place, is_meetpoint=node.is_meetpoint)
        elif node.lead is not None:
            axes.annotate(
                "?", place, color=DISC, fontsize=15, weight="bold", ha="center", va="center"
            )
    axes.add_patch(Circle((start.x, start.y), RADIUS, color=ROBOT, zorder=5))
    axes.set(xlim=SHOWN[0::2], ylim=SHOWN[1::2])
    _save(figure, "sight")


def draw_guard() -> None:
    """The footprint on an arc that a chair leg ends, with the distance in which the robot stops."""
    limits, twist = GuardConfig(), Twist(0.5, 0.5)
    leg = np.array([[0.95, 0.30]])
    way = free_distance((leg[:, 0], leg[:, 1]), twist, radius=RADIUS, margin=limits.margin_m)
    delay = limits.max_braking_mps2 * limits.response_time_s
    speed = min(twist.linear, math.sqrt(delay**2 + 2 * limits.max_braking_mps2 * way) - delay)
    stop = speed * limits.response_time_s + speed**2 / (2 * limits.max_braking_mps2)
    figure, axes = _stage(8.0, 3.4)
    for reach, color in ((RADIUS + limits.margin_m, "#f3d9b5"), (RADIUS, "#dce6f0")):
        for metres in np.linspace(0.0, way, 40):
            axes.add_patch(Circle(_on_arc(twist, metres), reach, color=color, zorder=1))
    for metres in (0.0, stop, way):
        place = _on_arc(twist, metres)
        axes.add_patch(Circle(place, RADIUS, fill=False, color=ROBOT, lw=1.6, zorder=4))
    _label(axes, "the robot now", (-0.02, -0.27), _on_arc(twist, 0.0))
    _label(axes, "stands here if it brakes now", (0.42, -0.27), _on_arc(twist, stop))
    _label(axes, "must not come here", (0.95, -0.05), _on_arc(twist, way))
    axes.plot(
        *np.array([_on_arc(twist, m) for m in np.linspace(0, way, 50)]).T, color=EDGE, zorder=5
    )
    axes.plot(*leg.T, "o", color=WALL, ms=9, zorder=6)
    _label(axes, "what the laser saw", (1.2, 0.2), tuple(leg[0]))
    axes.set(xlim=(-0.3, 1.5), ylim=(-0.33, 0.56))
    _save(figure, "guard")


def _label(axes: Axes, text: str, at: tuple[float, float], of: tuple[float, float]) -> None:
    arrow = {"arrowstyle": "-", "color": WALL, "lw": 0.8}
    axes.annotate(text, of, at, ha="center", va="center", fontsize=10, arrowprops=arrow, zorder=7)


def _on_arc(twist: Twist, metres: float) -> tuple[float, float]:
    """The place (m) so far along the arc, base frame."""
    angle = metres * twist.angular / twist.linear
    turn = twist.linear / twist.angular
    return turn * math.sin(angle), turn * (1.0 - math.cos(angle))


def _is_shown(place: Array) -> bool:
    return bool(np.all(place > SHOWN[:2]) and np.all(place < np.array(SHOWN[2:]) - 0.8))


def _scan(world: World, pose: Pose) -> Scan:
    """A sweep of three quarters of a circle, without errors."""
    step = math.radians(0.25)
    bearings = np.arange(1081, dtype=np.float64) * step - 1.5 * math.pi / 2
    ranges = world.cast(pose, bearings, 30.0)
    return Scan(0.1, ranges, float(bearings[0]), step, 0.1, 30.0)


def _directions(scan: Scan) -> Array:
    return np.stack([np.cos(scan.bearings), np.sin(scan.bearings)], axis=1)


def _stage(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="tight")
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def _walls(axes: Axes, world: World) -> None:
    """The occupied cells."""
    x0, y0, x1, y1 = world.extent
    shades = ListedColormap(["#ffffff00", WALL])
    extent = (x0, x1, y0, y1)
    axes.imshow(world.occupied, cmap=shades, origin="lower", extent=extent, interpolation="nearest")


def _vertex(axes: Axes, place: Array, *, is_meetpoint: bool) -> None:
    face = EDGE if is_meetpoint else "white"
    axes.plot(*place, "o", mfc=face, mec=EDGE, mew=1.8, ms=8, zorder=6)


def _disc(axes: Axes, world: World, centre: Array, *, contacts: int) -> None:
    """The largest free disc around a point, with lines to where it touches."""
    offsets = world.wall_offsets(float(centre[0]), float(centre[1]), 3.0)
    away = np.hypot(*offsets.T)
    clearance = float(away.min())
    axes.add_patch(Circle(tuple(centre), clearance, fc=DISC, alpha=0.22, zorder=2))
    axes.add_patch(Circle(tuple(centre), clearance, fill=False, ec=DISC, lw=1.5, zorder=3))
    touching = offsets[np.argsort(away)]
    chosen: list[Array] = []
    for offset in touching:
        if all(np.hypot(*(offset - other)) > clearance / 2 for other in chosen):
            chosen.append(offset)
        if len(chosen) == contacts:
            break
    for offset in chosen:
        axes.plot(*np.array([centre, centre + offset]).T, color=DISC, lw=1.5, zorder=4)


def _save(figure: Figure, name: str) -> None:
    with mpl.rc_context(
        {"svg.hashsalt": name, "svg.fonttype": "none", "font.family": "sans-serif"}
    ):
        figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None}, facecolor="white")


if __name__ == "__main__":
    draw_equidistance()
    draw_sight()
    draw_guard()
