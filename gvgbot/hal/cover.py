"""Notices what covers a laser though it says that nothing is within range: walls do not vanish."""

from dataclasses import dataclass, replace

import numpy as np

from gvgbot.hal.messages import Scan

MANY = 0.2  # share of the beams: more than a turning robot can lose from sight between two scans
HARDLY_ANY = 0.01
SOON = 0.5  # s from one scan to the next; after longer, the robot may be elsewhere


@dataclass(slots=True)
class Cover:
    """Judges the scans of one laser, one after the other.

    `stamp` is that of the newest (s, None before the first), `seen` the share of beams that
    measured a range in the newest that was believed.
    """

    stamp: float | None = None
    seen: float = 0.0

    def judge(self, scan: Scan) -> Scan:
        """The scan; with nothing trusted in it if all that was seen has vanished at once."""
        is_sequel = self.stamp is not None and scan.stamp - self.stamp <= SOON
        self.stamp = scan.stamp
        seen = float(np.count_nonzero(np.isfinite(scan.ranges))) / max(len(scan.ranges), 1)
        if is_sequel and seen < HARDLY_ANY and self.seen >= MANY:
            return replace(scan, ranges=np.full(len(scan.ranges), np.nan))
        self.seen = seen
        return scan
