"""What a robot still believes of another one, which has begun anew or was met meanwhile."""

from collections import deque

import msgspec
import numpy as np
import pytest

from gvgbot.autonomy.control.company import BodiesSeen
from gvgbot.geometry import Pose
from gvgbot.team.alignment import Alignment
from gvgbot.team.chart import Chart
from gvgbot.team.encounter import WINDOW_S
from gvgbot.team.mate import remember
from gvgbot.team.member import Comparison, Member, TeamConfig
from gvgbot.team.news import MOST_MATES, Course, News

TOLD = News(
    robot="two",
    life=1,
    sequence=1,
    pose=(1.0, 2.0, 0.0),
    radius=0.2,
    claim=None,
    finished=False,
    frames=(),
    vertices=(),
    edges=(),
)


def laid(pose: Pose) -> Alignment:
    return Alignment(pose, np.eye(3), (), 1.0)


@pytest.fixture
def one() -> Member:
    """A robot that has heard another one."""
    member = Member("one", TeamConfig(), Chart, radius=0.2)
    member.hear(TOLD, 0.0)
    return member


def test_the_last_word_of_an_earlier_life_moves_nobody(one: Member) -> None:
    one.settle(Comparison("two", 1, Chart(), Chart(), None), laid(Pose()))
    course = Course(robot="two", life=0, sequence=9, pose=(8.0, 8.0, 0.0), line=b"")
    one.hear(course, 0.1)
    assert one.others() == {"two": Pose(1.0, 2.0)}
    one.hear(msgspec.structs.replace(course, life=1), 0.2)
    assert one.others() == {"two": Pose(8.0, 8.0)}


def test_what_a_comparison_shows_is_void_once_the_other_has_begun_anew(one: Member) -> None:
    comparison = Comparison("two", 1, Chart(), Chart(), None)
    one.hear(msgspec.structs.replace(TOLD, life=2), 1.0)
    one.settle(comparison, laid(Pose(3.0)))
    assert one.frames == {}


def test_what_was_seen_long_ago_is_forgotten() -> None:
    """Either map may have been bent since."""
    looks = deque[BodiesSeen]()
    for stamp in np.arange(100.0):
        remember(looks, BodiesSeen(float(stamp), Pose(), np.empty((0, 3))))
    assert [look.stamp for look in looks] == list(np.arange(99.0 - WINDOW_S, 100.0))


def test_what_a_lost_robot_has_found_outlasts_a_crowd_of_names(one: Member) -> None:
    one.settle(Comparison("two", 1, Chart(), Chart(), None), laid(Pose(3.0)))
    for number in range(2 * MOST_MATES):
        one.hear(msgspec.structs.replace(TOLD, robot=f"n{number}"), 100.0 + 30.0 * number)
    assert one.is_lost("two")
    assert one.frames == {"two": Pose(3.0)}


def test_who_bears_the_own_name_is_not_believed(one: Member) -> None:
    one.hear(msgspec.structs.replace(TOLD, robot="one", life=5, radius=0.3), 0.1)
    assert one.strangers() == [0.2]  # of the other one alone


def test_two_by_one_name_cost_no_more_comparisons_than_one(one: Member) -> None:
    """Each word of either is of another life than the one before; a comparison takes seconds."""
    compared = 0
    for number in range(60):
        one.hear(msgspec.structs.replace(TOLD, life=number % 2, sequence=number), 2.0 * number)
        compared += len(one.due(2.0 * number))
    assert 1 <= compared <= 1 + 120.0 / TeamConfig().align_every_s
