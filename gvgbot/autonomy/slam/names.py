"""What is called otherwise since a vertex proved to be a known one."""

from collections.abc import Mapping

from gvgbot.autonomy.slam.graph import HalfEdgeId


class Names:
    """Half-edges and vertices by what they were called once.

    Who remembers one by the name it had then finds it again even if the two are parted later.
    """

    def __init__(self) -> None:
        self._now: dict[HalfEdgeId, HalfEdgeId] = {}

    def half_edge(self, then: HalfEdgeId) -> HalfEdgeId:
        """What a half-edge is called now."""
        return self._now.get(then, then)

    def vertex(self, then: int) -> int:
        """What a vertex is called now."""
        return next((new.vertex for old, new in self._now.items() if old.vertex == then), then)

    def change(self, renamed: Mapping[HalfEdgeId, HalfEdgeId]) -> None:
        """The half-edges of a vertex belong to another one."""
        self._now = {old: renamed.get(new, new) for old, new in self._now.items()} | dict(renamed)

    def forget(self) -> None:
        """All are called what they were called before."""
        self._now.clear()
