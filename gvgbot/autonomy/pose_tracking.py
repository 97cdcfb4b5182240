"""Where the base is at each look: odometry since the one before, corrected by the walls around."""

import math
from functools import partial
from typing import Self

import numpy as np

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.keyframes import Keyframe, Past, Step
from gvgbot.autonomy.localisation import LocalMaps, ScanMatch
from gvgbot.autonomy.map_edits import MapEdits
from gvgbot.autonomy.odometry_log import OdometryLog
from gvgbot.geometry import Array, Pose, rotated_covariance
from gvgbot.hal.messages import Scan

_LIFTED = np.diag([0.3**2, 0.3**2, 0.1**2])  # how far a robot is carried that is put down again
_TURNED_RAD = 0.4  # that a robot may have been turned unnoticed


class PoseTracker:
    """Keeps what tells where the base is: its odometry, and the walls seen so far."""

    def __init__(self, config: AutonomyConfig, *, matches_walls: bool) -> None:
        """`matches_walls` if walls tell where it is, and not odometry and vertices alone."""
        self.maps = LocalMaps(config.local_map, config.far_map, config.scan_matching)
        self.odometry = OdometryLog()
        self.matches_walls = matches_walls
        self.was_lifted = False  # since the last look
        self._noise = config.odometry_noise
        self._breaks, self._unturned_s = 0, 0.0  # of odometry, at the last look

    def notice_break(self) -> bool:
        """Whether the base has started anew since the last look; this one knows of it."""
        newest = self.odometry.newest
        assert newest is not None, "it tells where the base is"
        is_broken, self._breaks = newest.breaks != self._breaks, newest.breaks
        return is_broken

    def felt_s(self, duration: float) -> float:
        """How long the gyro may have drifted, s, since the last look, so many seconds ago."""
        return max(0.0, duration - (self.odometry.unturned_s - self._unturned_s))

    def track(
        self,
        scan: Scan,
        odom_base: Pose,
        past: Past,
        mapper: MapEdits,
        *,
        is_broken: bool,
        is_doubted: bool,
    ) -> Pose | None:
        """The base in the local frame; the belief moves with it. None: it may be anywhere.

        After it was lifted it is looked for near by, and the walls that it sees must be known.
        `is_broken` if odometry has started anew, `is_doubted` if it is not certain for some other
        reason where the robot is.
        """
        last = past.last
        assert last is not None, "the local frame is where the first look was"
        motion = last.odom_base.to(odom_base)
        is_carried = is_broken or self.was_lifted  # perhaps
        fits = self.maps.fits if is_broken else self.maps.may_fit
        match = self._matched(
            scan, last, motion, is_broken=is_broken, is_doubted=is_doubted or is_broken
        )
        if is_carried and self.matches_walls and not fits(scan, match.local_base):
            return None
        moved = last.local_base.to(match.local_base)
        step = Step(moved, rotated_covariance(match.covariance, moved.theta))
        past.steps.append(step)
        past.travelled += math.hypot(motion.x, motion.y)
        mapper.move(step.motion, step.covariance, match.laid)
        return match.local_base

    def _matched(
        self, scan: Scan, last: Keyframe, motion: Pose, *, is_broken: bool, is_doubted: bool
    ) -> ScanMatch:
        """A scan on the walls, after a motion by odometry."""
        felt_s, noise = self.expected_error(motion, scan.stamp - last.stamp)
        self._unturned_s = self.odometry.unturned_s
        lost = self.was_lifted or self.odometry.has_gap_since(last.stamp)
        match = self.maps.match if self.matches_walls else self.maps.trust
        if self.matches_walls and (lost or is_doubted):
            turned = math.pi if is_broken else _TURNED_RAD if is_doubted else None
            match = partial(self.maps.find, turned=turned)
        if self.was_lifted or is_doubted:
            self.was_lifted, noise = False, np.append(noise, [_LIFTED], axis=0)
        return match(scan, last.local_base, motion, felt_s, noise)

    def expected_error(self, motion: Pose, duration: float) -> tuple[float, Array]:
        """How odometry may have erred since the last look, so many seconds ago.

        For how long, s, its gyro may have drifted, and the parts (4, 3, 3) of its noise, in the
        frame of the base after the motion: what `LocalMaps.match` takes.
        """
        noise = self._noise.parts(motion, max(0.0, duration))
        return self.felt_s(duration), rotated_covariance(noise, -motion.theta)

    def take_over(self, other: Self) -> None:
        """Go on in the local frame of another one, with its walls and by its odometry."""
        self.maps, self.odometry, self.was_lifted = other.maps, other.odometry, other.was_lifted
        self._breaks, self._unturned_s = other._breaks, other._unturned_s
