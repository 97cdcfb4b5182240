"""What to do at the end of a path, drawn by hand."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.control.orders import Drive, LookAround
from gvgbot.autonomy.exploration.access import Access
from gvgbot.autonomy.exploration.headway import Headway
from gvgbot.autonomy.exploration.hindrance import Hindrance
from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.neighbours import Neighbours
from gvgbot.autonomy.path_following import PathFollowing
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.slam.graph import GvgGraph
from gvgbot.autonomy.views import Correspondence, View, touching
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn

CORRIDOR = drawn({1: (0.0, 0.0), 2: (6.0, 0.0)}, {10: (1, 2, [])})


@pytest.mark.parametrize(
    ("doubtful", "turn"),
    [((6.6, 0.0), None), ((5.4, 0.6), 0.75 * math.pi), ((6.0, -0.8), 1.5 * math.pi)],
)
def test_at_the_end_it_turns_to_what_may_go_unless_it_looks_there(
    doubtful: tuple[float, float], turn: float | None
) -> None:
    """What is behind the robot would never be seen to go."""
    pose, point = Pose(6.0, 0.0, 0.0), np.array([doubtful])
    doubted = touching(CORRIDOR, point)
    walls = LocalMap(LocalMapConfig())
    view = View(0, 0.0, 0.0, pose, CORRIDOR, walls, doubtful=point, doubted=doubted)
    place = CORRIDOR.place(pose.position)
    assert place is not None
    here = Situation(
        CORRIDOR, Correspondence(), GvgGraph(), Whereabouts(), Access(place), pose, doubted
    )
    following = PathFollowing(Neighbours(), Hindrance(), Headway())
    order, _ = following.follow(view, here, (Branch(10, forward=True),), 3.0, looks_anew=False)
    if turn is None:
        assert isinstance(order, Drive)
    else:
        assert isinstance(order, LookAround)
        assert order.angle == pytest.approx(turn)
