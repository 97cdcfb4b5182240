"""One robot of a team: what it tells the others, what it has heard of them, and where they are.

Its filter and its graph hold only what it has measured itself. What the others have found decides
which frontier is its own: see `auction`.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.control import company
from gvgbot.autonomy.control.company import BodiesSeen, Companion
from gvgbot.geometry import Array, Pose
from gvgbot.ranges import Range
from gvgbot.team.alignment import Alignment, align, refined
from gvgbot.team.auction import Auction
from gvgbot.team.chart import Chart
from gvgbot.team.encounter import WINDOW_S, frame_of
from gvgbot.team.mate import Mate, is_same_frame, remember
from gvgbot.team.news import (
    MOST_MATES,
    Claim,
    Course,
    Frame,
    News,
    ToldLook,
    told_edges,
    told_vertices,
    told_ways,
)

_FRESH_S = 1.0  # a robot that drives is no longer where it was told to be before
_SPARSE = 4  # every so manieth point of a track is told
_RECOGNISE_S = 1.0  # between two attempts to recognise a robot by how it moves
_SURE_BY_SIGHT = 0.999  # that the robot met is the one that says so
_KNOWN_M = 0.4  # from where a robot says it is, a body is that robot


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamConfig:
    """Exploring together with other robots."""

    enabled: bool = False  # true: tell the others, and listen to them
    tell_every_s: Annotated[float, Range(0.2, 60.0)] = 2.0  # of one's own map
    align_every_s: Annotated[float, Range(1.0, 600.0)] = (
        15.0  # laying the maps of two on each other
    )
    steer_every_s: Annotated[float, Range(0.05, 2.0)] = 0.2  # of where one is and drives
    # silence after which a robot counts as lost; what it was about to do is free for others
    lost_after_s: Annotated[float, Range(1.0, 600.0)] = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Two charts that are to be laid on each other, and how they lay before."""

    robot: str
    life: int
    ours: Chart
    theirs: Chart
    before: Alignment | None
    by_sight: Alignment | None = None  # how they lie by what either robot has seen of the other

    def made(self) -> Alignment | None:
        """How they lie; None if that is not certain, or not any more."""
        about = self.by_sight or self.before
        if about is None:
            return align(self.ours, self.theirs)
        return refined(self.ours, self.theirs, about)


@dataclass(frozen=True, slots=True, eq=False)
class Met:
    """Another robot's map was laid onto the own one."""

    robot: str
    alignment: Alignment


class Member:
    """Takes part in a team: tells the others, listens to them, and lays their maps on its own."""

    def __init__(
        self,
        name: str,
        config: TeamConfig,
        tell: Callable[[], Chart],
        *,
        radius: float,
        life: int = 0,
    ) -> None:
        """`tell` makes the own chart; `radius` is that of the own body, m."""
        self.name, self._config, self._radius, self._life = name, config, radius, life
        self._own_chart = tell
        self._chart = Chart()
        self._mates: dict[str, Mate] = {}
        self.auction = Auction(name, tell, self)
        self._stamp = 0.0
        self._sequence = self._courses = 0
        self._looks: deque[BodiesSeen] = deque()  # lately
        self.met: list[Met] = []  # lately; whoever tells of it takes it out

    # -- what is told and heard --------------------------------------------------------------------

    def news(
        self, stamp: float, map_base: Pose, *, finished: bool, on_errand: bool = False
    ) -> News:
        """What to tell the others now; on an errand, one leaves all frontiers to them."""
        self._stamp = stamp
        self._chart = self._own_chart()
        self.auction.renew()
        self._sequence += 1
        if finished or on_errand:
            self.auction.withdraw()
        frames = tuple(
            Frame(name, self._mates[name].news.life, (pose.x, pose.y, pose.theta))
            for name, pose in sorted(self._direct().items())
        )
        return News(
            robot=self.name,
            life=self._life,
            sequence=self._sequence,
            pose=(map_base.x, map_base.y, map_base.theta),
            radius=self._radius,
            claim=self.auction.claim,
            finished=finished,
            idle=self.auction.is_idle or on_errand,
            frames=frames,
            vertices=told_vertices(self._chart),
            edges=told_edges(self._chart),
            ways=told_ways(self._chart),
        )

    def course(
        self, stamp: float, map_base: Pose, track: Array, seen: BodiesSeen | None = None
    ) -> Course:
        """What to tell the others in between: where one is, and what one drives along (N, 2).

        `seen` is what was seen last.
        """
        self._stamp = stamp
        self._courses += 1
        look = None
        told = self._looks[-1].stamp if self._looks else -math.inf
        if seen is not None and seen.stamp > max(told, stamp - WINDOW_S):
            seen = replace(seen, bodies=seen.bodies[~self._are_known(seen.bodies[:, :2])])
            remember(self._looks, seen)
            pose, bodies = seen.map_base, tuple((x, y, r) for x, y, r in seen.bodies.tolist())
            look = ToldLook(max(0.0, stamp - seen.stamp), (pose.x, pose.y, pose.theta), bodies)
        return Course(
            robot=self.name,
            life=self._life,
            sequence=self._courses,
            pose=(map_base.x, map_base.y, map_base.theta),
            line=track[::_SPARSE].astype("<f4").tobytes(),
            look=look,
        )

    def _are_known(self, centres: Array) -> NDArray[np.bool_]:
        """Which bodies, by their centres (N, 2), are robots whose place is known: nobody else."""
        known = np.zeros(len(centres), np.bool_)
        for one in self.company():
            known |= np.hypot(*(centres - one.pose.position).T) < _KNOWN_M
        return known

    def hear(self, told: News | Course, stamp: float) -> None:
        """Take in what another one tells."""
        self._stamp = max(self._stamp, stamp)
        if told.robot == self.name:
            return
        if isinstance(told, Course):
            self._follow(told, stamp)
        else:
            self._learn(told, stamp)

    def _follow(self, course: Course, stamp: float) -> None:
        mate = self._mates.get(course.robot)
        if mate is None or mate.news.life != course.life:
            return
        if course.sequence <= mate.courses and not self._is_long_ago(mate.steered):
            return
        mate.follow(course, stamp)
        if course.look is not None:
            self._recognise(course.robot, mate, stamp)

    def _recognise(self, name: str, mate: Mate, stamp: float) -> None:
        """Find out whether a body that is seen is another robot, and elsewhere than was believed.

        Whose frame is known right is seen where it is said to be, and is no body to be recognised.
        """
        if stamp - mate.recognised < _RECOGNISE_S:
            return
        mate.recognised = stamp
        found = frame_of(self._looks, mate.looks, self._radius, mate.news.radius)
        if found is None:
            return
        by_sight = Alignment(*found, (), _SURE_BY_SIGHT)
        if mate.alignment is None or self._is_elsewhere(name, mate, by_sight):
            mate.by_sight = by_sight

    def _is_elsewhere(self, name: str, mate: Mate, by_sight: Alignment) -> bool:
        told = self.frames.get(name)
        return told is not None and not is_same_frame(by_sight.pose, told, mate.map_base)

    def _settle_by_sight(
        self, name: str, mate: Mate, by_sight: Alignment, alignment: Alignment | None
    ) -> None:
        """Believe what was seen, if maps bear it out as `alignment`, or it is seen again."""
        if alignment is None or self._is_elsewhere(name, mate, by_sight):
            if not mate.is_seen_again(by_sight.pose, self._stamp):
                return  # a third robot may have moved in the same way
            if alignment is None and name not in self.frames:
                alignment = replace(by_sight, by_sight=True)
            elif alignment is None and (mate.alignment is None or mate.alignment.pairs):
                return  # maps bear out what was known, or are not known to
            mate.alignment = None  # either of the two is wrong
        self._lay(name, mate, alignment)

    def _learn(self, news: News, stamp: float) -> None:
        mate = self._mates.get(news.robot)
        if mate is None and not self._has_room():
            return
        if mate is None or mate.news.life != news.life:
            there, before = Pose(*news.pose), mate
            mate = Mate(news, news.chart, stamp, there, there, stamp, stamp)
            if before is not None:  # which may be another robot by this name, and still be there
                mate.tried = before.tried
            self._mates[news.robot] = mate
        elif news.sequence > mate.news.sequence or self.is_lost(news.robot):
            mate.learn(news, stamp)
        self.auction.renew()

    def _has_room(self) -> bool:
        """Whether one more robot can be known; forgets those that were of no use and are lost."""
        if len(self._mates) >= MOST_MATES:
            frames = self.frames
            for name in [n for n in self._mates if self.is_lost(n) and n not in frames]:
                del self._mates[name]
        return len(self._mates) < MOST_MATES

    def look(self, stamp: float, *, at_last: bool = False) -> None:
        """Try to lay the maps of others onto the own one, where that is due."""
        for comparison in self.due(stamp, at_last=at_last):
            self.settle(comparison, comparison.made())

    def due(self, stamp: float, *, at_last: bool = False) -> list["Comparison"]:
        """Which maps are to be laid on the own one now: long work that may be done elsewhere.

        `at_last` all are, by what is known in the end, whenever they were before.
        """
        self._stamp = max(self._stamp, stamp)
        found = []
        for name, mate in sorted(self._mates.items()):
            sizes = tuple(
                len(part)
                for chart in (self._chart, mate.chart)
                for part in (chart.vertices, chart.edges)
            )
            by_sight, mate.by_sight = mate.by_sight, None
            if by_sight is None:
                is_early = stamp - mate.tried < self._config.align_every_s
                if not at_last and (is_early or sizes == mate.sizes):
                    continue
                mate.tried, mate.sizes = stamp, sizes
            life, before = mate.news.life, mate.alignment
            found.append(Comparison(name, life, self._chart, mate.chart, before, by_sight))
        return found

    def settle(self, comparison: "Comparison", alignment: Alignment | None) -> None:
        """Take in what a comparison has shown, unless the other has begun anew meanwhile."""
        name = comparison.robot
        mate = self._mates.get(name)
        if mate is None or mate.news.life != comparison.life:
            return
        if comparison.by_sight is None:
            self._lay(name, mate, alignment)
        else:
            self._settle_by_sight(name, mate, comparison.by_sight, alignment)

    def _lay(self, name: str, mate: Mate, alignment: Alignment | None) -> None:
        if alignment is not None and mate.alignment is None:
            self.met.append(Met(name, alignment))
        mate.alignment = alignment
        self.auction.renew()

    def _direct(self) -> dict[str, Pose]:
        """Poses of the frames that were found, in the own one."""
        return {
            name: mate.alignment.pose
            for name, mate in self._mates.items()
            if mate.alignment is not None
        }

    @property
    def frames(self) -> dict[str, Pose]:
        """Poses of all known frames in the own one: found, or told by others that are known.

        Either of two robots may have found how their frames lie.
        """
        known = {self.name: Pose()} | self._direct()
        links, waiting = self._links(), list(known)
        while waiting:
            here = waiting.pop(0)
            for one, other, pose in links:
                if one == here and other not in known:
                    known[other] = known[one].compose(pose)
                    waiting.append(other)
                elif other == here and one not in known:
                    known[one] = known[other].compose(pose.inverse())
                    waiting.append(one)
        del known[self.name]
        return known

    def _links(self) -> list[tuple[str, str, Pose]]:
        """Robots, others whose frame they have found, and its pose in theirs."""
        lives = {name: mate.news.life for name, mate in self._mates.items()}
        lives[self.name] = self._life
        return [
            (name, frame.robot, Pose(*frame.pose))
            for name, mate in sorted(self._mates.items())
            for frame in mate.news.frames
            if lives.get(frame.robot) == frame.life
        ]

    def chart(self, name: str) -> Chart:
        """What another one has told of its map, in its own frame."""
        return self._mates[name].chart

    @property
    def charts(self) -> dict[str, tuple[Chart, Pose]]:
        """The charts of all whose frame is known, and the pose of that frame in the own one."""
        frames = sorted(self.frames.items())
        return {name: (self._mates[name].chart, pose) for name, pose in frames}

    def is_lost(self, name: str) -> bool:
        """Whether nothing has been heard of a robot for long."""
        return self._is_long_ago(self._mates[name].heard)

    def _is_long_ago(self, heard: float) -> bool:
        """Whether what was heard then is no measure any more of what is old and what is new.

        So a number that somebody else told in a robot's name silences it for a while only.
        """
        return self._stamp - heard > self._config.lost_after_s

    def others(self) -> dict[str, Pose]:
        """Where the others are, own map frame, if that is known: who has finished stays there."""
        return {
            name: pose.compose(self._mates[name].map_base)
            for name, pose in self.frames.items()
            if not self.is_lost(name) or self._mates[name].news.finished
        }

    def company(self) -> list[Companion]:
        """The others whose place is known now, own map frame; by their names, the first one goes.

        Who was on the way when it was last heard is left out after a moment: it is elsewhere.
        """
        frames, found = self.frames, []
        for name in sorted(self.others()):
            mate = self._mates[name]
            is_fresh = self._stamp - mate.seen <= _FRESH_S
            if is_fresh or mate.stands > 0.0 or mate.news.finished:
                first, radius, is_lost = name < self.name, mate.news.radius, self.is_lost(name)
                one = Companion(
                    name, mate.map_base, first, mate.course, radius=radius, is_silent=is_lost
                )
                found.append(company.moved(one, frames[name]))
        return found

    def strangers(self) -> list[float]:
        """The radii, m, of robots that are heard, and may be anywhere."""
        known = self.frames
        heard = [mate for name, mate in self._mates.items() if not self.is_lost(name)]
        return [mate.news.radius for mate in heard if mate.news.robot not in known]

    # -- what the auction of frontiers must know ---------------------------------------------------

    def claims(self) -> list[tuple[str, Claim]]:
        """What others are on their way to, own map frame."""
        found = []
        for name, pose in sorted(self.frames.items()):
            claim = self._mates[name].claim
            if claim is None or self.is_lost(name):
                continue
            there = pose.compose(Pose(claim.x, claim.y, claim.bearing))
            found.append((name, Claim(there.x, there.y, there.theta, claim.metres)))
        return found

    @property
    def may_find_more(self) -> bool:
        """Whether one of the others has something to do."""
        return any(self._mates[name].is_busy for name in self.others())
