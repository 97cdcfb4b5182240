"""Explorations that take down what was believed at the time; each is run once and kept.

A run directory has, beside what every run leaves, `trace.json`: a row for each keyframe, and all
vertices just before and just after each loop closure.
"""

import asyncio
import json
import re
import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gvgbot.autonomy.events import Event, LoopClosed
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.clock import VirtualTimeLoop
from gvgbot.config import Config, load_config
from gvgbot.daemon import explore_once
from gvgbot.drivers.world import World, load_world
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.maps import geojson
from gvgbot.maps.route_graph import RouteGraph
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.maps.trajectory import Trajectory, decode_tum
from gvgbot.progress import Progress
from gvgbot.session import Session
from gvgbot.simulation import open_place

RUNS = Path("runs/figures")
TRACE = "trace.json"

Row = dict[str, Any]


class Watched(Session):
    """A session that takes down its belief at each keyframe and around each closure."""

    def __init__(self, config: Config, directory: RunDirectory) -> None:
        super().__init__(config, directory, open_place(config))
        self.rows: list[Row] = []
        self.closures: list[Row] = []
        perceive = self.pipeline.perceive

        def watched(scan: Scan) -> list[Event]:
            count, before = len(self.pipeline.past.keyframes), self._vertices()
            happened = perceive(scan)
            if len(self.pipeline.past.keyframes) > count:
                self._note(scan.stamp, before, happened)
            return happened

        self.pipeline.perceive = watched  # type: ignore[method-assign]  # in its place

    def _note(self, stamp: float, before: Row, happened: list[Event]) -> None:
        after, travelled = self._vertices(), self.pipeline.past.travelled
        robot, known = after["robot"], after["vertices"].values()
        self.rows.append(
            {
                "stamp": stamp,
                "travelled": travelled,
                "robot": robot,
                "vertices": len(known),
                "u_map": sum(v[2] + v[4] for v in known),
            }
        )
        closed = [event.vertex for event in happened if isinstance(event, LoopClosed)]
        if closed:
            self.closures.append(
                {"stamp": stamp, "travelled": travelled, "closed": closed, "before": before}
                | {"after": after}
            )

    def _vertices(self) -> Row:
        belief = self.pipeline.mapper.belief
        return {
            "robot": _row(belief.map_base, belief.P[:2, :2]),
            "vertices": {str(key): _vertex(belief, key) for key in belief.ids},
        }


def _vertex(belief: Belief, key: int) -> list[float]:
    return _row(belief.map_vertex(key), belief.vertex_covariance(key))


def _row(pose: Pose, covariance: Array) -> list[float]:
    """Its x, y, and their covariance xx, xy, yy, m and m^2."""
    (xx, xy), (_, yy) = covariance.tolist()
    return [pose.x, pose.y, xx, xy, yy]


@dataclass(frozen=True)
class Run:
    """What an exploration left."""

    path: Path

    @cached_property
    def trace(self) -> Row:
        """Its `rows` and `closures`."""
        found: Row = json.loads((self.path / TRACE).read_text(encoding="utf-8"))
        return found

    @cached_property
    def summary(self) -> Row:
        found: Row = json.loads((self.path / "summary.json").read_text(encoding="utf-8"))
        return found

    @cached_property
    def events(self) -> list[Row]:
        lines = (self.path / "events.jsonl").read_text(encoding="utf-8").splitlines()
        return [json.loads(line) for line in lines]

    def happened(self, name: str) -> list[Row]:
        """The events of one kind."""
        return [event for event in self.events if event["event"] == name]

    @cached_property
    def route(self) -> RouteGraph:
        return geojson.decode((self.path / "map.geojson").read_text(encoding="utf-8"))

    @cached_property
    def world(self) -> World:
        return load_world(self.path / "world.yaml")

    def trajectory(self, name: str) -> Trajectory:
        return decode_tum((self.path / f"{name}.tum").read_text(encoding="utf-8"))

    @cached_property
    def start(self) -> Pose:
        """world_map."""
        twin = self.summary["config"]["twin"]
        start = twin["start"]
        if start is not None:
            return Pose(*start)
        return open_place(load_config(None, [f"twin.world={twin['world']}"])).start

    def series(self) -> tuple[Array, Array, Array]:
        """Metres driven, u_robot and u_map (m^2) at each keyframe."""
        rows = self.trace["rows"]
        u_robot = [row["robot"][2] + row["robot"][4] for row in rows]
        return (
            np.array([row["travelled"] for row in rows]),
            np.array(u_robot),
            np.array([row["u_map"] for row in rows]),
        )


def explored(world: str | Path, *settings: str, seed: int = 1) -> Run:
    """The run in a world with these settings of the configuration; it is run if it is not there."""
    wanted = [f"twin.world={world}", f"twin.seed={seed}", *settings]
    name = re.sub(r"[^\w.]+", "-", f"{Path(world).stem} {seed} {' '.join(settings)}").strip("-")
    run = Run(RUNS / name)
    if not (run.path / TRACE).exists():
        print(f"exploring: {' '.join(wanted)}", flush=True)
        _explore(load_config(None, wanted), run.path)
    return run


def _explore(config: Config, path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)  # of an attempt that was interrupted
    with RunDirectory.create(path, world="figures") as directory:
        session = Watched(config, directory)
        with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
            runner.run(explore_once(session, Progress()))
        session.save()
    trace = {"rows": session.rows, "closures": session.closures}
    (path / TRACE).write_text(json.dumps(trace), encoding="utf-8")
