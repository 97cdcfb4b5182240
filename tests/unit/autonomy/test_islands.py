"""What one look of a robot that turns says of somebody who stands in the room."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.islands import islands
from gvgbot.autonomy.roundness import SURE
from gvgbot.geometry import Pose
from gvgbot.hal.deskew import deskewed
from gvgbot.hal.messages import Scan

BEAMS, INCREMENT = 681, math.tau / 1024  # of a URG-04LX
WALL_M, BODY_M = 4.0, 0.2  # a round room, and the radius of a body
LOOKS = 100


def look(away: float, sigma: float, turn: float, rng: np.random.Generator) -> Scan:
    """A sweep in the middle of the room, of a base that turns by so much (rad) meanwhile."""
    share = np.arange(BEAMS) / BEAMS
    bearings = (np.arange(BEAMS) - BEAMS / 2) * INCREMENT + share * turn
    along, aside = away * np.cos(bearings), away * np.sin(bearings)
    deep = BODY_M**2 - aside**2
    is_hit = (deep > 0.0) & (along > 0.0)
    ranges = np.where(is_hit, along - np.sqrt(np.maximum(deep, 0.0)), WALL_M)
    ranges += rng.normal(0.0, sigma, BEAMS)
    return Scan(0.0, ranges, -BEAMS / 2 * INCREMENT, INCREMENT, 0.02, 5.6)


def evidence(scan: Scan, away: float) -> float:
    """How much what is seen so far ahead is a body; 0 if nothing is told of it."""
    here = [one for one in islands(scan, Pose()) if math.dist(one.centre, (away, 0.0)) < BODY_M]
    return here[0].evidence if here else 0.0


@pytest.mark.parametrize("turn", [0.0, 0.06, -0.06])
@pytest.mark.parametrize("away", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("sigma", [0.01, 0.03])
def test_a_body_is_hardly_ever_taken_for_a_piece_of_furniture(
    sigma: float, away: float, turn: float
) -> None:
    """Evidence below -SURE stands for odds of twenty to one, and should be as rare."""
    rng = np.random.default_rng(3)
    told = [
        evidence(deskewed(look(away, sigma, turn, rng), Pose(0.0, 0.0, turn)), away)
        for _ in range(LOOKS)
    ]
    assert sum(look < -SURE for look in told) <= 0.05 * LOOKS
    assert sum(look > 0.0 for look in told) > 0.6 * LOOKS
