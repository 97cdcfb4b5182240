"""What the robot says on the network: the table of topics, and the types that travel."""

from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

from gvgbot.ranges import Range

Phase = Literal["starting", "exploring", "halted", "finished"]
Priority = Literal["interactive_high", "data_high", "data", "data_low"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TelemetryConfig:
    """Where the robot can be watched; loopback only, unless the configuration opens it."""

    enabled: bool = True
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    lease_s: Annotated[float, Range(0.5, 60.0)] = (
        2.0  # silence after which the robot counts as gone
    )

    def __post_init__(self) -> None:
        """Raises ValueError for addresses that cannot be listened on."""
        for endpoint in self.listen:
            if len(endpoint.split("/")) != 2 or not all(endpoint.split("/")):
                raise ValueError(
                    f"listen = {endpoint!r}: must be protocol/address, such as tcp/0.0.0.0:7447"
                )
        if self.enabled and not self.listen:
            raise ValueError("listen is empty: give an address, or set enabled: false")


class LinkHealth(msgspec.Struct, frozen=True, kw_only=True):
    """What has come over the link to a device since the robot's program began."""

    connected: bool  # whether its values come just now
    messages: int  # that were understood: scans of a laser, frames of a base
    damaged: int  # that came, but not whole
    lost: int  # that the device's own stamps or counter show to be missing
    reconnects: int  # how often it came back after it was lost
    clock_offset: float | None  # s, the robot's clock minus the device's; None while unknown


class State(msgspec.Struct, frozen=True, kw_only=True):
    """The robot in a nutshell. SI units; poses in the map frame, whose origin is the start.

    A frozen program is told by `cycles`, which then stands still while the network link lives on.
    """

    stamp: float  # s, the robot's monotonic clock
    sequence: int  # of this message, from 0
    cycles: int  # control cycles so far
    cycle_age: float | None  # s since the last one, None before the first
    phase: Phase
    outcome: str | None  # explored, explored_with_blocked, failed; None while exploring
    reason: str  # for the outcome, or for being halted
    pose: tuple[float, float, float]  # map_base: x, y, theta
    covariance: tuple[float, ...]  # of the pose, 3x3 row-major
    twist: tuple[float, float]  # as measured: m/s ahead, rad/s anticlockwise
    battery_voltage: float | None
    battery_fraction: float | None  # of a full charge, 0..1
    vertices: int
    edges: int
    frontiers: int
    distance: float  # m driven
    guard: str | None  # why the guard changes what autonomy wants; None while it does not
    contacts: int  # times that a bumper was pressed
    slips: int  # times that gyro and wheels began to disagree
    laser: LinkHealth
    base: LinkHealth


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the table.

    `history` samples are kept for those who come late; `queryable` topics answer with the newest.
    """

    name: str
    payload: type[msgspec.Struct]
    version: int
    rate_hz: float
    priority: Priority
    history: int
    queryable: bool

    def key(self, robot: str) -> str:
        """The key expression of a robot's topic."""
        return f"gvgbot/{robot}/{self.name}"

    @property
    def encoding(self) -> str:
        """Format, type and version of the payload, as they travel with every sample."""
        return f"application/msgpack;gvgbot.{self.payload.__name__}.v{self.version}"


STATE = Topic("state", State, 1, 5.0, "data_high", 0, queryable=True)
TOPICS = (STATE,)


def alive_key(robot: str) -> str:
    """The key expression of the liveliness token that a robot holds while it is there."""
    return f"gvgbot/{robot}/alive"
