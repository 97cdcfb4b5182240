"""What somebody can ask the robot to do, and the stops on the way."""

from dataclasses import dataclass

from gvgbot.autonomy.slam.graph import HalfEdgeId


@dataclass(frozen=True, slots=True)
class ToVertex:
    """Drive to a vertex."""

    vertex: int

    def __str__(self) -> str:
        return f"goto {self.vertex}"


@dataclass(frozen=True, slots=True)
class ToPoint:
    """Drive to a point, m, map frame."""

    x: float
    y: float

    def __str__(self) -> str:
        return f"goto {self.x:g} {self.y:g}"


@dataclass(frozen=True, slots=True)
class Home:
    """Drive to where the robot started."""

    x: float = 0.0
    y: float = 0.0

    def __str__(self) -> str:
        return "home"


@dataclass(frozen=True, slots=True)
class Look:
    """Doubt the pose, and look around."""

    def __str__(self) -> str:
        return "relocalise"


@dataclass(frozen=True, slots=True)
class Patrol:
    """Drive from vertex to vertex, over and over; none named means all there are."""

    vertices: tuple[int, ...] = ()

    def __str__(self) -> str:
        return " ".join(["patrol", *map(str, self.vertices)])


@dataclass(frozen=True, slots=True)
class Coverage:
    """Drive over every edge."""

    def __str__(self) -> str:
        return "coverage"


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A stop at which the robot does not stop: metres `station` from the half-edge `end`."""

    end: HalfEdgeId
    station: float

    def __str__(self) -> str:
        return f"over an edge of vertex {self.end.vertex}"


@dataclass(frozen=True, slots=True)
class Rest:
    """A stop of some seconds where the robot is."""

    seconds: float


Stop = ToVertex | ToPoint | Home | Look | Waypoint | Rest
Errand = ToVertex | ToPoint | Home | Look | Patrol | Coverage
