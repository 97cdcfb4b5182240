"""What is wrong with the laser or the base, so that no robot can drive by them; for people."""

import numpy as np

from gvgbot.autonomy.aim import Aim, how_to_aim
from gvgbot.autonomy.control.reflexes import Cause
from gvgbot.autonomy.handedness import Handedness, what_to_set
from gvgbot.autonomy.obedience import DOES_NOT_MOVE, Obedience
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.swing import Swing, how_to_place, how_to_turn
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.cover import HARDLY_ANY
from gvgbot.hal.messages import Scan

_SEES_NOTHING = (
    "the robot has run into something, and its laser has seen nothing so far: uncover it, clean "
    "its window, and restart the program"
)


class Defects:
    """Adds up what scans and motions tell of the laser and the base."""

    def __init__(self, matching: ScanMatchingConfig) -> None:
        self._handedness, self._obedience = Handedness(), Obedience()
        self._aim, self._swing = Aim(matching), Swing(matching)
        self._has_seen = self._has_hit = False

    def note_scan(self, scan: Scan, odom_base: Pose, told: Twist) -> str | None:
        """What is wrong, and what to do; the base is told just now to move so."""
        self._has_seen = self._has_seen or float(np.isfinite(scan.ranges).mean()) > HARDLY_ANY
        self._handedness.note(scan, odom_base, told.angular)
        self._aim.note(scan, odom_base)
        self._swing.note(scan, odom_base)
        if self._handedness.is_mirrored:
            return what_to_set(scan)
        if self._obedience.is_lacking:
            return DOES_NOT_MOVE
        if self._aim.off is not None:
            return how_to_aim(scan, self._aim.off)
        if self._swing.stretch is not None:
            return how_to_turn(self._swing.stretch)
        if self._swing.place is not None:
            return how_to_place(scan, self._swing.place)
        return _SEES_NOTHING if self._has_hit and not self._has_seen else None

    def note_motion(self, odom_base: Pose, told: Twist, free_s: float) -> None:
        """Account for so many seconds in which nothing kept the base from what it was told."""
        self._obedience.note(odom_base, told, free_s)

    def note_hit(self, cause: Cause) -> None:
        """Account for something that was felt; a laser that sees shows all but a cliff."""
        self._has_hit = self._has_hit or cause != "cliff"
