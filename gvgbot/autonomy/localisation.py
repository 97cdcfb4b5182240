"""The base in the local frame: odometry, corrected by laying each scan onto the local map."""

import math
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.slam.calibration import Calibration, per_unit
from gvgbot.autonomy.slam.sampling import sampled
from gvgbot.autonomy.slam.scan_matching import (
    Registration,
    ScanMatchingConfig,
    Sides,
    register_coarsely,
)
from gvgbot.autonomy.slam.trail import Laid
from gvgbot.autonomy.small_systems import inverse
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

_ONE = np.eye(3)
_LEAST_POINTS = 50  # fewer say nothing about a pose
_AT_ALL = 0.01  # better agreement, where no place is likelier than another
# of a fit: what a point counts that lies where nothing is known yet. Of 100 points on known ground
# 94 fit where the robot is and 40 where it is not: ln(60 / 6) / (ln(60 / 6) + ln(94 / 40)) = 0.73
_UNKNOWN = 0.7
_ON_WALLS = 0.8  # so near to walls, as a share of the reach, points are on them, lines or not
_CLEARLY = 0.1  # better agreement of beams and walls than this is no chance
_BEST = 0.97  # agreement, where all beams end on walls: they are off by noise all the same
_SEARCH_M, _SEARCH_STEP_M = 1.0, 0.25  # around the pose by odometry
_SEARCH_STEP_RAD, _SEARCH_PAIR_M = 0.05, 0.3
_SEARCHED = 40  # points
_UNLIKELY_M = 0.07  # nearer to the walls must be what is turned as far as it may be
_SLIPPING = 25.0  # times the covariance of odometry, when the wheels slip
_LOST = np.diag([0.5**2, 0.5**2, 0.05**2])  # of a base that nobody heard for a while
_SEEN_SHARE = 0.3  # of the walls must be known to a robot that comes round a corner unseen
_FITS_M, _FITTING = 0.15, 0.8  # so near to the walls must be that share of a scan's ends,
_FITTING_AMONG_PEOPLE = 0.6  # and where people may hide them; elsewhere it is hardly ever half
_OPEN = 0.25  # where less of all beams hit something, odometry alone may have led it for long

# full: scans are matched, and vertices are poses. paper: odometry alone between vertices, and a
# vertex seen again corrects by its position only, as the method was published
Localisation = Literal["full", "paper"]

_Lesson = tuple[Pose, float, Pose, Array, Array, float]  # as Calibration.learn takes it


class ScanMatch(NamedTuple):
    """The base after a step, the covariance (3, 3) of that step, and how walls led to it."""

    local_base: Pose
    covariance: Array
    laid: Laid | None


class _Walls(NamedTuple):
    """Points in a tree, the hits (N,) that each is made of, and where it was seen from (N, 2).

    `looks` (N,) are the numbers of the looks at it, on average, and `spreads` (N,) the variances of
    these.
    """

    hits: Array
    sights: Array
    looks: Array
    spreads: Array
    tree: cKDTree


class LocalMaps:
    """The local map that the GVG is drawn from, and a coarse one that reaches farther.

    The far one is only matched with: the end of a long corridor tells how far one has come.
    """

    def __init__(
        self, near: LocalMapConfig, far: LocalMapConfig, matching: ScanMatchingConfig
    ) -> None:
        self.near, self._far = LocalMap(near), LocalMap(far)
        self._due: tuple[Scan, Pose, float] | None = None  # what the far one has yet to learn
        self._walls: _Walls | None = None  # of both; None: not drawn yet
        self._matching = matching
        self._calibration = Calibration()
        self._lesson: _Lesson | None = None  # what the calibration has yet to learn
        self._left = _ONE  # of odometry's errors, by what it has learnt since the last match

    def insert(
        self, scan: Scan, local_base: Pose, travelled: float, free: Array | None = None
    ) -> None:
        """Add a scan taken by the base at a pose in the local frame, after so many metres.

        `free` (N,) is how far, m, there was nothing on each beam, if that is more than its range.
        The far map learns it when there is time: see `catch_up`.
        """
        self._teach_far()
        local_laser = local_base.compose(scan.base_laser)
        self.near.insert(scan, local_laser, travelled, free)
        self._due, self._walls = (scan, local_laser, travelled), None

    def catch_up(self) -> None:
        """Do what is due before the next match: between two looks, or when that comes."""
        self._teach_far()
        self._calibrate()
        self.near.tree()  # which whoever looks for people asks for
        if self._walls is None:
            self._walls = self._drawn()

    def count_on(self, metres: float) -> None:
        """Take what was driven as so much more: the counting began elsewhere."""
        self._teach_far()
        self.near.count_on(metres)
        self._far.count_on(metres)

    def _teach_far(self) -> None:
        if self._due is not None:
            self._far.insert(*self._due)
        self._due = None

    def _calibrate(self) -> None:
        if self._lesson is not None:
            self._left = self._calibration.learn(*self._lesson)
        self._lesson = None

    @property
    def calibration(self) -> Calibration:
        """What all matches so far have told about odometry."""
        self._calibrate()
        return self._calibration

    @property
    def far(self) -> LocalMap:
        """The map that is only matched with, as all scans so far have made it."""
        self._teach_far()
        return self._far

    def match(
        self, scan: Scan, before: Pose, motion: Pose, duration: float, noise: Array
    ) -> ScanMatch:
        """The pose of the base after a motion, its covariance (3, 3) in its own frame, and how.

        That covariance is of what the step adds for good to the error of the one before. Odometry
        is expected to err by `noise`, in its parts (4, 3, 3). Without enough walls the pose is
        where odometry has it. Wheels may have turned without effect, so it may as well be where it
        was `before`.
        """
        motion, Q = self.calibration.corrected(motion, duration), self.calibration.scattered(noise)
        prior = before.compose(motion)
        is_sparse = self._matching.coarse_pair_m > 0.0  # nobody stands from scan to scan
        slipped = () if is_sparse else self._slipped(scan, before, prior)
        priors = chain([(prior, Q)], ((pose, _SLIPPING * Q) for pose in slipped))
        searched = self._matching.search_rad if is_sparse else 0.0
        best = self._best(scan, priors, turned=searched, stays=True)
        calibration, per_error = self._calibration, per_unit(motion, duration)
        if best is None:
            laid = self._laid(None, prior, per_error, Q, np.zeros((3, 3)))
            return ScanMatch(prior, calibration.adds_up(motion, duration, _ONE, Q), laid)
        found, used = best
        expected = self._matching.pair_sigma_m**2 / self._matching.independent_share
        walls = min(1.0, found.scatter / expected)
        felt = used
        if used is Q:
            self._lesson = motion, duration, prior.to(found.pose), noise, found.covariance, walls
            felt = calibration.as_felt(noise).sum(axis=0)
        g = _ONE - found.covariance @ inverse(used)
        by_odometry, by_scan = _errors(found, g, felt, walls)
        laid = self._laid(found, found.pose, (_ONE - g) @ per_error, by_odometry, by_scan)
        stays = inverse(_ONE + g * self._age(found))
        drift = stays @ by_odometry @ stays.T  # the next scan does not err as this one
        left = np.asarray(stays @ (_ONE - g), np.float64)
        return ScanMatch(found.pose, calibration.adds_up(motion, duration, left, drift), laid)

    def trust(
        self, scan: Scan, before: Pose, motion: Pose, duration: float, noise: Array
    ) -> ScanMatch:
        """As `match`, but just where odometry has it, whatever the walls say."""
        return ScanMatch(before.compose(motion), noise.sum(axis=0), None)

    def find(
        self,
        scan: Scan,
        before: Pose,
        motion: Pose,
        duration: float,
        noise: Array,
        *,
        turned: float | None = None,
    ) -> ScanMatch:
        """As `match`, where nobody saw the way that the base took: it is searched for around.

        Wheels tell how far it went and how much it turned, but not which of it came first. Where
        even they are doubted, and it may be `turned` by so much, rad, the place that agrees best is
        taken. Walls where nothing is known yet do not speak against a place.
        """
        prior = before.compose(self.calibration.corrected(motion, duration))
        clearly = _CLEARLY if turned is None else _AT_ALL
        Q = noise.sum(axis=0) + _LOST
        priors = [(p, Q) for p in _around(prior)]
        best = self._best(scan, priors, clearly, max(self._matching.search_rad, turned or 0.0))
        if best is None:
            return ScanMatch(prior, Q, None)
        return ScanMatch(best[0].pose, best[0].covariance, None)

    def fits(self, scan: Scan, local_base: Pose) -> bool:
        """Whether a scan from a pose in the local frame shows the walls that are known there."""
        return self._fits(scan, local_base, self._matching.min_pairs, _FITTING)

    def may_fit(self, scan: Scan, local_base: Pose) -> bool:
        """Whether it may do so: in the open it shows no walls, and among people not all of them."""
        is_open = len(scan.ends) < _OPEN * len(scan.ranges)
        least = self._matching.min_pairs // 2
        return is_open or self._fits(scan, local_base, least, _FITTING_AMONG_PEOPLE)

    def _fits(self, scan: Scan, local_base: Pose, least: int, share: float) -> bool:
        """Whether of `least` ends or more, at walls or on known ground, a share is at walls.

        Noise lays half of the ends on a wall behind it, where nothing is known.
        """
        ends = local_base.compose(scan.base_laser).transform(scan.ends)
        at_walls = np.asarray(self.near.tree().query(ends)[0]) < _FITS_M
        told = at_walls | self.near.known(ends)
        return int(told.sum()) >= least and float(at_walls[told].mean()) >= share

    def _drawn(self) -> _Walls:
        """The walls of the near map, and of the far one around it."""
        far = self._far.points()
        around = ~self.near.covers(far)
        points = np.concatenate([self.near.points(), far[around]])
        return _Walls(
            np.concatenate([self.near.hits(), self._far.hits()[around]]),
            np.concatenate([self.near.sights(), self._far.sights()[around]]),
            np.concatenate([self.near.looked_at(), self._far.looked_at()[around]]),
            np.concatenate([self.near.looks_spread(), self._far.looks_spread()[around]]),
            cKDTree(points, balanced_tree=False),
        )

    def _laid(
        self,
        found: Registration | None,
        local_base: Pose,
        by_odometry: Array,
        noise: Array,
        scan_noise: Array,
    ) -> Laid:
        """How the look that comes next was laid onto walls, if they were found.

        The error of a look weighs by what the walls that it drew tell of the pose. A wall that
        several looks have drawn errs by the mean of theirs.
        """
        looks, gains = np.empty((0, 2), np.int64), np.empty((0, 3, 3))
        if found is not None:
            assert self._walls is not None
            middle = self._walls.looks.take(found.walls)
            reach = np.sqrt(3.0 * self._walls.spreads.take(found.walls))  # if they are even
            first = np.maximum(np.rint(middle - reach), 1.0)
            after = np.maximum(np.rint(middle + reach), first) + 1.0
            looks = np.stack([first, after], axis=1).astype(np.int64)
            gains = found.covariance @ found.information
        left, self._left = self._left, _ONE
        look, P = self.near.looks + 1, self._calibration.P
        return Laid(local_base, look, looks, gains, by_odometry, noise, scan_noise, left, P)

    def _age(self, found: Registration) -> float:
        """How many looks before the newest one the walls that were found were seen, on average.

        A pose errs by the share g as the mean of those from which its walls were seen, and else as
        the one before: of an error the share 1 / (1 + g age) stays for good.
        """
        assert self._walls is not None
        return self.near.looks - float(self._walls.looks[found.walls].mean())

    def _best(
        self,
        scan: Scan,
        priors: Iterable[tuple[Pose, Array]],
        clearly: float = _CLEARLY,
        turned: float = 0.0,
        *,
        stays: bool = False,
    ) -> tuple[Registration, Array] | None:
        """The match from the first prior, unless that from another one is clearly better.

        Where the robot `stays` by the first prior, points must also lie nearer to walls by another
        one: few of them lie on lines among posts, and by chance on lines from post to post.
        """
        self.catch_up()
        assert self._walls is not None
        points = sampled(scan, self._matching.points)
        if min(self._walls.tree.n, len(points)) < _LEAST_POINTS:
            return None
        best: tuple[Registration, Array] | None = None
        agreement, first = 0.0, Pose()  # the latter is where the first prior leads
        for i, (prior, Q) in enumerate(priors):
            if agreement + clearly >= _BEST:
                break  # nothing can be clearly better
            near = _turned(points, self._walls.tree, prior, turned) if turned else prior
            found = self._registered(scan, points, near, Q, None if best is None else best[0].pose)
            if i == 0:
                first = near if found is None else found.pose
            if found is None:
                continue
            now = self._agreement(found, points)
            if now is None:
                if stays and i == 0 and self._nearness(points, first) >= _ON_WALLS:
                    best = found, Q
            elif now > agreement + clearly and (
                i == 0
                or not stays
                or self._nearness(points, found.pose) > self._nearness(points, first)
            ):
                best, agreement = (found, Q), now
        return best

    def _slipped(self, scan: Scan, before: Pose, prior: Pose) -> Iterator[Pose]:
        """Where the base may be if its wheels slip: as far as it was, and turned if that is sought.

        Turned it is only there if odometry leads where walls clearly speak against it: on its own
        odometry tells more of the heading than such a search.
        """
        still, reach = Pose(before.x, before.y, prior.theta), self._matching.search_rad
        yield still
        if reach:
            assert self._walls is not None
            points, tree = sampled(scan, self._matching.points), self._walls.tree
            yield from (_turned(points, tree, pose, reach) for pose in (prior, still))

    def _registered(
        self, scan: Scan, points: Array, near: Pose, Q: Array, so_far: Pose | None
    ) -> Registration | None:
        """Points (N, 2) of a scan, laid onto the walls near a pose; None as `register` has it."""
        assert self._walls is not None
        hits, sights, _, _, walls = self._walls
        config, sides = self._matching, Sides(sights, scan.base_laser.position - points)
        coarse = (config.coarse_pair_m,) if config.coarse_pair_m else ()
        return register_coarsely(points, walls, near, Q, config, coarse, hits, sides, so_far)

    def _agreement(self, found: Registration, points: Array) -> float | None:
        """How well points (N, 2) fit where they were found, 0 to 1; None if too few of them do.

        What lies where nothing is known yet speaks neither for a place nor against it; enough of
        the rest, which is taken for a least share of all, must fit.
        """
        config = self._matching
        known = np.count_nonzero(self.near.known(found.pose.transform(points))) / len(points)
        if found.inliers < config.min_inliers * max(known, found.inliers, _SEEN_SHARE):
            return None
        fits = found.inliers * (1.0 - found.rms / config.max_pair_m)
        return fits + _UNKNOWN * (1.0 - max(known, found.inliers))

    def _nearness(self, points: Array, pose: Pose) -> float:
        """How near points (N, 2) lie to walls, where anything is known: 1 on them, 0 off them."""
        assert self._walls is not None
        laid, reach = pose.transform(points), self._matching.max_pair_m
        laid = laid[self.near.known(laid)]
        if not len(laid):
            return 0.0
        away = np.asarray(self._walls.tree.query(laid, distance_upper_bound=reach)[0])
        return 1.0 - float(np.minimum(away, reach).mean()) / reach


def _errors(found: Registration, g: Array, felt: Array, walls: float) -> tuple[Array, Array]:
    """Covariances (3, 3) of what is new in the error of a match, in the frame of the base.

    Scans are laid onto walls. A pose errs by e = (1 - g) (e' + q) + g (m + v): the gain g weighs
    odometry with its noise q, which has the covariance `felt`, from the pose before, and walls with
    the mean error m of the scans that drew them and the noise v of the scan, which has `walls`
    times the variance that the matcher expects. Of that e' and m are not new. The first covariance
    is what q adds, the second what v adds.
    """
    by_odometry, by_scan = (_ONE - g) @ felt @ (_ONE - g).T, walls * (g @ found.covariance)
    return by_odometry, np.asarray((by_scan + by_scan.T) / 2, np.float64)


def _turned(points: Array, tree: cKDTree, prior: Pose, reach: float) -> Pose:
    """The pose with the heading, within reach (rad), at which points lie nearest to the walls."""
    some = points[:: max(1, len(points) // _SEARCHED)]
    turns = np.arange(-reach, reach + 1e-9, _SEARCH_STEP_RAD)
    poses = [prior.compose(Pose(0.0, 0.0, float(turn))) for turn in turns]
    laid = np.concatenate([pose.transform(some) for pose in poses])
    distance = np.asarray(tree.query(laid, distance_upper_bound=_SEARCH_PAIR_M)[0])
    off = np.minimum(distance, _SEARCH_PAIR_M).reshape(len(turns), -1).mean(axis=1)
    return poses[int(np.argmin(off + _UNLIKELY_M * (turns / reach) ** 2))]


def _around(prior: Pose) -> list[Pose]:
    """The pose, and others with its heading, nearest first."""
    steps = np.arange(-_SEARCH_M, _SEARCH_M + 1e-9, _SEARCH_STEP_M)
    offsets = sorted((math.hypot(x, y), x, y) for x in steps for y in steps)
    return [prior.compose(Pose(x, y, 0.0)) for away, x, y in offsets if away <= _SEARCH_M]
