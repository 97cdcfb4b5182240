"""What of the GVG there is to be seen is doubtful, beside who may soon be elsewhere."""

import numpy as np
import pytest

from gvgbot.autonomy.newcomers import Newcomer
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from tests.unit.autonomy.local_graphs import drawn

STREET = drawn({1: (-3.0, 0.0), 2: (0.0, 0.0), 3: (3.0, 0.0)}, {10: (1, 2, []), 11: (2, 3, [])})


@pytest.mark.parametrize(("place", "doubted"), [((3.5, 0.0), {3}), ((0.0, 0.5), set())])
@pytest.mark.parametrize("in_team", [False, True])
def test_in_a_team_the_gvg_may_go_on_behind_a_body_at_its_end(
    place: tuple[float, float], doubted: set[int], *, in_team: bool
) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    pipeline.traffic.company = [] if in_team else None
    pipeline.traffic.newcomers.company = [(np.array(place), 0.2)]
    nothing = np.empty((0, 2))
    assert pipeline.sight._doubted(STREET, nothing) == (doubted if in_team else set())


@pytest.mark.parametrize(
    ("place", "doubted"), [((3.5, 0.0), {3}), ((0.0, 0.5), set()), ((9.0, 0.0), set())]
)
def test_an_end_by_somebody_who_is_out_of_sight_for_long_is_none_for_certain(
    place: tuple[float, float], doubted: set[int]
) -> None:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    body = Newcomer(np.array(place), 0.2, 0.0, 5.0, came=False, is_whole=True)
    body.evidence, body.is_lost = 100.0, True
    pipeline.traffic.newcomers._all = [body]
    assert pipeline.sight._doubted(STREET, np.empty((0, 2))) == doubted
