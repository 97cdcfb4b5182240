"""A patrol in a finished map whose doors close and open again: ways change, the map does not."""

import json
import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from benchmarks.rigs.doors_rig import FLUSH, SOUTH, START, swing, theta
from benchmarks.rigs.run_rig import Daemon
from gvgbot.clock import Clock
from gvgbot.config import TwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.world import World
from gvgbot.simulation import Place

pytestmark = [pytest.mark.twin, pytest.mark.slow]

REMEMBERED = 25.0  # s
NORTH, MIDDLE = (5.5, 5.6), (4.7, 6.3, 3.7, 3.9)  # in a world that is smaller than the rig's
BAR_M, AROUND_M = 3.6, 8.6  # from one meetpoint to the other


def building() -> World:
    return theta(8.0, 5.6)


@dataclass
class Walk:
    """From one meetpoint to the other."""

    outcome: str
    driven: float
    off: float


@dataclass
class Diary:
    """What the map was like before and after, and the walks between."""

    walks: dict[str, Walk] = field(default_factory=dict)
    vertices: list[set[int]] = field(default_factory=list)
    edges: list[set[tuple[int, ...]]] = field(default_factory=list)
    places: list[dict[int, tuple[float, float]]] = field(default_factory=list)
    frontiers: list[int] = field(default_factory=list)


@pytest.fixture(scope="module")
def diary(tmp_path_factory: pytest.TempPathFactory) -> Diary:
    out = tmp_path_factory.mktemp("doors") / "run"
    world, kept = building(), Diary()
    twin = TwinConfig(base=KobukiTwinConfig(odometry="kobuki"))
    daemon = Daemon(out, Place(world, START), twin=twin)
    pipeline = daemon.session.pipeline
    exploration = replace(daemon.config.exploration, remember_blocked_s=REMEMBERED)
    pipeline.errands.configure(exploration)

    def note() -> None:
        graph, belief = pipeline.mapper.graph, pipeline.mapper.belief
        kept.vertices.append(set(graph.vertices))
        ends = [sorted((e.a.vertex, e.b.vertex)) for e in graph.edges.values()]
        kept.edges.append({(*pair, ends.count(pair)) for pair in ends})
        places = {v: START.transform(belief.map_vertex(v).position) for v in graph.vertices}
        kept.places.append({v: (float(x), float(y)) for v, (x, y) in places.items()})
        kept.frontiers.append(len(graph.frontiers()))

    def at(x: float, y: float) -> int:
        places = kept.places[0]
        return min(places, key=lambda vertex: math.dist(places[vertex], (x, y)))

    async def walk(clock: Clock, title: str, goal: tuple[float, float]) -> None:
        begin = pipeline.past.travelled
        answer = await daemon.network.ask("goto", vertex=at(*goal))
        assert answer.done, answer.text
        while pipeline.errands.errand is not None:
            await clock.sleep_until(clock.now() + 0.2)
        await clock.sleep_until(clock.now() + 1.0)
        lines = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
        (*_, end) = [line for line in lines if line["event"] == "errand_ended"]
        off = math.dist((daemon.place.x, daemon.place.y), goal)
        kept.walks[title] = Walk(end["outcome"], pipeline.past.travelled - begin, off)

    async def story(clock: Clock) -> None:
        while pipeline.mission.outcome is None:
            await clock.sleep_until(clock.now() + 1.0)
        note()
        await walk(clock, "to the south", SOUTH)
        for name, door in (("middle", MIDDLE), ("flush", FLUSH)):
            swing(world, door, shut=True, built=building)
            await walk(clock, f"{name} shut", NORTH)
            note()
            swing(world, door, shut=False, built=building)
            await clock.sleep_until(max(pipeline.errands.closures.until.values()))
            await walk(clock, f"{name} open", SOUTH)
            note()

    with daemon.session.directory:
        daemon.run(story)
    assert daemon.session.simulation is not None
    assert daemon.session.simulation.body.contacts == 0
    return kept


@pytest.mark.parametrize("door", ["middle", "flush"])
def test_a_shut_door_is_noticed_and_another_way_taken(diary: Diary, door: str) -> None:
    walk = diary.walks[f"{door} shut"]
    assert walk.outcome == "arrived"
    assert walk.off < 0.4
    assert AROUND_M - 0.8 < walk.driven < AROUND_M + BAR_M + 1.5  # to the door and back, and around


@pytest.mark.parametrize("door", ["middle", "flush"])
def test_an_open_door_is_gone_through_again(diary: Diary, door: str) -> None:
    walk = diary.walks[f"{door} open"]
    assert walk.outcome == "arrived"
    assert walk.off < 0.4
    assert walk.driven < BAR_M + 1.5


def test_the_map_is_the_same_all_the_time(diary: Diary) -> None:
    assert all(vertices == diary.vertices[0] for vertices in diary.vertices)
    assert all(edges == diary.edges[0] for edges in diary.edges)
    assert diary.frontiers == [0] * len(diary.frontiers)
    for places in diary.places:
        for vertex, place in places.items():
            assert np.hypot(*(np.array(place) - diary.places[0][vertex])) < 0.2
