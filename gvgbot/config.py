"""The configuration: one frozen tree of what every part of the robot needs to know."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.localisation import Localisation
from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig
from gvgbot.drivers.kobuki.driver import KobukiConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.foxglove.config import FoxgloveConfig
from gvgbot.hal.guard import GuardConfig
from gvgbot.names import is_robot_name
from gvgbot.ranges import Range
from gvgbot.recording.config import RecordingConfig
from gvgbot.ros2.config import Ros2Config
from gvgbot.strict_yaml import has_section, load, load_text, packaged
from gvgbot.team.member import TeamConfig
from gvgbot.team.troubles import TroublesConfig
from gvgbot.telemetry_config import TelemetryConfig

DEFAULT = "sim.yaml"
_SLIPPED_RAD = 0.4  # turned by a wheel of a Kobuki that slips by 9 cm between two scans


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """The robot as a body: its name on the network, its footprint and its limits."""

    name: str = "gvgbot"  # on the network: letters, digits, - and _
    # circle around the turning point that holds the whole robot
    radius_m: Annotated[float, Range(0.05, 2.0)] = 0.177
    limits: GuardConfig = field(default_factory=GuardConfig)

    def __post_init__(self) -> None:
        """Raises ValueError for a name that cannot be part of a topic."""
        if not is_robot_name(self.name):
            raise ValueError(f"name = {self.name!r}: must be letters, digits, - and _ only")


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinConfig:
    """The simulated world and devices."""

    enabled: bool = True  # false: the devices are real, and the robot moves
    world: str = "office"  # a built-in world, or the path of a map_server YAML
    unknown: Literal["free", "wall"] = "free"  # what a map_server map does not know
    start: tuple[float, float, float] | None = None  # x (m), y (m), theta (rad); None: the world's
    people: Annotated[int | None, Range(0, 100)] = None  # who walk about; None: the world's own
    # draws all errors of the twins, and the ways of people
    seed: Annotated[int, Range(0, 2**32 - 1)] = 1
    time_limit_s: Annotated[float, Range(1.0, 1e6)] = 14_400.0  # simulated; then `explore` ends
    laser: HokuyoTwinConfig = field(default_factory=HokuyoTwinConfig)
    base: KobukiTwinConfig = field(default_factory=KobukiTwinConfig)
    team: TroublesConfig = field(default_factory=TroublesConfig)  # of `explore --robots`


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceConfig:
    """Where a daemon keeps what must outlive it."""

    state_dir: str | None = None  # runs are in it and go on there; None: $STATE_DIRECTORY, if set
    resume: Literal["running", "paused"] = "running"  # what an interrupted run does when it goes on
    map: Path | None = None  # directory of an earlier run; its map is begun with, as by --map
    home_when_low: bool = True  # a busy robot drives to where it started when its battery is low


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The root of every configuration file: a section for each part, named after its module."""

    robot: RobotConfig = field(default_factory=RobotConfig)
    laser: HokuyoConfig = field(default_factory=HokuyoConfig)
    base: KobukiConfig = field(default_factory=KobukiConfig)
    twin: TwinConfig = field(default_factory=TwinConfig)
    autonomy: AutonomyConfig = field(default_factory=AutonomyConfig)
    exploration: ExplorationConfig = field(default_factory=ExplorationConfig)
    localisation: Localisation = "full"  # paper: odometry between vertices, as it was published
    service: ServiceConfig = field(default_factory=ServiceConfig)
    telemetry: TelemetryConfig = field(default_factory=TelemetryConfig)
    team: TeamConfig = field(default_factory=TeamConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
    ros2: Ros2Config = field(default_factory=Ros2Config)
    foxglove: FoxgloveConfig = field(default_factory=FoxgloveConfig)

    def __post_init__(self) -> None:
        """Raises ValueError for parts that do not go together."""
        self._tell_its_ports_apart()
        self._leave_the_router_its_address()
        self._obey_the_guard_at_once()

    @property
    def mind(self) -> AutonomyConfig:
        """As configured; without a gyro, each scan also tells how far a wheel has slipped."""
        matching = self.autonomy.scan_matching
        if self.base.heading != "wheels" or matching.search_rad:
            return self.autonomy
        matching = replace(matching, search_rad=_SLIPPED_RAD)
        return replace(self.autonomy, scan_matching=matching)

    def _tell_its_ports_apart(self) -> None:
        laser, base = self.laser.port, self.base.port
        if not self.twin.enabled and os.path.realpath(laser) == os.path.realpath(base):
            told = laser if laser == base else f"{laser} and {base}"
            raise ValueError(
                f"laser.port and base.port are one and the same port, {told}: "
                "set each to the port that its device is plugged into"
            )

    def _leave_the_router_its_address(self) -> None:
        taken = set(self.telemetry.listen) & set(self.ros2.connect)
        if self.ros2.enabled and self.telemetry.enabled and taken:
            raise ValueError(
                f"telemetry.listen and ros2.connect both have {min(taken)}, where rmw_zenohd is: "
                "set telemetry.listen=[tcp/127.0.0.1:7448], for example"
            )

    def _obey_the_guard_at_once(self) -> None:
        """The guard has ramped its twists; a gentler base would drive on, or on another arc."""
        for key in ("max_braking_mps2", "max_angular_acceleration_radps2"):
            base, planned = getattr(self.base, key), getattr(self.robot.limits, key)
            if base is not None and base < planned:
                raise ValueError(
                    f"base.{key} = {base:g} is less than robot.limits.{key} = {planned:g}, by "
                    "which the robot keeps clear of obstacles: "
                    f"set robot.limits.{key} to {base:g} or less"
                )


def load_config(path: Path | None = None, overrides: Sequence[str] = ()) -> Config:
    """The configuration of a file, or of a packaged one by its name; None: the simulation.

    Raises ConfigError that lists every mistake of the file and of the overrides (`a.b=c`).
    """
    return load(Config, packaged(DEFAULT if path is None else path), overrides)


def doubt_of_devices(path: Path | None, overrides: Sequence[str] = ()) -> str:
    """Why somebody may not have meant the devices to be simulated: a file that tells nothing of it.

    Empty if there is no reason to doubt.
    """
    if path is None or has_section("twin", packaged(path), overrides):
        return ""
    return f"{path} has no section twin, where enabled: false stands for real devices"


def config_in(text: str, source: str, overrides: Sequence[str] = ()) -> Config:
    """The configuration in a text (YAML), with overrides put on top.

    Raises ConfigError; `source` is what mistakes in the text are blamed on.
    """
    return load_text(Config, text, source, overrides)
