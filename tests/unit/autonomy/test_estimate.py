"""The whole run put right, also where little was kept of it."""

from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from gvgbot.geometry import STANDSTILL, Pose
from gvgbot.hal.messages import Odometry
from tests.unit.autonomy.sights import carved, sweep

AWAY_FROM_THE_END = np.arange(-3.0, 2.1, 0.25)


def from_end_to_end() -> Pipeline:
    """Who has driven along a corridor, 2 m wide, that ends at x = -4.

    So its dead end is at -3, where the map begins.
    """
    world = carved([(-4.0, -1.0, 6.0, 1.0)])
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    for step, x in enumerate(AWAY_FROM_THE_END.tolist()):
        pipeline.control(Odometry(0.1 * step, Pose(x, 0.0), STANDSTILL))
        pipeline.perceive(replace(sweep(world, Pose(x, 0.0)), stamp=0.1 * step))
    return pipeline


def keep(kept: str, pipeline: Pipeline) -> None:
    """Lose the sights of vertices but for what is kept of them."""
    observations = pipeline.mapper.observations
    observations[:] = {
        "all": observations,
        "positions": [replace(seen, R=seen.R[:2, :2]) for seen in observations],
        "nothing": [],
    }[kept]


@pytest.mark.parametrize("kept", ["all", "positions", "nothing"])
def test_a_vertex_stands_where_it_is_whatever_was_kept_of_its_sights(kept: str) -> None:
    pipeline = from_end_to_end()
    keep(kept, pipeline)
    vertices = smoothed(pipeline).vertices
    assert min(np.hypot(*place.position) for place in vertices.values()) < 0.05


@pytest.mark.parametrize(("kept", "share"), [("positions", 0.99), ("nothing", 0.25)])
def test_who_has_kept_less_of_its_sights_of_vertices_is_no_more_certain_of_them(
    kept: str, share: float
) -> None:
    """With nothing the filter is asked, to which a sight is worth four times as much."""
    pipeline = from_end_to_end()
    by_all = smoothed(pipeline).covariances
    assert by_all.keys() == pipeline.mapper.graph.vertices.keys() != set()
    keep(kept, pipeline)
    found = smoothed(pipeline).covariances
    assert all(np.trace(found[vertex]) > share * np.trace(by_all[vertex]) for vertex in by_all)
