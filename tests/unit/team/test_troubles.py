import math

import numpy as np
import pytest

from gvgbot.team.troubles import Troubles, TroublesConfig

CONFIG = TroublesConfig(silent_s=60.0, late_s=30.0, breaks_down=True, within_s=200.0)
TIMES = np.arange(0.0, 300.0, 1.0).tolist()


@pytest.mark.parametrize("count", [2, 4, 8])
@pytest.mark.parametrize("seed", range(5))
def test_one_robot_is_cut_off_once_for_as_long_as_configured(count: int, seed: int) -> None:
    troubles = Troubles(CONFIG, count, seed)
    silent = [[t for t in TIMES if troubles.is_silent(robot, t)] for robot in range(count)]
    lengths = sorted(len(times) for times in silent)
    assert lengths == [0] * (count - 1) + [60]
    (times,) = (times for times in silent if times)
    assert times[-1] - times[0] == 59.0
    assert times[0] <= 200.0


def test_one_robot_is_late_and_one_breaks_down() -> None:
    troubles = Troubles(CONFIG, 4, seed=1)
    assert sorted(troubles.sets_out_s(robot) for robot in range(4)) == [0.0, 0.0, 0.0, 30.0]
    breakdowns = sorted(troubles.breaks_down_s(robot) for robot in range(4))
    assert breakdowns[0] <= 200.0
    assert breakdowns[1:] == [math.inf] * 3


def test_equal_seeds_bring_equal_troubles_and_others_do_not() -> None:
    def drawn(seed: int) -> list[float]:
        troubles = Troubles(CONFIG, 4, seed)
        return [troubles.breaks_down_s(robot) for robot in range(4)]

    assert drawn(1) == drawn(1)
    assert len({tuple(drawn(seed)) for seed in range(8)}) == 8


def test_without_configured_troubles_there_are_none() -> None:
    troubles = Troubles(TroublesConfig(), 4, seed=1)
    for robot in range(4):
        assert not any(troubles.is_silent(robot, t) for t in TIMES)
        assert troubles.sets_out_s(robot) == 0.0
        assert troubles.breaks_down_s(robot) == math.inf
