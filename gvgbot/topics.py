"""What the robot says on the network: the table of topics, and the types that travel."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from gvgbot.tiles import Grid

Phase = Literal["starting", "exploring", "errand", "waiting", "paused", "halted", "finished"]
TeamPart = Literal["team", "course"]  # what robots know; and where each is and drives
Priority = Literal["interactive_high", "data_high", "data", "data_low"]

_POINT, _POSE, _TIME, _RANGE = 8, 12, 8, 2  # bytes of what travels packed
_COVARIANCE = 9  # of a pose: 3 by 3


class LinkHealth(msgspec.Struct, frozen=True, kw_only=True):
    """What has come over the link to a device since the robot's program began."""

    connected: bool  # whether its values come just now
    messages: int  # that were understood: scans of a laser, frames of a base
    damaged: int  # that came, but not whole
    lost: int  # that the device's own stamps or counter show to be missing
    reconnects: int  # how often it came back after it was lost
    clock_offset: float | None  # s, the robot's clock minus the device's; None while unknown


class Mate(msgspec.Struct, frozen=True, kw_only=True):
    """Another robot of the team, in the map of this one."""

    name: str  # its `robot.name`
    pose: tuple[float, float, float]  # x, y, theta: m and rad


class State(msgspec.Struct, frozen=True, kw_only=True):
    """The robot in a nutshell. SI units; poses in the map frame, whose origin is the start.

    A frozen program is told by `cycles`, which then stands still while the network link lives on.
    """

    stamp: float  # s, the robot's monotonic clock
    sequence: int  # of this message, from 0
    cycles: int  # control cycles so far
    cycle_age: float | None  # s since the last one, None before the first
    phase: Phase
    outcome: str | None  # explored, explored_with_blocked, failed, stopped; None before
    reason: str  # for the outcome, or for being halted, or why it is not sure where it is
    errand: str | None = None  # what it was asked to do just now, such as goto 7
    requests: tuple[str, ...] = ()  # what it may be asked for, as its configuration says
    uptime: float = 0.0  # s since the robot's program began
    pose: tuple[float, float, float]  # map_base: x, y, theta
    covariance: tuple[float, ...]  # of the pose, 3x3 row-major; 1e6 on its diagonal: it is unknown
    twist: tuple[float, float]  # as measured: m/s ahead (of the last 0.1 s), rad/s anticlockwise
    battery_voltage: float | None
    battery_fraction: float | None  # of a full charge, 0..1
    vertices: int
    edges: int
    frontiers: int  # of its own map; those of a team that has explored all were followed by others
    distance: float  # m driven
    guard: str | None  # why the guard changes what autonomy wants; None while it does not
    contacts: int  # times that a bumper was pressed
    slips: int  # times that gyro and wheels began to disagree
    laser: LinkHealth
    base: LinkHealth
    team: tuple[Mate, ...] = ()  # the other robots, as far as this one knows where they are

    def __post_init__(self) -> None:
        """Raises ValueError for a covariance that is none of a pose."""
        if len(self.covariance) != _COVARIANCE:
            raise ValueError(f"a covariance of {len(self.covariance)} instead of {_COVARIANCE}")

    @property
    def is_lost(self) -> bool:
        """Whether the robot does not know where it is: its pose means nothing."""
        return self.covariance[0] >= UNKNOWN

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position, m, in the direction in which it is largest."""
        xx, xy, _, _, yy = self.covariance[:5]
        return math.sqrt(max(0.0, (xx + yy) / 2 + math.hypot((xx - yy) / 2, xy)))


def _check_whole(data: bytes, size: int) -> None:
    """Raises ValueError unless bytes are so many items of a size (bytes)."""
    if len(data) % size:
        raise ValueError(f"{len(data)} bytes are no whole number of items of {size}")


def packed(points: NDArray[np.floating]) -> bytes:
    """Points (N, 2), m, as they travel: little-endian float32 pairs."""
    return points.astype("<f4").tobytes()


class MapVertex(msgspec.Struct, frozen=True, kw_only=True):
    """A vertex of the graph, where it is believed to be now; map frame."""

    id: int
    kind: Literal["meetpoint", "endpoint"]
    position: tuple[float, float]  # m
    covariance: tuple[float, float, float, float]  # of the position, 2x2 row-major, m^2
    clearance: float  # m to the nearest walls
    frontiers: tuple[float, ...]  # rad, where edges leave that were never followed


class MapEdge(msgspec.Struct, frozen=True, kw_only=True):
    """An edge of the graph, from one vertex to another or to itself; map frame."""

    start: int  # id of a vertex
    end: int  # id of a vertex
    length: float  # m
    points: bytes  # little-endian float32 pairs x, y, m, from start to end

    def __post_init__(self) -> None:
        """Raises ValueError for a part of a point."""
        _check_whole(self.points, _POINT)

    @property
    def polyline(self) -> NDArray[np.float32]:
        """The points (N, 2), m; read-only."""
        return np.frombuffer(self.points, "<f4").reshape(-1, 2)


class Map(msgspec.Struct, frozen=True, kw_only=True):
    """The graph so far, corrected by every loop closure. Sent when it has grown; map frame."""

    stamp: float  # s, the robot's monotonic clock
    vertices: tuple[MapVertex, ...]
    edges: tuple[MapEdge, ...]
    virtual_walls: bytes = b""  # little-endian float32 pairs x, y, m: points 0.1 m apart

    def __post_init__(self) -> None:
        """Raises ValueError for a part of a point."""
        _check_whole(self.virtual_walls, _POINT)

    @property
    def forbidden(self) -> NDArray[np.float32]:
        """The points (N, 2), m, of the virtual walls; read-only."""
        return np.frombuffer(self.virtual_walls, "<f4").reshape(-1, 2)


class Trajectory(msgspec.Struct, frozen=True, kw_only=True):
    """The way driven so far, thinned to at most 2,000 poses. Sent when it has grown; map frame.

    The poses are those that the robot believed in at the time, until a loop closes: then all are
    corrected.
    """

    stamp: float  # s, the robot's monotonic clock
    stamps: bytes  # little-endian float64, s: when it was there
    poses: bytes  # little-endian float32 triples x, y, theta, m and rad: map_base at these times
    breaks: tuple[int, ...] = ()  # poses, from 0, to which no way is known: it was carried there

    def __post_init__(self) -> None:
        """Raises ValueError unless there is a time for each pose."""
        _check_whole(self.stamps, _TIME)
        _check_whole(self.poses, _POSE)
        if len(self.stamps) // _TIME != len(self.poses) // _POSE:
            raise ValueError("there is not a time for each pose")

    @property
    def times(self) -> NDArray[np.float64]:
        """The stamps (N,), s; read-only."""
        return np.frombuffer(self.stamps, "<f8")

    @property
    def map_base(self) -> NDArray[np.float32]:
        """The poses (N, 3): x, y, theta; read-only."""
        return np.frombuffer(self.poses, "<f4").reshape(-1, 3)

    @property
    def stretches(self) -> list[NDArray[np.float32]]:
        """The positions (N, 2), m, from break to break: lines that were driven; one at least."""
        return np.split(self.map_base[:, :2], self.breaks)


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """How the robot's program and its links are doing."""

    stamp: float  # s, the robot's monotonic clock
    uptime: float  # s since the robot's program began
    cycles: int  # control cycles so far
    late_cycles: int  # those of them that acted on odometry older than 0.1 s
    slowest_cycle: float  # s, the oldest odometry acted on since the message before
    cpu: float  # cores that the program has kept busy since the message before
    memory: int  # bytes of it that are in the machine's memory
    unsent: int  # samples that the network would not take
    laser: LinkHealth
    base: LinkHealth


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that happened."""

    number: int  # from 0, since the robot's program began
    stamp: float  # s, the robot's monotonic clock
    kind: str  # as `event` in events.jsonl: vertex_added, decision and others
    details: dict[str, str | int | float | bool | None]  # its other fields, as in events.jsonl


class Events(msgspec.Struct, frozen=True, kw_only=True):
    """The latest events, oldest first. Sent when something has happened.

    Each message has up to 64 of them, so that one that is lost is made up for by the next.
    """

    events: tuple[Event, ...]


class Scan(msgspec.Struct, frozen=True, kw_only=True):
    """One sweep of the laser, as it came, and where the robot believed to be.

    Sent only while somebody listens. Beam i points to `angle_min + i * angle_increment` in the
    frame of the laser, anticlockwise.
    """

    stamp: float  # s, the robot's monotonic clock, of the first beam
    time_increment: float  # s from one beam to the next
    angle_min: float  # rad
    angle_increment: float  # rad
    range_max: float  # m; what reflects well may be seen from farther off
    base_laser: tuple[float, float, float]  # the laser on the robot: x, y, theta
    map_base: tuple[float, float, float] | None  # at the middle of the sweep; None if not known
    ranges: bytes  # little-endian uint16, mm; 0: nothing trusted, 65535: nothing within range

    def __post_init__(self) -> None:
        """Raises ValueError for a part of a range."""
        _check_whole(self.ranges, _RANGE)

    @property
    def metres(self) -> NDArray[np.float32]:
        """The ranges (N,), m; NaN where nothing is trusted, inf where nothing is within range."""
        metres: NDArray[np.float32] = _METRES[np.frombuffer(self.ranges, "<u2")]
        return metres


class Odometry(msgspec.Struct, frozen=True, kw_only=True):
    """Where the robot is and how it moves. Sent only while somebody listens."""

    stamp: float  # s, the robot's monotonic clock
    map_base: tuple[float, float, float]  # as believed: x, y, theta; see `covariance` of the state
    odom_base: tuple[float, float, float]  # by wheels and gyro alone, since the program began
    twist: tuple[float, float]  # as measured: m/s ahead (of the last 0.1 s), rad/s anticlockwise


class Plan(msgspec.Struct, frozen=True, kw_only=True):
    """Where the robot is about to go, and why. Sent when it has changed; map frame."""

    stamp: float  # s, the robot's monotonic clock
    vertex: int | None  # id of the vertex that the edge to be explored leaves; None without one
    bearing: float | None  # rad, how it leaves there
    reason: str  # of the decision: ear, nearest frontier and others; empty before the first
    track: bytes  # little-endian float32 pairs x, y, m: what is driven now, as far as it is seen
    route: bytes  # the same: known edges from there on, to the vertex

    def __post_init__(self) -> None:
        """Raises ValueError for a part of a point."""
        _check_whole(self.track, _POINT)
        _check_whole(self.route, _POINT)

    @property
    def ahead(self) -> NDArray[np.float32]:
        """The track (N, 2), m; read-only."""
        return np.frombuffer(self.track, "<f4").reshape(-1, 2)

    @property
    def further(self) -> NDArray[np.float32]:
        """The route (N, 2), m; read-only."""
        return np.frombuffer(self.route, "<f4").reshape(-1, 2)


NOTHING_TRUSTED, NOTHING_IN_RANGE = 0, 65535  # instead of a range in mm


def _in_metres() -> NDArray[np.float32]:
    """The range, m, that each uint16 stands for."""
    metres = np.arange(65536, dtype=np.float32) / np.float32(1000.0)
    metres[[NOTHING_TRUSTED, NOTHING_IN_RANGE]] = np.nan, np.inf
    return metres


_METRES = _in_metres()

Payload = State | Map | Grid | Trajectory | Events | Scan | Odometry | Plan | Health


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the table.

    `history` samples are kept for those who come late; `queryable` topics answer with the newest.
    Those without a history are only sent while somebody listens. Those that are sent `on_change`
    send a lost sample again, since the next one may be long in coming.
    """

    name: str
    payload: type[msgspec.Struct]
    version: int
    rate_hz: float
    priority: Priority
    history: int
    queryable: bool
    on_change: bool = False

    def key(self, robot: str) -> str:
        """The key expression of a robot's topic."""
        return f"gvgbot/{robot}/{self.name}"

    @property
    def encoding(self) -> str:
        """Format, type and version of the payload, as they travel with every sample."""
        return f"application/msgpack;gvgbot.{self.payload.__name__}.v{self.version}"


STATE = Topic("state", State, 1, 10.0, "data_high", 1, queryable=True)
MAP = Topic("map", Map, 2, 1.0, "data_low", 1, queryable=True, on_change=True)
GRID = Topic("grid", Grid, 1, 1.0, "data_low", 1, queryable=True, on_change=True)
TRAJECTORY = Topic("trajectory", Trajectory, 1, 1.0, "data_low", 1, queryable=True, on_change=True)
EVENTS = Topic("events", Events, 1, 10.0, "data", 1, queryable=True, on_change=True)
PLAN = Topic("plan", Plan, 1, 2.0, "data", 1, queryable=True, on_change=True)
HEALTH = Topic("health", Health, 1, 1.0, "data", 1, queryable=True)
ODOMETRY = Topic("odometry", Odometry, 1, 20.0, "data_high", 0, queryable=False)
SCAN = Topic("scan", Scan, 1, 40.0, "data", 0, queryable=False)
TOPICS = (STATE, MAP, GRID, TRAJECTORY, EVENTS, PLAN, HEALTH, ODOMETRY, SCAN)
TEAM_PARTS: tuple[TeamPart, ...] = get_args(TeamPart)
HEARTBEAT = 2.0  # s, how often a topic that is sent on change says which sample was its last
UNKNOWN = 1e6  # m^2 and rad^2, the variances of a pose that is not known
EVENTS_KEPT = 64  # in a message
TRAJECTORY_POSES = 2000  # in a message, at most
LATE_AFTER = 0.1  # s, the age of odometry from which a control cycle counts as late
STUCK_AFTER = 1.0  # s without a control cycle, though the base is there


def alive_key(robot: str) -> str:
    """The key expression of the liveliness token that a robot holds while it is there."""
    return f"gvgbot/{robot}/alive"


def team_key(robot: str, part: TeamPart) -> str:
    """The key expression of what a robot tells the other robots of its team."""
    return f"gvgbot/{robot}/{part}"
