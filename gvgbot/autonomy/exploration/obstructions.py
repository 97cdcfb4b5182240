"""Ways that something stood in, and when they are worth another try."""

from collections.abc import Iterable

from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.autonomy.slam.names import Names


class Obstructions:
    """Closes half-edges for a while: frontiers are not chosen, edges not driven.

    It knows them by what they were called when they were closed.
    """

    def __init__(self, retries: int, retry_after: float, names: Names) -> None:
        """Each is opened again so many times, so many seconds after it was closed."""
        self._retries, self._retry_after, self._names = retries, retry_after, names
        self._times: dict[HalfEdgeId, int] = {}  # that it was closed
        self._since: dict[HalfEdgeId, float] = {}  # stamps of those that will be opened again

    @property
    def waiting(self) -> bool:
        """Whether something closed will be tried again."""
        return bool(self._since)

    def close(
        self,
        graph: GvgGraph,
        ends: Iterable[HalfEdgeId],
        stamp: float,
        *,
        retries: int | None = None,
    ) -> None:
        """Block these ends, to be opened again at most so many times, if not as often as others."""
        most = self._retries if retries is None else min(retries, self._retries)
        for end in ends:
            half = graph.half_edge(end)
            if half is None:
                continue
            half.blocked = True
            self._times[end] = self._times.get(end, 0) + 1
            if sum(n for e, n in self._times.items() if self._names.half_edge(e) == end) <= most:
                self._since[end] = stamp

    def open(self, graph: GvgGraph, stamp: float) -> bool:
        """Unblock what was closed long enough ago; whether there was something."""
        due = [end for end, since in self._since.items() if stamp - since >= self._retry_after]
        for end in due:
            del self._since[end]
            half = graph.half_edge(self._names.half_edge(end))
            if half is not None:
                half.blocked = False
        return bool(due)
