"""Things that may be people: they stand free, are as wide as people, and go again.

They are kept out of the map, and the planner leads round them, until they have stood for so long
that they must be a part of the building. What depends on them is not believed meanwhile. Even then
they may go, and the map forgets them as soon as that is seen.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from gvgbot.ranges import Range

_STEP_M = 0.3  # in range from beam to beam, at the rim of something that stands free
_SMOOTH_M = 0.15  # in range from beam to beam, on it: two legs of a chair are farther apart
_BEAMS = 3  # fewer see nothing for sure
_SLIM_M, _WIDE_M = 0.1, 0.8  # people are between these; what is slimmer is furniture
_FLAT = 0.06  # of its width: what bulges less towards the laser is a piece of wall, or of glass
_ARC_BEAMS = 8  # fewer lie on a circle by chance
_ROUND = 0.06  # of its radius: what strays less from a circle, r.m.s., may be a leg or a body
_GLIMPSE_S = 3.0  # what is half hidden behind something nearer is only kept waiting so long
_BLUR_M = 0.1  # beyond its rim, beams may still end on something
_NEAR_M = 3.0  # who is farther away is not followed from scan to scan
_GONE_M = 1.0  # between two looks, at most
_MOVED_M = 0.3  # what stands is found again within this
_STRAY = 0.1  # of the beams towards a place: so many may end there though nothing is there
_LOST_S = 3.0  # and what is out of sight for so long, beyond the time it stood, has gone
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
    is_whole: bool  # both sides of it have been seen, or so much that the rest is known
    is_let_in: bool = False  # it has stood for long enough to be in the map
    was_let_in: bool = False  # or it had, for what was seen of it at first


@dataclass(frozen=True, slots=True, eq=False)
class _Island:
    """Beams that end on something narrow with more room on one side or both; local frame."""

    ends: Array  # (N, 2)
    centre: Array
    radius: float
    is_whole: bool
    is_round: bool


class Newcomers:
    """What has come lately, or been found lately and may go."""

    def __init__(self, config: NewcomersConfig) -> None:
        self._config = config
        self._all: list[Newcomer] = []
        self.company: list[tuple[Array, float]] = []  # other robots: where they say they are
        self._glanced: list[tuple[Array, float]] | None = None  # where those are that move on

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
        if not max(self._config.came_after_s, self._config.found_after_s):  # who comes, stays
            return _without(scan, local_base, self.company)
        self._forget(scan, local_base, local_map)
        walls = _Walls(local_map, self._config.away_from_walls_m, is_way)
        seen = [
            (island.centre, island.radius)
            for island in _islands(scan, local_base)
            if not self._is_company(island) and self._is_passing(island, scan.stamp, walls)
        ]
        waiting = [(one.centre, one.radius) for one in self._all if not one.is_let_in]
        # At times one is seen in parts only, or has moved a little: both discs count.
        return _without(scan, local_base, [*seen, *waiting, *self.company])

    def glance(self, scan: Scan, local_base: Pose) -> None:
        """See how those have moved that are near, without learning anything else."""
        known = self.discs
        if min((np.hypot(*(c - local_base.position)) for c, _ in known), default=np.inf) > _NEAR_M:
            self._glanced = None
            return
        self._glanced = [
            (island.centre, island.radius)
            for island in _islands(scan, local_base)
            if island.is_whole and any(np.hypot(*(island.centre - c)) < _GONE_M for c, _ in known)
        ]

    @property
    def discs(self) -> list[tuple[Array, float]]:
        """Centres (2,), local frame, and radii of those not in the map, m.

        Who was found half hidden is left out, for nobody knows how wide that is.
        """
        return [
            (one.centre, one.radius)
            for one in self._all
            if (one.is_whole or one.came) and not one.is_let_in
        ]

    @property
    def latest(self) -> list[tuple[Array, float]]:
        """As `discs`, but by the last glance."""
        return self.discs if self._glanced is None else self._glanced

    def _is_company(self, island: _Island) -> bool:
        """Whether it is another robot that says where it is."""
        return any(np.hypot(*(island.centre - c)) < r + _MOVED_M for c, r in self.company)

    def _is_passing(self, island: _Island, stamp: float, walls: "_Walls") -> bool:
        """Whether what is seen has not stood there for long; it is taken down."""
        one = next((one for one in self._all if _is_at(one, island.centre)), None)
        if one is None and walls.are_seen(island):
            return False
        if one is None:
            came = walls.are_away(island)
            one = Newcomer(island.centre, island.radius, stamp, stamp, came, island.is_whole)
            self._all.append(one)
        one.last = stamp
        one.radius = max(one.radius, island.radius)
        one.is_whole |= island.is_whole
        one.is_let_in = stamp - one.first >= self._patience(one)
        one.was_let_in |= one.is_let_in
        return not one.is_let_in

    def _patience(self, one: Newcomer) -> float:
        if one.came:
            return self._config.came_after_s
        found_after = self._config.found_after_s
        return found_after if one.is_whole else min(_GLIMPSE_S, found_after)

    def _forget(self, scan: Scan, local_base: Pose, local_map: LocalMap) -> None:
        """Let those go that have gone, or whom nobody has seen long, or who are far away."""
        for one in self._all:
            if one.last > scan.stamp:  # kept from a time before the clock began anew
                one.first, one.last = one.first + scan.stamp - one.last, scan.stamp
        gone = [one for one in self._all if _is_seen_through(scan, local_base, one)]
        for one in gone:
            if one.was_let_in:
                local_map.doubt(one.centre, one.radius + _BLUR_M)
        self._all = [
            one
            for one in self._all
            if one not in gone
            and (
                local_map.covers(one.centre)
                if one.is_let_in
                else scan.stamp - one.last < _LOST_S + one.last - one.first
            )
        ]

    @property
    def points(self) -> Array:
        """The rims (N, 2), local frame, of company and of `discs`."""
        rims = [centre + radius * _RIM for centre, radius in [*self.discs, *self.company]]
        return np.concatenate([np.empty((0, 2)), *rims])


class _Walls:
    """The walls of a map as a scan finds them."""

    def __init__(self, local_map: LocalMap, reach: float, is_way: Callable[[Array], bool]) -> None:
        self._map, self._reach, self._is_way = local_map, reach, is_way

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._map.firm_points())

    def are_seen(self, island: _Island) -> bool:
        """Whether most of it lies on what was seen before: a person may brush along a wall.

        For what is round, once or twice is not enough: that may have been a part of a person.
        """
        tree = self._tree if island.is_round else self._map.tree()
        distance, _ = tree.query(island.ends, distance_upper_bound=self._reach)
        return bool(np.isfinite(distance).mean() > 0.5)

    def are_away(self, island: _Island) -> bool:
        """Whether there was certainly nothing where an island is now."""
        is_bare = self._map.is_bare(island.centre, island.radius)
        return is_bare or self._is_way(island.centre)


def _is_at(one: Newcomer, centre: Array) -> bool:
    return bool(np.hypot(*(one.centre - centre)) < _MOVED_M)


def _islands(scan: Scan, local_base: Pose) -> list[_Island]:
    """What people may be, by a scan.

    A beam without an echo has the room of the whole range; one that failed tells nothing.
    """
    told = np.flatnonzero(~np.isnan(scan.ranges))
    if not len(told):  # it is blind
        return []
    depth = np.minimum(scan.ranges[told], scan.range_max)
    edges = np.flatnonzero(np.abs(np.diff(depth)) >= _STEP_M) + 1
    local_laser = local_base.compose(scan.base_laser)
    beside = np.concatenate([[-np.inf], depth, [-np.inf]])  # who is cut off there is half hidden
    found = []
    for start, stop in pairwise([0, *edges.tolist(), len(depth)]):
        rims = depth[start] < beside[start], depth[stop - 1] < beside[stop + 1]
        is_one = np.abs(np.diff(depth[start:stop])).max(initial=0.0) < _SMOOTH_M
        if not any(rims) or not is_one or stop - start < _BEAMS:
            continue
        ends = _ends(scan, told[start:stop], depth[start:stop], local_laser)
        width = float(np.hypot(*(ends[-1] - ends[0])))
        if not _SLIM_M <= width < _WIDE_M or (all(rims) and _is_flat(ends, width)):
            continue
        circle = _circle(ends)
        if circle is not None and circle[1] < width:  # a sixth of it, or more
            found.append(_Island(ends, *circle, is_whole=True, is_round=True))
        else:
            away = ends.mean(axis=0) - local_laser.position
            centre = ends.mean(axis=0) + 0.3 * width * away / np.hypot(*away)
            found.append(_Island(ends, centre, width / 2, all(rims), is_round=False))
    return found


def _is_flat(ends: Array, width: float) -> bool:
    """Whether ends (N, 2) seen from side to side, m, are on a line, as on no leg and no body.

    Glass shows a flat patch where it is seen head-on, which wanders along it with the robot.
    """
    along = (ends[-1] - ends[0]) / width
    bulge = np.abs((ends - ends[0]) @ np.array([-along[1], along[0]]))
    third = len(ends) // 3
    rims = (bulge[:third].mean() + bulge[-third:].mean()) / 2
    return bool(bulge[third:-third].mean() - rims < _FLAT * width)


def _circle(ends: Array) -> tuple[Array, float] | None:
    """Centre (2,) and radius, m, of what looks like a leg or a body by its ends (N, 2); or None.

    The circle is the algebraic least-squares fit of Kåsa: |p|² = 2 c·p + r² - |c|².
    """
    if len(ends) < _ARC_BEAMS:
        return None
    middle = ends.mean(axis=0)
    about = ends - middle
    equations = np.column_stack([2 * about, np.ones(len(ends))])
    (x, y, rest), *_ = np.linalg.lstsq(equations, (about**2).sum(axis=1))
    radius = float(np.sqrt(rest + x**2 + y**2))
    misfit = np.hypot(*(about - (x, y)).T) - radius
    is_one = _SLIM_M < 2.0 * radius < _WIDE_M and np.std(misfit) < _ROUND * radius
    return (middle + np.array([x, y]), radius) if is_one else None


def _without(scan: Scan, local_base: Pose, discs: list[tuple[Array, float]]) -> Scan:
    """The scan without the beams that end in discs, by centre (2,), local frame, and radius."""
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    ends = _ends(scan, beams, scan.ranges[beams], local_base.compose(scan.base_laser))
    inside = np.zeros(len(beams), np.bool_)
    for centre, radius in discs:
        inside |= np.hypot(*(ends - centre).T) < radius + _BLUR_M
    if not inside.any():
        return scan
    ranges = scan.ranges.copy()
    ranges[beams[inside]] = np.nan
    return replace(scan, ranges=ranges)


def _ends(scan: Scan, beams: NDArray[np.intp], depth: Array, local_laser: Pose) -> Array:
    """Where beams end (N, 2), local frame."""
    bearings = scan.angle_min + scan.angle_increment * beams
    directions = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return local_laser.transform(depth[:, None] * directions)


def _is_seen_through(scan: Scan, local_base: Pose, one: Newcomer) -> bool:
    """Whether most beams towards it pass it by, and hardly any ends on it.

    Beside a post between two panes of glass most beams pass as well.
    """
    x, y = local_base.compose(scan.base_laser).inverse().transform(one.centre)
    away = float(np.hypot(x, y))
    if away < one.radius:
        return False
    middle = (np.arctan2(y, x) - scan.angle_min) % (2 * np.pi) / scan.angle_increment
    half = one.radius / away / scan.angle_increment
    first, last = round(middle - half), round(middle + half) + 1
    if first < 0 or last > len(scan.ranges):
        return False
    told = scan.ranges[first:last]
    told = told[~np.isnan(told)]
    beyond = told > away + one.radius + _BLUR_M
    ends = ~beyond & (told > away - one.radius - _BLUR_M)
    return bool(len(told) and np.mean(beyond) > 0.5 and np.mean(ends) < _STRAY)
