"""Who stands about in a world, or stood where nobody has looked since: no map can know better."""

import math
from dataclasses import dataclass, field

import numpy as np

from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose

STOOD_S = 10.0  # for so long
STAYS_M = 0.5  # who stays within this stands, on one foot or on the other
LOOKED_S = 3.0  # that a place must be in sight to be known again,
SEEN_M, SEEN_RAD = 4.0, math.radians(120.0)  # from so near, and so far to either side
_RIM = 0.3 * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])  # m, of somebody
_ALONG = np.linspace(0.0, 1.0, 80)  # of the way to him


@dataclass(slots=True, eq=False)
class Standers:
    """Takes down who stands about, and who has gone from where he stood."""

    world: World
    stood: list[Array] = field(default_factory=list)  # places (2,), m, of all
    _stands: dict[int, tuple[Array, float]] = field(default_factory=dict)  # where, since when (s)
    _left: list[tuple[Array, float]] = field(default_factory=list)  # where, s it was in sight since
    _looked_at: float = 0.0

    def look(self, centres: Array, robot: Pose, now: float) -> None:
        """Take down where people (N, 2) are, and which places the robot looks at, at a time, s."""
        passed, self._looked_at = now - self._looked_at, now
        for number, centre in enumerate(centres):
            place, since = self._stands.get(number, (centre, now))
            if np.hypot(*(centre - place)) > STAYS_M:
                if now - since > STOOD_S:
                    self._left.append((place, 0.0))
                place, since = centre, now
            self._stands[number] = place.copy(), since
        self._left = [
            (place, seen + passed * self._is_seen(place, robot)) for place, seen in self._left
        ]
        self.stood += self.standing(now)

    def standing(self, now: float) -> list[Array]:
        """Where somebody stands for long."""
        return [place for place, since in self._stands.values() if now - since > STOOD_S]

    @property
    def unseen(self) -> list[Array]:
        """Where somebody stood, and the robot has not come back to look."""
        return [place for place, seen in self._left if seen < LOOKED_S]

    def _is_seen(self, place: Array, robot: Pose) -> bool:
        """Whether all of a place is before the robot, near, and not behind a wall."""
        x, y = robot.inverse().transform(place)
        if math.hypot(x, y) > SEEN_M or abs(math.atan2(y, x)) > SEEN_RAD:
            return False
        lines = robot.position + _ALONG[:, None, None] * (place + _RIM - robot.position)
        columns, rows = ((lines - self.world.origin) / self.world.resolution_m).astype(int).T
        return not self.world.occupied[rows, columns].any()
