"""What to do when no frontier is left, before all is called explored."""

import math

from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.situation import Situation
from gvgbot.autonomy.views import IN_FULL_VIEW_M, View, touching
from gvgbot.geometry import Array

_SAME_M = 1.0  # what may be a vertex is seen elsewhere from elsewhere, by less than that


class Examination:
    """Of what is in sight: something there may prove to be a vertex.

    Its end is not the end of the exploration at once: the robot may have something else to do.
    """

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self._since: float | None = None  # stamp
        self._aim: Array | None = None  # what it drives to: (2,), local frame
        # aims at which nothing was left to be seen, and from how near, m
        self._dispelled: list[tuple[Array, float]] = []
        self.is_over = False

    def end(self) -> None:
        """Examine anew next time: there is something to explore."""
        self._since, self.is_over = None, False
        self._aim, self._dispelled = None, []

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def path(self, view: View, here: Situation, patience_s: float) -> tuple[Branch, ...] | None:
        """To the nearest thing that may be a vertex; None if there is none, or no time left."""
        if self._since is None:
            self._since = view.stamp
        if view.stamp - self._since >= patience_s:
            return None
        self._look_at_aim(view, here)
        felt = touching(here.gvg, view.felt)  # looking on tells no more of it
        paths = [
            (metres, node, path)
            for node, (metres, path) in here.gvg.routes(here.place).items()
            if node not in felt and self._may_be_new(view, here, node)
        ]
        if not paths:
            return None
        _, node, path = min(paths)
        self._aim = here.gvg.nodes[node].position
        return path

    def _look_at_aim(self, view: View, here: Situation) -> None:
        """Note if it has proved to be none: it may seem to be one again from farther off."""
        aim, self._aim = self._aim, None
        place = None if aim is None else here.gvg.place(aim)
        if aim is None or place is None or place.distance > _SAME_M:
            return
        away = math.dist(aim, view.local_base.position)
        seen = (node.position for node in here.gvg.nodes.values() if node.may_be_vertex)
        if away < IN_FULL_VIEW_M and all(math.dist(aim, one) > _SAME_M for one in seen):
            self._dispelled.append((aim, away))

    def _may_be_new(self, view: View, here: Situation, node: int) -> bool:
        """Whether a node in sight may prove to be a vertex that the map lacks."""
        seen, known = here.gvg.nodes[node], here.known
        if here.in_team and node in here.doubted:
            return False
        away = math.dist(seen.position, view.local_base.position)
        if any(
            math.dist(one, seen.position) < _SAME_M and away > near for one, near in self._dispelled
        ):
            return False
        is_open = seen.may_be_vertex and node not in known.vertex_of
        return is_open and not self._mapper.explains(view, known, seen.position)
