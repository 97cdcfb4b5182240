"""What a mission asks of somebody who knows what other robots do."""

from collections.abc import Collection, Sequence
from typing import Protocol

from gvgbot.autonomy.exploration.paths import Approach
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.geometry import Array


class Sharing(Protocol):
    """Shares the frontiers with other robots."""

    def choose(self, graph: GvgGraph, starts: list[Approach]) -> tuple[HalfEdgeId, Approach] | None:
        """The frontier that is worth most to this robot, and the way there; None: not one.

        Who asks without a vertex of its own is where others have driven.
        """

    def keeps(self, target: HalfEdgeId, graph: GvgGraph, starts: list[Approach]) -> bool:
        """Whether a frontier is still worth a drive of this robot.

        Who follows it starts from its vertex, with less than no metres.
        """

    def has_driven(self, line: Array, *, either_way: bool = False) -> bool:
        """Whether others have driven along a line (N, 2), m, map frame, in its direction.

        With `either_way` that may have been against it.
        """

    @property
    def is_waiting(self) -> bool:
        """Whether others are on their way to all that is left: it may come back to this robot."""

    @property
    def is_done(self) -> bool:
        """Whether every frontier that this robot can reach has been followed by somebody."""

    @property
    def is_explored(self) -> bool:
        """Whether no departure that any robot knows of is open, also none that is closed now."""

    @property
    def known_to_others(self) -> Sequence[Array]:
        """Lines (N, 2), m, map frame, of the others' edges, when the robot was done last.

        So are those of edges that it has driven in part, and others the rest.
        """

    @property
    def unfollowed(self) -> Collection[HalfEdgeId]:
        """Departures of this robot's map that nobody has followed, open or closed."""
