"""What is kept of the way, and what is left out when it becomes long."""

import numpy as np

from gvgbot.autonomy.keyframes import Past, Step
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan

LOOK = Scan(0.0, np.ones(3), -0.1, 0.1, 0.0, 4.0)


def driven(*xs: float) -> Past:
    """Who came to these places on a straight line, as known to 1 cm for each step."""
    past, before = Past(), 0.0
    for x in xs:
        if past.last is not None:
            past.steps.append(Step(Pose(x - before), np.eye(3) * 0.01**2))
        past.keep(LOOK, Pose(x), Pose(x), Pose(x + 10.0))
        before = x
    return past


def test_a_scan_is_kept_where_it_shows_something_new() -> None:
    past = driven(0.0, 0.3, 0.6, 0.8, 1.2, 1.6)
    kept = [keyframe.local_base.x for keyframe in past.keyframes if keyframe.scan is not None]
    assert kept == [0.0, 0.8, 1.6]


def test_of_a_way_that_is_left_out_only_its_end_stays_and_nobody_knows_how_it_came_there() -> None:
    past = driven(0.0, 1.0, 2.0, 3.0, 4.0)
    past.lasting, past.lent = 2, 3
    assert past.leave_out() == 2
    assert [keyframe.map_base.x for keyframe in past.keyframes] == [10.0, 11.0, 14.0]
    assert [step.motion.x for step in past.steps] == [1.0, 3.0]
    assert [step.is_unknown for step in past.steps] == [False, True]
    assert past.lent == 2


def test_old_is_what_lasts_and_was_kept_so_many_metres_ago() -> None:
    past = driven(0.0, 1.0, 2.0, 4.0, 5.0)
    past.lasting = 4
    assert [
        [keyframe.local_base.x for keyframe in past.old(metres)] for metres in (0.5, 2.5, 5.0, 9.0)
    ] == [[0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 2.0], [0.0], []]


def test_a_still_past_does_not_grow() -> None:
    past = driven(0.0, 1.0)
    past.travelled, past.lent_m = 7.0, 3.0
    still = past.still()
    past.keep(LOOK, Pose(2.0), Pose(2.0), Pose(2.0))
    past.steps.append(past.steps[0])
    past.travelled = 9.0
    assert (len(still.keyframes), len(still.steps), still.driven) == (2, 1, 4.0)
