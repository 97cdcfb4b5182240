"""Who else is about: people, and the other robots of a team, as they are seen and as they tell.

They are kept out of the map, and given room.
"""

import math
from functools import partial

import numpy as np

from gvgbot.autonomy.control import company
from gvgbot.autonomy.control.company import BodiesSeen, Companion
from gvgbot.autonomy.control.detour import led_round
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.knowledge import Knowledge
from gvgbot.autonomy.newcomers import Newcomers, NewcomersConfig, is_near
from gvgbot.autonomy.on_bodies import Disc, is_seen_through
from gvgbot.autonomy.passed import Passed
from gvgbot.autonomy.views import View
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Scan

_MOST_PASSED = 100  # places, the latest ones
_ROUND_M = 2.5  # a body farther away is elsewhere when the robot is there
_ABOUT_M = 3.0  # so near, another robot may soon want to be where this one is
_ELSEWHERE_M = 0.15  # by which another robot may be elsewhere than it says


class Traffic:
    """People and other robots. `map_in_local` is the pose of the map frame in the local one."""

    def __init__(self, config: NewcomersConfig) -> None:
        self.newcomers = Newcomers(config)
        self.passed: list[Passed] = []
        self.lasting: list[Array] = []  # where bodies proved to be of the building, map frame
        # other robots as they tell of themselves, map frame; None if there are surely none
        self.company: list[Companion] | None = None
        self._left: set[str] = set()  # of them, who fell silent and stands there no more
        self.strangers: list[float] = []  # radii of others that may be anywhere, m
        self.seen: BodiesSeen | None = None  # what may be robots of a team, in the last look

    @property
    def is_in_team(self) -> bool:
        """Whether there may be other robots."""
        return self.company is not None

    def is_somebody_about(self, map_base: Pose) -> bool:
        """Whether another robot is near to where this one is, or may be."""
        return bool(self.strangers) or any(
            one.pose.distance(map_base) < _ABOUT_M for one in self.present
        )

    @property
    def present(self) -> list[Companion]:
        """The company without those that were carried away when they had fallen silent."""
        return [one for one in self.company or () if one.name not in self._left]

    @property
    def standing(self) -> Array:
        """Rims (N, 2) of who stands in the way for a while; in a team all drive about."""
        return np.empty((0, 2)) if self.is_in_team else self.newcomers.points

    @property
    def in_the_way(self) -> Array:
        """Rims (N, 2) of what stands in the way, seen or not."""
        return np.concatenate([self.standing, self.newcomers.lost])

    def nearby(self, map_in_local: Pose) -> list[Companion]:
        """Other robots, where they say that they are, or are seen close to that; local frame."""
        return [self._as_seen(company.moved(one, map_in_local)) for one in self.present]

    def _as_seen(self, one: Companion) -> Companion:
        """The companion, and what it drives along, where a body is seen close to it.

        A map that is laid on the own one rightly may be so a third of a metre aside: two robots
        side by side would be in each other's way for ever, where neither sees anybody.
        """
        place = one.pose.position
        aside = [centre - place for centre, _ in self.newcomers.latest]
        x, y = min(aside, key=lambda d: float(np.hypot(*d)), default=(math.inf, 0.0))
        if math.hypot(x, y) > one.radius + _ELSEWHERE_M:
            return one
        return company.moved(one, Pose(float(x), float(y)))

    def glance(self, scan: Scan, local_base: Pose) -> None:
        """Look out for other robots between two looks: they move."""
        if self.is_in_team:
            self.newcomers.glance(scan, local_base)

    def sift(
        self,
        scan: Scan,
        local_base: Pose,
        known: Knowledge,
        walls: LocalMap,
        keyframe: int,
    ) -> Scan:
        """The scan without what may be people or robots, which are remembered; see `Newcomers`.

        `keyframe` is the number of the present look.
        """
        newcomers, map_in_local = self.newcomers, known.map_in_local(local_base)
        newcomers.in_team, newcomers.strangers = self.is_in_team, self.strangers
        newcomers.company = _discs(self.nearby(map_in_local), _ELSEWHERE_M)
        newcomers.lasting = map_in_local.transform(np.array(self.lasting).reshape(-1, 2))
        whole = scan
        scan = newcomers.sift(scan, local_base, walls, partial(known.is_way, local_base))
        self._note_left(whole, local_base, map_in_local)
        self._note_lasting(map_in_local.inverse())
        missed = [Passed(keyframe, one.centre, one.radius) for one in newcomers.missed]
        self.passed = (self.passed + missed)[-_MOST_PASSED:]
        if self.is_in_team:
            self.seen = self._bodies_seen(scan.stamp, local_base, known.belief.map_base)
        return scan

    def _note_left(self, scan: Scan, local_base: Pose, map_in_local: Pose) -> None:
        """Find out who stands no more where it fell silent; who is heard again is there again."""
        silent = {one.name for one in self.company or () if one.is_silent}
        self._left &= silent
        for one in self.nearby(map_in_local):
            disc = one.pose.position, one.radius
            if one.name in silent and is_seen_through(scan, local_base, disc):
                self._left.add(one.name)

    def _note_lasting(self, map_local: Pose) -> None:
        """Keep in mind what has been let in, as long as it is not seen to be gone."""
        gone = [map_local.transform(one.centre) for one in self.newcomers.gone]
        self.lasting = [place for place in self.lasting if not is_near(place, gone)]
        for one in self.newcomers.let_in:
            place = map_local.transform(one.centre)
            if not is_near(place, self.lasting):
                self.lasting = [*self.lasting, place][-_MOST_PASSED:]

    def _bodies_seen(self, stamp: float, local_base: Pose, map_base: Pose) -> BodiesSeen:
        """The round bodies of the last look, map frame."""
        bodies = self.newcomers.bodies.copy()
        bodies[:, :2] = map_base.compose(local_base.inverse()).transform(bodies[:, :2])
        return BodiesSeen(stamp, map_base, bodies)

    def led_round(
        self, track: Track, view: View, map_in_local: Pose, radius: float, margin: float
    ) -> Track:
        """The track led round bodies near by, or to where one sees how it goes on behind them."""
        seen = self.newcomers.discs
        told = [
            (centre, wide)
            for centre, wide in _discs(self.nearby(map_in_local), 0.0)
            if not any(math.dist(centre, c) < r + _ELSEWHERE_M for c, r in seen)
        ]
        base = view.local_base.position
        bodies = [one for one in seen + told if math.dist(one[0], base) < _ROUND_M]
        is_hidden = view.is_end_doubted(track.polyline[-1])
        return led_round(track, bodies, view, radius, margin, is_hidden=is_hidden)

    def careful(
        self, twist: Twist, local_base: Pose, map_in_local: Pose, radius: float, slow: float
    ) -> Twist:
        """The twist, slow enough to stop with room for somebody ahead who comes as fast.

        `local_base` is where the robot is now; slower than `slow`, m/s, it had better stand.
        """
        base_local = local_base.inverse()
        others = _discs(self.nearby(map_in_local), 0.0) + self.newcomers.latest
        discs = [(base_local.transform(centre), wide) for centre, wide in others]
        return company.careful(twist, discs, radius, slow)


def _discs(nearby: list[Companion], more: float) -> list[Disc]:
    """Other robots by centre and radius, so much wider than they are, m."""
    return [(one.pose.position, one.radius + more) for one in nearby]
