"""What happened, as values; each becomes a line of events.jsonl."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VertexAdded:
    """A meetpoint or endpoint entered the map."""

    stamp: float
    vertex: int
    kind: str
    x: float
    y: float
    degree: int
    clearance: float


@dataclass(frozen=True, slots=True)
class VertexRemoved:
    """A vertex proved to be none on a closer look."""

    stamp: float
    vertex: int
    reason: str


@dataclass(frozen=True, slots=True)
class VertexMoved:
    """A vertex proved to stand so many metres elsewhere: somebody stood there as it was found."""

    stamp: float
    vertex: int
    metres: float


@dataclass(frozen=True, slots=True)
class EdgeJoined:
    """Two half-edges proved to be the ends of one edge, by driving it or by seeing all of it."""

    stamp: float
    start: int
    end: int
    length: float
    driven: bool


@dataclass(frozen=True, slots=True)
class LoopClosed:
    """A known vertex was recognised after the robot had been away; with what the tests measured.

    `away_m` is driven since the vertex was seen last, on the map of another run by who made that
    too; None for a vertex of an imported map, at the first time.
    """

    stamp: float
    vertex: int
    away_m: float | None
    mahalanobis: float
    offset_m: float
    agreement: float  # share of its walls found again


@dataclass(frozen=True, slots=True)
class PlaceDoubted:
    """A vertex entered the map that may be a known one: the next vertices decide.

    There is one for each known vertex that it may be, likeliest first.
    """

    stamp: float
    vertex: int
    known: int  # the vertex that it may be
    cost: float  # of taking it for that one: minus twice the log likelihood
    novelty: float  # of taking it for a new one


@dataclass(frozen=True, slots=True)
class DoubtSettled:
    """It became certain which vertex a doubted one is, or that it is a new one."""

    stamp: float
    vertex: int
    known: int | None  # the vertex that it is, and has become part of; None: it is a new one
    margin: float  # by which any other reading costs more: minus twice the log likelihood
    offset_m: float | None  # between the two just before


@dataclass(frozen=True, slots=True)
class ClosureRevoked:
    """A closure was taken back, with all that was found since: the next vertices contradict it."""

    stamp: float
    vertex: int


@dataclass(frozen=True, slots=True)
class Decision:
    """Where to go next, and why."""

    stamp: float
    vertex: int | None
    bearing: float | None
    reason: str


@dataclass(frozen=True, slots=True)
class Recovery:
    """The robot was stuck or lost its edge, and did something about it."""

    stamp: float
    action: str
    reason: str


@dataclass(frozen=True, slots=True)
class Finished:
    """Exploration ended."""

    stamp: float
    outcome: str
    reason: str


@dataclass(frozen=True, slots=True)
class Requested:
    """Somebody asked for something; what was answered."""

    stamp: float
    request: str
    origin: str
    done: bool  # false: refused
    answer: str


@dataclass(frozen=True, slots=True)
class ErrandEnded:
    """The robot is done with what it was asked for: arrived, given up, replaced or stopped."""

    stamp: float
    errand: str
    outcome: str
    reason: str


@dataclass(frozen=True, slots=True)
class RoundEnded:
    """The robot has been round on patrol; how many vertices it reached, and how many not."""

    stamp: float
    round: int
    reached: int
    missed: int


@dataclass(frozen=True, slots=True)
class WayForgotten:
    """On errands that showed nothing new, the robot keeps only the latest part of its way.

    The first `kept` keyframes, by which it knows the map, stay; so many after them are left out.
    It keeps none where it begins a new map.
    """

    stamp: float
    kept: int
    left_out: int


Event = (
    VertexAdded
    | VertexRemoved
    | VertexMoved
    | EdgeJoined
    | LoopClosed
    | PlaceDoubted
    | DoubtSettled
    | ClosureRevoked
    | Decision
    | Recovery
    | Finished
    | Requested
    | ErrandEnded
    | RoundEnded
    | WayForgotten
)
