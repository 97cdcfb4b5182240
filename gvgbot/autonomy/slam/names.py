"""What is called otherwise since a vertex proved to be a known one."""

from collections.abc import Mapping

from gvgbot.autonomy.slam.graph import HalfEdgeId


class Names:
    """Half-edges and vertices by what they were called once.

    Who remembers one by the name it had then finds it again even if the two are parted later.
    """

    def __init__(self) -> None:
        self.now: Mapping[HalfEdgeId, HalfEdgeId] = {}  # replaced as a whole, never changed

    def half_edge(self, then: HalfEdgeId) -> HalfEdgeId:
        """What a half-edge is called now."""
        return self.now.get(then, then)

    def vertex(self, then: int) -> int:
        """What a vertex is called now."""
        return next((new.vertex for old, new in self.now.items() if old.vertex == then), then)

    def change(self, renamed: Mapping[HalfEdgeId, HalfEdgeId]) -> None:
        """The half-edges of a vertex belong to another one."""
        self.now = {old: renamed.get(new, new) for old, new in self.now.items()} | dict(renamed)
