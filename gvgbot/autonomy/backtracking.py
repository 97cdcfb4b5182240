"""Going back over where the robot came from, when nothing that it knows is in sight."""

from gvgbot.autonomy.control.company import Companion
from gvgbot.autonomy.control.edge_follower import Track
from gvgbot.autonomy.control.orders import ARRIVED_M
from gvgbot.autonomy.own_way import own_way
from gvgbot.autonomy.views import View
from gvgbot.autonomy.whereabouts import Whereabouts


class Backtracking:
    """Once for each target, before it is given up: until a known vertex is in sight."""

    def __init__(self) -> None:
        self.sees_known = False  # a vertex at least, in the present view
        self.is_on = False
        self._was_on = False  # for the present target

    def begin(self) -> bool:
        """Go back, if that may help and has not been tried for this target; whether it does."""
        if self.sees_known or self._was_on:
            return False
        self.is_on = self._was_on = True
        return True

    def track(self, view: View, where: Whereabouts, company: list[Companion]) -> Track | None:
        """The way back; None when known vertices are in sight, or it cannot go farther."""
        track = own_way(where.way_back(view.local_base.position), view, company)
        return None if self.sees_known or track.length < ARRIVED_M else track

    def end(self) -> None:
        """Go back no farther."""
        self.is_on = False

    def renew(self) -> None:
        """Allow it once more: there is another target."""
        self._was_on = False
