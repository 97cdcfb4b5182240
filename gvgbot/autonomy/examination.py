"""What to do when no frontier is left, before all is called explored."""

from gvgbot.autonomy.gvg.local import Branch
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.views import View
from gvgbot.autonomy.whereabouts import Situation


class Examination:
    """Of what is in sight: something there may prove to be a vertex.

    Its end is not the end of the exploration at once: the robot may have something else to do.
    """

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self._since: float | None = None  # stamp
        self.is_over = False

    def end(self) -> None:
        """Examine anew next time: there is something to explore."""
        self._since, self.is_over = None, False

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def path(self, view: View, here: Situation, patience_s: float) -> tuple[Branch, ...] | None:
        """To the nearest thing that may be a vertex; None if there is none, or no time left."""
        if self._since is None:
            self._since = view.stamp
        if view.stamp - self._since >= patience_s:
            return None
        paths = [
            (metres, node, path)
            for node, (metres, path) in here.gvg.routes(here.place).items()
            if self._may_be_new(view, here, node)
        ]
        return min(paths)[2] if paths else None

    def _may_be_new(self, view: View, here: Situation, node: int) -> bool:
        """Whether a node in sight may prove to be a vertex that the map lacks."""
        seen, known = here.gvg.nodes[node], here.known
        if here.in_team and node in here.doubted:
            return False
        is_open = seen.may_be_vertex and node not in known.vertex_of
        return is_open and not self._mapper.explains(view, known, seen.position)
