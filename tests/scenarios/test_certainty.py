"""Going back to what is known: the robot does it, goes on exploring, and ends."""

import pytest

from gvgbot.autonomy.events import Decision, ErrandEnded
from gvgbot.autonomy.exploration.certainty import CertaintyConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.geometry import Pose
from tests.scenarios.rig import assert_explored, play
from tests.unit.autonomy.sights import carved

pytestmark = [pytest.mark.slow, pytest.mark.twin]

BLOCKS = [(x, -0.8, x + 1.6, 0.8) for x in (-2.2, 0.6)]
TOWN = carved([(-3.4, -2.0, 3.4, 2.0)], BLOCKS)  # two blocks side by side


def test_the_robot_visits_places_between_and_says_that_its_goal_is_out_of_reach() -> None:
    certainty = CertaintyConfig(p_explore=0.5, vertex_sigma_m=0.001)
    run = play(TOWN, Pose(0.0, -1.4, 0.1), exploration=ExplorationConfig(certainty=certainty))
    assert_explored(run)
    decisions = [e for e in run.events if isinstance(e, Decision)]
    visits = [e for e in decisions if "place is uncertain" in e.reason]
    goals = {f"goto {visit.vertex}" for visit in visits}  # a last look at the walls is none
    ended = [e for e in run.events if isinstance(e, ErrandEnded) and e.errand in goals]
    explores = [e.stamp for e in decisions if "frontier" in e.reason]
    assert visits[0].stamp < explores[-1]
    assert [e.outcome for e in ended] == ["arrived"] * len(visits)
    assert "less certain than wanted" in run.pipeline.mission.reason
    assert run.contacts == 0
