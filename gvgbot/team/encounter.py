"""Where another robot's map frame lies, by each of two having seen the other one pass.

Nobody can tell by one look which robot a body is. But a body that moves as another robot says that
it moves, while that one sees a body that moves as this robot does, can hardly be anything else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.control.company import BodiesSeen
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.registration import rigid_fit

WINDOW_S = 20.0  # what was seen before is not asked: either map may have been bent since
_RADIUS_M = 0.04  # by which a body may seem wider or slimmer than it is
_GAP_S = 1.5  # between two looks of a robot: for longer it is not known where it was
_BASE_M = 0.5  # between two robots, at least, to tell how one is turned against the other
_BEARS_OUT_M = 0.12  # so near to where a body should be, it bears out a frame
_LEAST_LOOKS = 5  # of each robot
_LEAST_WAY_M = 1.0  # that the two have driven meanwhile: standing things are all alike
_RMS_M = 0.05  # of what bears a frame out
_RIVAL_SHARE = 0.6  # of the looks that bear out the best frame: no other may have more
_FITS = 3
_TRIED = 12  # bodies on either side suggest frames: all of them would take long
_OTHER_M, _OTHER_RAD = 0.5, 0.2  # frames nearer to each other are the same

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Bodies that one robot saw, and where the other one was then, by its own account."""

    look: NDArray[np.intp]  # (N,)
    body: Array  # (N, 2), frame of who looked
    place: Array  # (N, 2), frame of who may have been seen


def frame_of(
    mine: Sequence[BodiesSeen], theirs: Sequence[BodiesSeen], my_radius: float, their_radius: float
) -> tuple[Pose, Array] | None:
    """The pose of the other's map frame in one's own, and its covariance (3, 3); None in doubt.

    Stamps are of one clock; radii of the bodies in m.
    """
    a = _seen(mine, theirs, their_radius)
    b = _seen(theirs, mine, my_radius)
    if min(len(set(a.look)), len(set(b.look))) < _LEAST_LOOKS:
        return None
    ours, told = np.concatenate([a.body, b.place]), np.concatenate([a.place, b.body])
    looks = np.concatenate([a.look, len(mine) + b.look])
    poses = _suggested(a, b)
    scores = [len(set(looks[_borne_out(pose, ours, told)])) for pose in poses]
    if not scores:
        return None
    best = poses[int(np.argmax(scores))]
    middle = told.mean(axis=0)
    rivals = [s for p, s in zip(poses, scores, strict=True) if _is_other(p, best, middle)]
    if max(rivals, default=0) > _RIVAL_SHARE * max(scores):
        return None
    for _ in range(_FITS):
        kept = _borne_out(best, ours, told)
        best, _ = rigid_fit(ours[kept], told[kept])
    kept = _borne_out(best, ours, told)
    first = np.arange(len(ours)) < len(a.look)
    stamps = np.array([look.stamp for look in (*mine, *theirs)])[looks]
    if not _is_sure(best, ours, told, kept & first, kept & ~first, stamps):
        return None
    return rigid_fit(ours[kept], told[kept])


def _seen(looks: Sequence[BodiesSeen], other: Sequence[BodiesSeen], radius: float) -> _Seen:
    """The bodies as wide as the other robot, seen while it is known where that was."""
    stamps = np.array([look.stamp for look in other])
    way = np.array([look.map_base.position for look in other]).reshape(-1, 2)
    rows: list[tuple[int, Array, Array]] = []
    for number, look in enumerate(looks):
        after = int(np.searchsorted(stamps, look.stamp))
        if not 0 < after < len(stamps) or stamps[after] - stamps[after - 1] > _GAP_S:
            continue
        place = np.array([np.interp(look.stamp, stamps, way[:, k]) for k in (0, 1)])
        fits = np.abs(look.bodies[:, 2] - radius) < _RADIUS_M
        rows += [(number, body, place) for body in look.bodies[fits, :2]]
    return _Seen(
        np.array([number for number, _, _ in rows], np.intp),
        np.array([body for _, body, _ in rows]).reshape(-1, 2),
        np.array([place for _, _, place in rows]).reshape(-1, 2),
    )


def _suggested(a: _Seen, b: _Seen) -> list[Pose]:
    """Poses of the other's frame in one's own, each by one body that either has seen.

    One lays the other robot on a body seen, and a body that it saw on this robot.
    """
    poses = []
    for i, j in product(_spread(len(a.look)), _spread(len(b.look))):
        ours, told = b.place[j] - a.body[i], b.body[j] - a.place[i]
        metres = math.hypot(*told)
        if metres < _BASE_M or abs(math.hypot(*ours) - metres) > _BEARS_OUT_M:
            continue
        turn = wrap_angle(math.atan2(ours[1], ours[0]) - math.atan2(told[1], told[0]))
        at = a.body[i] - Pose(theta=turn).transform(a.place[i])
        poses.append(Pose(float(at[0]), float(at[1]), turn))
    return poses


def _spread(count: int) -> list[int]:
    """Some of so many indices, evenly."""
    return sorted({round(i) for i in np.linspace(0, count - 1, _TRIED)})


def _borne_out(pose: Pose, ours: Array, told: Array) -> Mask:
    away: Mask = np.hypot(*(ours - pose.transform(told)).T) < _BEARS_OUT_M
    return away


def _is_other(pose: Pose, best: Pose, middle: Array) -> bool:
    away = float(np.hypot(*(pose.transform(middle) - best.transform(middle))))
    return away > _OTHER_M or abs(wrap_angle(pose.theta - best.theta)) > _OTHER_RAD


def _is_sure(
    pose: Pose, ours: Array, told: Array, by_us: Mask, by_them: Mask, stamps: Array
) -> bool:
    """Whether the rows that bear a frame out, by who looked, are enough to believe it."""
    if min(len(set(stamps[by_us])), len(set(stamps[by_them]))) < _LEAST_LOOKS:
        return False
    way = _seen_way(told[by_us], stamps[by_us]) + _seen_way(ours[by_them], stamps[by_them])
    kept = by_us | by_them
    off = np.hypot(*(ours[kept] - pose.transform(told[kept])).T)
    return bool(way > _LEAST_WAY_M and np.sqrt((off**2).mean()) < _RMS_M)


def _seen_way(places: Array, stamps: Array) -> float:
    """How far somebody who was at these places (N, 2) was seen to drive, m.

    Where it was lost from sight in between, it may have been somebody else there; and to and fro on
    the spot is no way.
    """
    steps = np.hypot(*np.diff(places, axis=0).T)
    extent = np.hypot(*np.ptp(places, axis=0))
    return float(min(extent, steps[np.diff(stamps) <= _GAP_S].sum()))
