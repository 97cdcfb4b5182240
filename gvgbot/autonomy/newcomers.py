"""Things that may be people: they stand free, are as wide as people, and go again.

They are kept out of the map, and the planner leads round them, until they have stood for so long
that they must be a part of the building. What depends on them is not believed meanwhile. Even then
they may go, and the map forgets them as soon as that is seen. Who is out of sight is kept in mind,
but stands there anew when seen again at the same place: others pass by.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Annotated

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.islands import Island, islands, slivers, without_fringes
from gvgbot.autonomy.on_bodies import BLUR_M, Disc, end_in, is_seen_through, without
from gvgbot.autonomy.roundness import SURE, body_of, with_look
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

# what is half hidden behind something nearer, or has faces and edges, is only kept waiting so long
_GLIMPSE_S = 3.0
_SHORT_M = 2.0  # of somebody, nothing is certain any more
_NEAR_M = 3.0  # who is farther away is not followed from scan to scan
_GONE_M = 1.0  # between two looks, at most
_MOVED_M = 0.3  # what stands is found again within this
_ALIKE_M = 0.05  # by which a robot may seem wider or slimmer than it says it is
_LATELY_S = 2.0  # after which the last that is seen of somebody is no longer his
_LOST_S = 3.0  # what is out of sight for so long, beyond the time it stood, may have gone
_RIM = np.stack([f(np.arange(12) * np.pi / 6) for f in (np.cos, np.sin)], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewcomersConfig:
    """When something that may be a person is taken for a part of the building."""

    away_from_walls_m: Annotated[float, Range(0.1, 2.0)] = 0.2  # nearer to a wall, it is the wall
    # standing for so long where nobody had looked, it is a part of the building
    found_after_s: Annotated[float, Range(0.0, 600.0)] = 20.0
    # standing for so long where there was nothing before, it is one as well
    came_after_s: Annotated[float, Range(0.0, 3600.0)] = 120.0


@dataclass(slots=True, eq=False)
class Newcomer:
    """A disc in the local frame, since when it has been there, and when it was last seen, s."""

    centre: Array
    radius: float
    first: float
    last: float
    came: bool
    is_whole: bool  # both sides of it have been seen
    is_let_in: bool = False  # it has stood for long enough to be in the map
    was_let_in: bool = False  # or it had, for what was seen of it at first
    was_wall: bool = False  # it was in the map: it is a wall, or somebody seen too little of
    was_round: bool = False  # and then enough: since that first look it is waited for
    evidence: float = 0.0  # that it is round: log-likelihood ratio of the last looks
    is_lost: bool = False  # out of sight for so long that it may have gone
    core: float = math.inf  # m, radius by the slimmest look that showed it to be round

    @property
    def is_round(self) -> bool:
        """Whether so much has been seen of it that the rest is known."""
        return self.evidence > SURE

    @property
    def is_waiting(self) -> bool:
        """Whether it stands there, and is kept out of the map."""
        return not self.is_let_in and not self.is_lost

    def look(self, island: Island, stamp: float) -> None:
        """See it again."""
        if island.is_round and not self.is_round:
            self.centre, self.radius = island.centre, island.radius
        self.last = stamp
        self.radius = max(self.radius, island.radius)
        if island.is_round:
            self.core = min(self.core, island.radius)
        self.is_whole |= island.is_whole
        self.evidence = with_look(self.evidence, island.evidence)


class Newcomers:
    """What has come lately, or been found lately and may go."""

    def __init__(self, config: NewcomersConfig) -> None:
        self._config = config
        self._has_met = False  # somebody who came, and went
        self._all: list[Newcomer] = []
        self.missed: list[Newcomer] = []  # in the last look, of those found that never moved
        self.gone: list[Newcomer] = []  # in the last look
        self.lasting: Array = np.empty((0, 2))  # where bodies have proved to be of the building
        self.in_team = False  # bodies of robots pass by so close that slivers of them are seen
        self.strangers: list[float] = []  # radii of other robots that may be anywhere, m
        self.company: list[Disc] = []  # other robots: where they say they are,
        self._met: list[Disc] = []  # and where they are seen
        self.bodies: Array = np.empty((0, 3))  # in the last look: x, y, radius, m
        self._lately: list[tuple[float, Array]] = []  # when, s, and where somebody was seen
        self._glanced: list[Disc] | None = None  # where those are that move on

    def sift(
        self,
        scan: Scan,
        local_base: Pose,
        local_map: LocalMap,
        is_way: Callable[[Array], bool] = lambda place: False,
    ) -> Scan:
        """The scan without the beams that end on what may be a person.

        `is_way` tells of a place (2,), local frame, whether a way is known to lead over it.
        """
        if not self.longest_patience:  # who comes, stays
            return without(scan, local_base, self.company)
        self._forget(scan, local_base, local_map)
        scan = without_fringes(scan) if self.in_team else scan
        walls = _Walls(local_map, self._config.away_from_walls_m, is_way)
        self._met, seen = [], []
        found = islands(scan, local_base)
        self.bodies = self._bodies(found, local_base.compose(scan.base_laser).position)
        for island in found:
            if self._is_company(island):
                self._met.append((island.centre, island.radius))
            elif self._is_passing(island, scan.stamp, walls):
                seen.append((island.centre, island.radius))
        seen += self._rests(scan, local_base, seen, local_map)
        waiting = [(one.centre, one.radius) for one in self._all if one.is_waiting]
        # At times one is seen in parts only, or has moved a little: both discs count.
        return without(scan, local_base, [*seen, *waiting, *self._met, *self.company])

    def _bodies(self, found: list[Island], eye: Array) -> Array:
        """Bodies (N, 3): round ones, and what is as wide as a robot that may be anywhere."""
        rows = [(*island.centre, island.radius) for island in found if island.is_round]
        unsure = [island for island in found if island.is_whole and not island.is_round]
        for island, radius in product(unsure, sorted(set(self.strangers))):
            centre = body_of(island.ends, eye, radius)
            if centre is not None:
                rows.append((*centre, radius))
        return np.array(rows).reshape(-1, 3)

    def free(self, scan: Scan, local_base: Pose) -> Array:
        """How far, m, there is surely nothing on each beam (N,), those on people among them.

        What looks like a body may be a piece of a wall, or of glass, but not where a robot says
        that it is.
        """
        on_robots = end_in(scan, local_base, self.company)
        free: Array = np.where(on_robots, scan.ranges, scan.ranges - _SHORT_M)
        return free

    def _rests(
        self, scan: Scan, local_base: Pose, seen: list[Disc], local_map: LocalMap
    ) -> list[Disc]:
        """What may be the last that is seen of those who go behind something, as discs.

        It is too little to be anybody, but somebody was near by just before. In a team it may be
        the first as well, where there was nothing but floor.
        """
        old = scan.stamp - _LATELY_S
        self._lately = [one for one in self._lately if old < one[0] <= scan.stamp]
        self._lately += [(scan.stamp, centre) for centre, _ in seen]
        places = [place for _, place in self._lately]
        if not places and not self.in_team:
            return []
        ends, is_cut = slivers(scan, local_base)
        rests = np.zeros(len(ends), np.bool_)
        if places:
            away, _ = cKDTree(places).query(ends, distance_upper_bound=_GONE_M)
            rests |= np.isfinite(away)
        if self.in_team:
            is_new = (local_map.is_bare(end, BLUR_M) for end in ends)
            rests |= is_cut & np.fromiter(is_new, np.bool_, len(ends))
        return [(end, 0.0) for end in ends[rests]]

    def glance(self, scan: Scan, local_base: Pose) -> None:
        """See how those have moved that are near, without learning anything else."""
        known = self.discs
        if min((np.hypot(*(c - local_base.position)) for c, _ in known), default=np.inf) > _NEAR_M:
            self._glanced = None
            return
        self._glanced = [
            (island.centre, island.radius)
            for island in islands(scan, local_base)
            if (island.is_whole or island.is_round)
            and any(np.hypot(*(island.centre - c)) < _GONE_M for c, _ in known)
        ]

    @property
    def discs(self) -> list[Disc]:
        """Centres (2,), local frame, and radii of those not in the map, m.

        Who was found half hidden is left out, for nobody knows how wide that is.
        """
        waiting = [
            (one.centre, one.radius)
            for one in self._all
            if (one.is_whole or one.is_round or one.came) and one.is_waiting
        ]
        return waiting + self._met

    def is_one_standing(self, stamp: float, local_map: LocalMap) -> bool:
        """Whether somebody in sight has been found who may be let in soon."""
        return any(
            one.is_waiting
            and one.last == stamp
            and _has_stood(one)
            and bool(local_map.covers(one.centre))
            for one in self._all
        )

    def passing(self, stamp: float) -> Array:
        """Where bodies (N, 2), local frame, have not stood for long enough to stay for certain."""
        centres = [
            one.centre
            for one in self._all
            if (one.core < math.inf or one.came)
            and not one.is_lost
            and stamp - one.first < self.longest_patience
        ]
        return np.array(centres).reshape(-1, 2)

    @property
    def let_in(self) -> list[Newcomer]:
        """Bodies that have stood for so long that they are parts of the building."""
        return [one for one in self._all if one.is_let_in and one.is_round]

    @property
    def latest(self) -> list[Disc]:
        """As `discs`, but by the last glance."""
        return self.discs if self._glanced is None else self._glanced

    def _is_company(self, island: Island) -> bool:
        """Whether it is another robot that says where it is."""
        return any(np.hypot(*(island.centre - c)) < r + _MOVED_M for c, r in self.company)

    def _is_passing(self, island: Island, stamp: float, walls: "_Walls") -> bool:
        """Whether what is seen has not stood there for long; it is taken down."""
        here = [one for one in self._all if _is_at(one, island.centre)]
        one = min(here, key=lambda one: one.is_lost, default=None)
        if one is None:
            is_wall = walls.are_seen(island)
            if is_wall and island.evidence <= 0.0:
                return False
            came = walls.are_away(island)
            one = Newcomer(island.centre, island.radius, stamp, stamp, came, island.is_whole)
            one.was_wall = is_wall
            if is_near(island.centre, self.lasting):
                one.came, one.first = False, stamp - self.longest_patience
            self._all.append(one)
        round_before = one.is_round
        one.look(island, stamp)
        if one.is_lost:
            one.is_lost, one.centre, one.first = False, island.centre, stamp
        if one.was_wall and one.is_round and not one.was_round:
            one.first, one.was_round = stamp, True
        one.is_let_in = stamp - one.first >= self._patience(one)
        if one.was_wall and one.is_waiting and not round_before:
            walls.take_out(one)
        one.was_let_in |= one.is_let_in or one.was_wall
        return not one.is_let_in

    def _patience(self, one: Newcomer) -> float:
        if one.was_wall and not one.is_round:
            return 0.0
        if one.came or self._may_be_stranger(one):
            return self._config.came_after_s
        if self._has_met and one.is_round:  # it may have come before it was found
            return self.longest_patience
        found_after = self._config.found_after_s
        may_be = one.evidence > (-SURE if one.is_whole else 0.0)
        return found_after if may_be else min(_GLIMPSE_S, found_after)

    @property
    def longest_patience(self) -> float:
        """What has stood for so long, s, is a part of the building for certain; 0 if all is."""
        return max(self._config.came_after_s, self._config.found_after_s)

    def _may_be_stranger(self, one: Newcomer) -> bool:
        """Whether it may be a robot of the team that waits for something."""
        return one.is_round and any(abs(one.radius - r) < _ALIKE_M for r in self.strangers)

    def _walked(self, one: Newcomer) -> bool:
        """Whether one that has gone shows that people are about; robots of the team do not."""
        return one.came and one.is_whole and one.is_round and not self._may_be_stranger(one)

    def _forget(self, scan: Scan, local_base: Pose, local_map: LocalMap) -> None:
        """Let those go that have gone or are far away; who may have gone is in nobody's way."""
        for one in self._all:
            if one.last > scan.stamp:  # kept from a time before the clock began anew
                one.first, one.last = one.first + scan.stamp - one.last, scan.stamp
        self.gone = [
            one
            for one in self._all
            if is_seen_through(scan, local_base, (one.centre, min(one.core, one.radius)))
        ]
        self._has_met |= any(self._walked(one) for one in self.gone)
        for one in self.gone:
            if one.was_let_in:
                local_map.doubt(one.centre, one.radius + BLUR_M)
        self._all = [
            one
            for one in self._all
            if one not in self.gone
            and (one.is_waiting or local_map.covers(one.centre))
            and (not one.is_lost or _has_stood(one))
        ]
        lost = [one for one in self._all if one.is_waiting and _is_out_of_sight(one, scan.stamp)]
        for one in lost:
            one.is_lost = True
            local_map.forget(one.centre, one.radius + BLUR_M)
        self.missed = [one for one in lost if _has_stood(one)]

    @property
    def points(self) -> Array:
        """The rims (N, 2), local frame, of company and of `discs`."""
        return _rims([*self.discs, *self.company])

    @property
    def lost(self) -> Array:
        """The rims (N, 2), local frame, of bodies that never moved and are out of sight.

        They are of the building for all that is known.
        """
        return _rims(
            [(one.centre, one.radius) for one in self._all if one.is_lost and one.is_round]
        )


def _rims(bodies: list[Disc]) -> Array:
    """Points (N, 2) around discs."""
    return np.concatenate([np.empty((0, 2)), *(c + radius * _RIM for c, radius in bodies)])


class _Walls:
    """The walls of a map as a scan finds them."""

    def __init__(self, local_map: LocalMap, reach: float, is_way: Callable[[Array], bool]) -> None:
        self._map, self._reach, self._is_way = local_map, reach, is_way

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._map.firm_points(), balanced_tree=False)

    def are_seen(self, island: Island) -> bool:
        """Whether most of it lies on what was seen before: a person may brush along a wall.

        For what is rather round once or twice is not enough, nor for what is cut off where the
        floor was free: that may have been a part of somebody.
        """
        may_be_part = island.evidence > 0.0 or (
            not island.is_whole and self._map.was_free(island.centre, island.radius)
        )
        tree = self._tree if may_be_part else self._map.tree()
        distance, _ = tree.query(island.ends, distance_upper_bound=self._reach)
        return bool(np.isfinite(distance).mean() > 0.5)

    def take_out(self, one: Newcomer) -> None:
        """Let the map forget what it took for a wall."""
        self._map.clear(one.centre, one.radius + BLUR_M / 2)

    def are_away(self, island: Island) -> bool:
        """Whether there was certainly nothing where an island is now."""
        is_bare = self._map.is_bare(island.centre, island.radius)
        return is_bare or self._is_way(island.centre)


def _is_at(one: Newcomer, centre: Array) -> bool:
    return math.dist(one.centre, centre) < _MOVED_M


def is_near(centre: Array, others: Iterable[Array]) -> bool:
    """Whether a body here (2,), m, may be one of others that stood still."""
    return any(math.dist(centre, other) < _MOVED_M for other in others)


def _has_stood(one: Newcomer) -> bool:
    """Whether it did not come, and never moved: it may be a part of the building."""
    return not one.came and one.last - one.first >= _GLIMPSE_S


def _is_out_of_sight(one: Newcomer, stamp: float) -> bool:
    """Whether that has been so for so long that nobody knows whether it still stands."""
    return stamp - one.last >= _LOST_S + one.last - one.first
