"""Explore worlds and compare what the robot believes with the truth: is it as wrong as it says?

    python -m benchmarks.consistency [--worlds floor_plan:1 ring ...] [--seeds 1 2]
        [--plans FROM TO] [--odometry kobuki worn] [--worse 2 4 8] [--lasers UTM-30LX ...]
        [--set key=value ...] [--out FILE] [--plot DIRECTORY]

All runs are in this process, one after the other, in virtual time. For each a line is printed:
NEES of the pose at keyframes (3 degrees of freedom), of the vertices of the map and of the filter
(2), and of closures against the sight of the vertex before (3); how many closures were wrong, how
many vertices were entered twice, and of how many revisits the vertex was recognised; end error and
vertex RMSE. FILE keeps the numbers as lines of
JSON; runs that are in there are not run again. Then the means, each with the band in which 95 % of
such means lie if the errors are as the covariances say. Errors of one run hang together, so a run
counts as one. --worse makes the errors of wheels and gyro so many times as large as the profile has
them. --plot needs matplotlib (the extra `plot`).
"""

import argparse
import contextlib
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple
from itertools import product
from pathlib import Path
from typing import cast

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks import campaign
from benchmarks.consistency_report import Row, line, plot, summary
from benchmarks.reference_gvg import reference_gvg
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.events import Event, LoopClosed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import Config, load_config
from gvgbot.drivers.kobuki.odometry_error import PROFILES, OdometryError, OdometryProfile
from gvgbot.driving import drive
from gvgbot.errors import GvgbotError
from gvgbot.geometry import Array, Pose, rotated_covariance, wrap_angle
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.links import Devices, Links
from gvgbot.simulation import Simulation, open_place

MATCH = 1.5  # m: a vertex farther from the true one is another
WRONG_M = 1.0  # a closure that lays a vertex this far from where it is is wrong
AWAY_M, THERE_M = 8.0, 1.0  # who was so far from a vertex and comes so near again revisits it
TIMES_WORSE = "*"  # between the name of a profile and how many times it is worse
TIMES = 50  # of the error and the sigma along a run, that are kept for the plot


class Watched(Pipeline):
    """Takes down what it believed of its pose at each keyframe."""

    def __init__(self, config: Config) -> None:
        super().__init__(
            config.mind,
            config.exploration,
            config.robot.radius_m,
            localisation=config.localisation,
        )
        self.believed: list[tuple[Pose, Array]] = []
        self.closures: list[tuple[int, LoopClosed]] = []  # with their keyframes

    def perceive(self, scan: Scan) -> list[Event]:
        count = len(self.past.keyframes)
        happened = super().perceive(scan)
        if len(self.past.keyframes) > count:
            belief = self.mapper.belief
            self.believed.append((belief.map_base, belief.P[:3, :3].copy()))
        self.closures += [(count, e) for e in happened if isinstance(e, LoopClosed)]
        return happened


async def explore(config: Config, pipeline: Pipeline, truth: list[tuple[float, ...]]) -> None:
    """Drive until there is an outcome, or no more time; rows of stamp and world_base."""
    clock = LoopClock()
    simulation = Simulation(config, open_place(config), clock)
    devices = Devices(Links(config, clock, simulation))

    def note(odometry: Odometry) -> None:
        simulation.body.advance(odometry.stamp)
        pose = simulation.body.pose
        truth.append((odometry.stamp, pose.x, pose.y, pose.theta))

    limit = config.twin.time_limit_s
    await drive(config.robot, devices, pipeline, on_cycle=note, limit_s=limit)


def run(overrides: Sequence[str]) -> Row:
    """Explore once and compare."""
    config = load_config(None, overrides)
    pipeline, track, begin = Watched(config), list[tuple[float, ...]](), time.process_time()
    run_in_virtual_time(explore(config, pipeline, track))
    place = open_place(config)
    map_base = _truth(pipeline, np.array(track), place.start)
    start = place.start.x, place.start.y
    reference = reference_gvg(place.world, start, config.robot.radius_m)
    positions = [data["position"] for _, data in reference.graph.nodes.items()]
    map_world = place.start.inverse()
    places = map_world.transform(np.array(positions).reshape(-1, 2))
    meetpoints = np.concatenate([places, map_world.transform(reference.meetpoints)])
    return {
        "outcome": pipeline.mission.outcome,
        "driven_m": pipeline.past.travelled,
        "cpu_s": time.process_time() - begin,
        **_poses(pipeline, map_base),
        **_vertices(pipeline, places, meetpoints),
        **_closures(pipeline, map_base),
        **_revisits(pipeline, map_base),
    }


def _truth(pipeline: Pipeline, track: Array, start: Pose) -> list[Pose]:
    """Where the base truly was at each keyframe, in the map frame."""
    stamps = [keyframe.stamp for keyframe in pipeline.past.keyframes]
    columns = [track[:, 1], track[:, 2], np.unwrap(track[:, 3])]
    world_base = np.stack([np.interp(stamps, track[:, 0], c) for c in columns], axis=1)
    return [start.to(Pose.from_array(row)) for row in world_base]


def _poses(pipeline: Watched, truth: list[Pose]) -> Row:
    errors, nees, sigmas = [], [], []
    for (believed, covariance), true in zip(pipeline.believed[1:], truth[1:], strict=True):
        off = _difference(believed, true)
        errors.append(off)
        nees.append(float(off @ np.linalg.solve(covariance, off)))
        sigmas.append(np.sqrt(np.diag(covariance)))
    e, s = np.array(errors), np.array(sigmas)
    at = np.linspace(0, len(e) - 1, TIMES).astype(int)
    return {
        "pose_nees": float(np.mean(nees)),
        "pose_rms_m": float(np.sqrt((e[:, :2] ** 2).sum(axis=1).mean())),
        "pose_sigma_m": float(np.sqrt((s[:, :2] ** 2).sum(axis=1).mean())),
        "heading_rms": float(np.sqrt((e[:, 2] ** 2).mean())),
        "heading_sigma": float(np.sqrt((s[:, 2] ** 2).mean())),
        "pose_peak_m": float(np.hypot(*s[:, :2].T).max()),
        "pose_last_m": float(np.hypot(*s[-1, :2])),
        "end_error_m": float(np.hypot(*e[-1, :2])),
        "along": np.hypot(*e[at, :2].T).round(4).tolist(),
        "along_sigma": np.hypot(*s[at, :2].T).round(4).tolist(),
    }


def _vertices(pipeline: Pipeline, places: Array, meetpoints: Array) -> Row:
    """The vertices of the map and of the filter against those of the building (N, 2).

    Each is compared with the meetpoint (M, 2) of the whole GVG that is nearest: a map may end in
    a room at either end of its middle line, and have one of two close meetpoints for both.
    `reduced_vertex_nees` is by those of the reduced GVG that were found, as it has them.
    """
    estimate, belief = smoothed(pipeline), pipeline.mapper.belief
    ids = list(estimate.vertices)
    found = np.array([estimate.vertices[v].position for v in ids]).reshape(-1, 2)
    gaps = np.hypot(*(found[:, None] - places).transpose(2, 0, 1))
    pairs = [
        (ids[i], places[j])
        for i, j in zip(*linear_sum_assignment(np.where(gaps < MATCH, gaps, 1e3)), strict=True)
        if gaps[i, j] < MATCH
    ]
    free = set(ids) - {v for v, _ in pairs}

    def mapped_off(there: list[tuple[int, Array]]) -> list[tuple[Array, Array]]:
        return [(estimate.vertices[v].position - p, estimate.covariances[v]) for v, p in there]

    own = [(v, _nearest(meetpoints, estimate.vertices[v].position)) for v, _ in pairs]
    mapped, reduced = mapped_off(own), mapped_off(pairs)
    held = [(belief.map_vertex(v).position - p, belief.vertex_covariance(v)) for v, p in own]
    near = [v for v in free if len(places) and gaps[ids.index(v)].min() < WRONG_M]
    return {
        "vertices": len(ids),
        "twice": len(near),
        "vertex_sigma_m": float(
            np.mean([np.sqrt(np.trace(C)) for C in estimate.covariances.values()])
        ),
        "vertex_nees": _mean_nees(mapped),
        "reduced_vertex_nees": _mean_nees(reduced),
        "filter_vertex_nees": _mean_nees(held),
        "vertex_rmse_m": float(np.sqrt(np.mean([d @ d for d, _ in mapped]))) if mapped else None,
        "vertex_distances": [round(float(d @ np.linalg.solve(C, d)), 3) for d, C in mapped],
    }


def _nearest(places: Array, position: Array) -> Array:
    return np.asarray(places[np.hypot(*(places - position).T).argmin()])


def _closures(pipeline: Watched, truth: list[Pose]) -> Row:
    """Each closure against the place where the vertex was before it, both by the true poses.

    How wrong it is, is by the newest sight of the vertex before; how wrong in units of what both
    claim, by the newest one from near by, which told the heading as well.
    """
    closed = {(keyframe, event.vertex) for keyframe, event in pipeline.closures}
    newest, whole = dict[int, Pose](), dict[int, tuple[Pose, Array]]()
    errors, offs = list[tuple[Array, Array]](), list[float]()
    for seen in pipeline.mapper.observations:
        here = truth[seen.keyframe].compose(seen.base_vertex)
        is_whole = len(seen.R) == 3
        covariance = rotated_covariance(seen.R, truth[seen.keyframe].theta) if is_whole else seen.R
        if (seen.keyframe, seen.vertex) in closed and seen.vertex in newest:
            off = _difference(here, newest[seen.vertex])
            offs.append(float(np.hypot(*off[:2])))
            if is_whole and seen.vertex in whole:
                before, claimed = whole[seen.vertex]
                errors.append((_difference(here, before), covariance + claimed))
        newest[seen.vertex] = here
        if is_whole:
            whole[seen.vertex] = here, covariance
    return {
        "closures": len(offs),
        "wrong": sum(off > WRONG_M for off in offs),
        "closure_nees": _mean_nees(errors),
        "nis": [round(event.mahalanobis, 3) for _, event in pipeline.closures],
    }


def _revisits(pipeline: Watched, truth: list[Pose]) -> Row:
    """How often the robot came back to a vertex of the map, and in how many it was recognised.

    It was if it is seen, by that name, before the robot has been far away from it again.
    """
    way, sights = np.array([pose.position for pose in truth]), dict[int, list[int]]()
    first = dict[int, Array]()
    for seen in pipeline.mapper.observations:
        sights.setdefault(seen.vertex, []).append(seen.keyframe)
        first.setdefault(seen.vertex, truth[seen.keyframe].compose(seen.base_vertex).position)
    again = [
        visit
        for vertex in pipeline.mapper.graph.vertices.keys() & first.keys()
        for visit in revisits(np.hypot(*(way - first[vertex]).T), sights[vertex])
    ]
    return {"revisits": len(again), "recognised": sum(again)}


def revisits(gaps: Array, sights: Sequence[int]) -> list[bool]:
    """Of each time that a vertex was come back to after its first sight, whether it was sighted.

    `gaps` (N,) are its distances, m, from the robot at the keyframes, `sights` those of its sights.
    """
    away = [*np.flatnonzero(gaps > AWAY_M), len(gaps)]
    found, since = list[bool](), sights[0]
    for until in (int(k) for k in away if k > sights[0]):
        if since > sights[0] and gaps[since:until].min(initial=np.inf) < THERE_M:
            found.append(any(since <= sight < until for sight in sights))
        since = until
    return found


def _difference(a: Pose, b: Pose) -> Array:
    return np.array([a.x - b.x, a.y - b.y, wrap_angle(a.theta - b.theta)])


def _mean_nees(errors: list[tuple[Array, Array]]) -> float | None:
    return float(np.mean([e @ np.linalg.solve(C, e) for e, C in errors])) if errors else None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print a line for each and the summary."""
    options = _options(arguments)
    worlds = [(world, seed) for world in options.worlds for seed in options.seeds]
    low, high = options.plans or (1, 0)
    worlds += [(f"floor_plan:{number}", number) for number in range(low, high + 1)]
    profiles = [_profile(*both) for both in product(options.odometry, options.worse)]
    names = [
        f"{world} {seed} {odometry} {laser}"
        for (world, seed), odometry, laser in product(worlds, profiles, options.lasers)
    ]
    rows = []
    for row in campaign.rows(
        options.out,
        names,
        lambda some: (_row(name, options.overrides) for name in some),
        case_of=lambda row: str(row["name"]),
        is_good=lambda row: row.get("settings", []) == options.overrides,
    ):
        rows.append(row)
        print(line(row), flush=True)
    rows.sort(key=lambda row: names.index(row["name"]))
    print("\n".join(summary(rows)))
    if options.plot is not None:
        plot(rows, options.plot)
    return 0


def _profile(odometry: str, worse: float) -> str:
    return odometry if worse == 1.0 else f"{odometry}{TIMES_WORSE}{worse:g}"


def _row(name: str, overrides: Sequence[str]) -> Row:
    world, seed, profile, laser = name.split()
    odometry, _, worse = profile.partition(TIMES_WORSE)
    settings = [
        f"twin.world={world}",
        f"twin.seed={seed}",
        f"twin.base.odometry={odometry}",
        f"twin.laser.model={laser}",
        *overrides,
    ]
    with made_worse(odometry, float(worse or 1.0)):
        named = {"name": name, "odometry": profile, "settings": list(overrides)}
        return named | run(settings)


@contextlib.contextmanager
def made_worse(odometry: str, times: float) -> Iterator[None]:
    """A profile whose wheels and gyro err so many times as much."""
    name = cast(OdometryProfile, odometry)
    usual = PROFILES[name]
    PROFILES[name] = OdometryError(*(times * value for value in astuple(usual)))
    try:
        yield
    finally:
        PROFILES[name] = usual


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--worlds", nargs="*", default=[])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--plans", nargs=2, type=int, metavar=("FROM", "TO"))
    parser.add_argument("--odometry", nargs="+", default=["kobuki", "worn"])
    parser.add_argument("--worse", nargs="+", type=float, default=[1.0])
    parser.add_argument("--lasers", nargs="+", default=["UTM-30LX"])
    parser.add_argument("--set", dest="overrides", nargs="+", default=[])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot", type=Path)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except GvgbotError as error:
        sys.exit(str(error))
