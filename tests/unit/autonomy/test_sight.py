"""What of the GVG there is to be seen is doubtful, beside who may soon be elsewhere."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gvgbot.autonomy.newcomers import Newcomer
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from tests.unit.autonomy.local_graphs import drawn

STREET = drawn({1: (-3.0, 0.0), 2: (0.0, 0.0), 3: (3.0, 0.0)}, {10: (1, 2, []), 11: (2, 3, [])})


@pytest.mark.parametrize(
    ("place", "in_team", "doubted"),
    [
        ((3.5, 0.0), True, {3}),
        ((0.0, 0.5), True, set()),
        ((3.5, 0.0), False, {3}),
        ((0.0, 0.5), False, {2}),
    ],
)
def test_in_a_team_bodies_hide_how_the_gvg_goes_on_at_its_ends_but_do_not_lead_it(
    place: tuple[float, float], doubted: set[int], *, in_team: bool
) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    pipeline.traffic.company = [] if in_team else None
    pipeline.traffic.newcomers.company = [(np.array(place), 0.2)]
    nothing = np.empty((0, 2))
    found = pipeline.sight._doubted(STREET, nothing, cKDTree(nothing))
    assert found == doubted


WALL_M = 3.2  # east of the middle of the street


@pytest.mark.parametrize(
    ("place", "is_lost", "is_walled", "doubted"),
    [
        ((3.5, 0.0), True, False, {3}),
        ((3.5, 0.0), True, True, set()),
        ((3.5, 0.0), False, True, set()),
        ((2.9, 0.4), True, True, {3}),
        ((0.0, 0.5), True, False, set()),
        ((9.0, 0.0), True, False, set()),
    ],
)
def test_an_end_by_somebody_who_may_go_is_none_for_certain_unless_he_is_behind_its_wall(
    place: tuple[float, float], doubted: set[int], *, is_lost: bool, is_walled: bool
) -> None:
    """Out of sight for long, or seen to stand there."""
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    body = Newcomer(np.array(place), 0.2, 0.0, 5.0, came=False, is_whole=True)
    body.evidence, body.is_lost = 100.0, is_lost
    pipeline.traffic.newcomers._all = [body]
    across = np.arange(-2.0, 2.01, 0.05) if is_walled else np.empty(0)
    wall = cKDTree(np.column_stack([np.full(len(across), WALL_M), across]))
    assert pipeline.sight._doubted(STREET, np.empty((0, 2)), wall) == doubted
