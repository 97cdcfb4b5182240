"""Ways that something stood in, and when they are worth another try."""

from collections.abc import Iterable, Mapping

from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId


class Obstructions:
    """Closes half-edges for a while: frontiers are not chosen, edges not driven."""

    def __init__(self, retries: int, retry_after: float) -> None:
        """Each is opened again so many times, so many seconds after it was closed."""
        self._retries, self._retry_after = retries, retry_after
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
            if self._times[end] <= most:
                self._since[end] = stamp

    def rename(self, renamed: Mapping[HalfEdgeId, HalfEdgeId]) -> None:
        """Take over what half-edges are called now whose vertices proved to be known ones."""
        self._times = {renamed.get(end, end): times for end, times in self._times.items()}
        self._since = {renamed.get(end, end): since for end, since in self._since.items()}

    def open(self, graph: GvgGraph, stamp: float) -> bool:
        """Unblock what was closed long enough ago; whether there was something."""
        due = [end for end, since in self._since.items() if stamp - since >= self._retry_after]
        for end in due:
            del self._since[end]
            half = graph.half_edge(end)
            if half is not None:
                half.blocked = False
        return bool(due)
