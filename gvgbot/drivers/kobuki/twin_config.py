"""Which base is simulated, and its imperfections."""

import re
from dataclasses import dataclass, field
from typing import Annotated

from gvgbot.drivers.kobuki.mishaps import MishapConfig
from gvgbot.drivers.kobuki.odometry_error import OdometryProfile
from gvgbot.drivers.link_faults import LinkFaultConfig
from gvgbot.ranges import Range

_VERSION = re.compile(r"[0-9]{1,3}(\.[0-9]{1,3}){2}")
_LARGEST = 255  # a number is a byte


@dataclass(frozen=True, slots=True, kw_only=True)
class KobukiTwinConfig:
    """The simulated base: what it says it is, and how it errs."""

    odometry: OdometryProfile = "kobuki"  # profile of the errors of wheels and gyro
    # stops by itself after this long without a command
    command_timeout_s: Annotated[float, Range(0.1, 60.0)] = 1.5
    has_command_timeout: bool = True  # false: drives on for ever on its last command
    max_wheel_speed_mps: Annotated[float, Range(0.1, 5.0)] = 0.7  # of each wheel
    motor_power_delay_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # first motion after standing
    dead_time_s: Annotated[float, Range(0.0, 1.0)] = 0.06  # from a command to its first effect
    battery_v: Annotated[float, Range(0.0, 25.5)] = 16.1  # when it is switched on
    battery_drain_v_per_h: Annotated[float, Range(0.0, 10.0)] = 0.5  # while it runs
    battery_charge_v_per_h: Annotated[float, Range(0.0, 10.0)] = 1.5  # on the dock or the adapter
    has_adapter: bool = False  # plugged in when it is switched on
    dock: tuple[float, float, float] | None = None  # x (m), y (m), the way it faces (rad)
    hardware_version: str = "1.0.4"  # what it answers when asked
    firmware_version: str = "1.2.0"  # likewise; decides what it can do
    mishaps: MishapConfig = field(default_factory=MishapConfig)
    link: LinkFaultConfig = field(default_factory=LinkFaultConfig)

    def __post_init__(self) -> None:
        """Raises ValueError for a version that no base could answer."""
        for key in ("hardware_version", "firmware_version"):
            text = getattr(self, key)
            if not _VERSION.fullmatch(text) or max(map(int, text.split("."))) > _LARGEST:
                raise ValueError(f"{key} = {text!r}: must be three numbers, such as 1.2.0")
