"""Another robot of the team, as it was last heard and seen."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from gvgbot.autonomy.control.company import BodiesSeen
from gvgbot.geometry import Array, Pose
from gvgbot.team.alignment import Alignment
from gvgbot.team.chart import Chart
from gvgbot.team.encounter import WINDOW_S
from gvgbot.team.news import Claim, Course, News

_STANDING_M = 0.1  # moved less from news to news, a robot stands
_RESTS_S = 30.0  # who stands for so long, and is on its way to nothing, finds no more
_HELD_S = 120.0  # who stands for so long on its way does not get there: a device may be away
_SAME_M, _SAME_RAD = 0.5, 0.1  # frames nearer to each other are the same


@dataclass(slots=True, eq=False)
class Mate:
    """Another robot, as it was last heard."""

    news: News
    chart: Chart
    heard: float  # stamp of the own clock
    map_base: Pose  # in its own map
    told_at: Pose  # the same, by the news
    seen: float  # stamp of that
    moved: float  # stamp of the news by which it was elsewhere before
    course: Array = field(default_factory=lambda: np.empty((0, 2)))
    courses: int = 0  # the number of the newest
    steered: float = float("-inf")  # stamp of the own clock when that was heard
    alignment: Alignment | None = None
    tried: float = float("-inf")  # stamp of the last attempt to align
    sizes: tuple[int, ...] = ()  # of both charts then
    looks: deque[BodiesSeen] = field(default_factory=deque)  # lately; stamps of the own clock
    recognised: float = float("-inf")  # stamp of the last attempt to
    by_sight: Alignment | None = None  # how its frame lies by that; to be compared with the maps
    # when, and how, its frame seemed to lie by sight, though maps or a known frame spoke against it
    doubted: tuple[float, Pose] | None = None

    @property
    def stands(self) -> float:
        """For how long it has stood, s, when it was last heard."""
        return self.heard - self.moved

    @property
    def is_busy(self) -> bool:
        """Whether it has something to do."""
        rests = self.claim is None and self.stands > _RESTS_S
        return not (self.news.finished or self.news.idle or rests)

    @property
    def claim(self) -> Claim | None:
        """What it is on its way to, unless something holds it: others need not wait for that."""
        return None if self.stands > _HELD_S else self.news.claim

    def learn(self, news: News, stamp: float) -> None:
        """Take in what it tells now."""
        self.news, self.chart, self.heard = news, news.chart, stamp
        before, self.map_base, self.seen = self.told_at, Pose(*news.pose), stamp
        self.told_at = self.map_base
        if before.distance(self.map_base) >= _STANDING_M:
            self.moved = stamp

    def follow(self, course: Course, stamp: float) -> None:
        """Take in where it is and drives, and what it has seen last."""
        self.courses, self.seen = course.sequence, stamp
        self.steered = stamp
        self.map_base, self.course = Pose(*course.pose), course.points
        if course.look is not None:
            bodies = np.array(course.look.bodies).reshape(-1, 3)
            pose = Pose(*course.look.pose)
            remember(self.looks, BodiesSeen(stamp - course.look.age, pose, bodies))

    def is_seen_again(self, pose: Pose, stamp: float) -> bool:
        """Whether sight has laid its frame so before, by other looks: no chance twice."""
        before = self.doubted
        if before is not None and stamp - before[0] <= WINDOW_S:
            return False
        is_again = before is not None and is_same_frame(pose, before[1], self.map_base)
        self.doubted = None if is_again else (stamp, pose)
        return is_again


def is_same_frame(pose: Pose, other: Pose, place: Pose) -> bool:
    """Whether two frames lay a place of the other robot's map at the same place of the own one."""
    return pose.compose(place).is_near(other.compose(place), _SAME_M, _SAME_RAD)


def remember(looks: deque[BodiesSeen], seen: BodiesSeen) -> None:
    """Add a look, and forget those of long before."""
    looks.append(seen)
    while looks[0].stamp < seen.stamp - WINDOW_S:
        looks.popleft()
