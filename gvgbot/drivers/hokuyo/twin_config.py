"""Which laser is simulated, and its imperfections."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from gvgbot.drivers.fault_schedule import PerHour, Rate
from gvgbot.drivers.hokuyo.clock_sync import WRAP_MS
from gvgbot.drivers.hokuyo.models import ModelName
from gvgbot.drivers.link_faults import LinkFaultConfig, Moment
from gvgbot.ranges import Range

LaserMishap = Literal["reboot", "frozen", "stalled", "unstable", "abnormal", "blind"]
Fraction = Annotated[float, Range(0.0, 1.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserMishapConfig:
    """How often a simulated laser has each mishap, and how long one lasts."""

    reboots_per_h: PerHour = 0.0  # it comes back as after power-up
    reboots_at_s: tuple[Moment, ...] = ()  # since the twin was first served
    freezes_per_h: PerHour = 0.0  # the last scan comes over and over
    stalls_per_h: PerHour = 0.0  # answers, but sends no scans
    unstable_per_h: PerHour = 0.0  # says that it cannot measure just now
    abnormal_per_h: PerHour = 0.0  # refuses everything until it is rebooted
    blinds_per_h: PerHour = 0.0  # error codes instead of ranges
    duration_s: Annotated[float, Range(0.0, 60.0)] = 1.0  # of each that passes by itself

    @property
    def rates(self) -> dict[str, Rate]:
        """By name of the mishap."""
        lasting: dict[LaserMishap, float] = {
            "frozen": self.freezes_per_h,
            "stalled": self.stalls_per_h,
            "unstable": self.unstable_per_h,
            "blind": self.blinds_per_h,
        }
        sudden: dict[LaserMishap, Rate] = {
            "reboot": Rate(self.reboots_per_h, 0.0, self.reboots_at_s),
            "abnormal": Rate(self.abnormal_per_h, 0.0),
        }
        rates = {str(name): Rate(per_h, self.duration_s) for name, per_h in lasting.items()}
        return rates | {str(name): rate for name, rate in sudden.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class HokuyoTwinConfig:
    """Which laser is simulated, and its imperfections."""

    model: ModelName = "UTM-30LX"  # which laser it is
    range_sigma_m: Fraction = 0.01  # noise of a range
    range_sigma_share: Fraction = 0.0  # of the range, where that is more
    dropout_fraction: Fraction = 0.005  # of the beams: nothing measured
    mixed_pixel_fraction: Fraction = 0.0  # of the edges: a beam between near and far
    double_echo_fraction: Fraction = 0.02  # beams that something thin reflects on their way
    bad_checksum_fraction: Fraction = 0.0  # of the scans
    lost_stop_fraction: Fraction = 0.0  # of the QT that come while scans are sent
    processing_latency_s: Annotated[float, Range(0.0, 0.1)] = 0.00475  # last beam to first byte
    answers_once_per_turn: bool = False  # while it measures, as real lasers do
    clock_drift_ppm: Annotated[float, Range(-1000.0, 1000.0)] = 50.0  # its clock against the host's
    clock_start_ms: Annotated[int, Range(0, WRAP_MS - 1)] = 0  # its clock at power-up
    # its motor turns more slowly by this
    motor_error_ppm: Annotated[float, Range(-50_000.0, 50_000.0)] = 0.0
    serial_baud: Annotated[int, Range(0, 750_000)] = 0  # 0: USB or Ethernet
    boot_s: Annotated[float, Range(0.0, 60.0)] = 0.0  # of silence after power-up
    reboot_s: Annotated[float, Range(0.0, 60.0)] = 1.5  # likewise after a reboot
    starts_in_scip_1: bool = False  # old firmware: SCIP 2 has to be asked for
    starts_abnormal: bool = False  # refuses everything until it is rebooted
    serial_number: str = "H0000001"  # what it answers when asked
    mishaps: LaserMishapConfig = field(default_factory=LaserMishapConfig)
    link: LinkFaultConfig = field(default_factory=LinkFaultConfig)

    def __post_init__(self) -> None:
        """Raises ValueError for a serial number that no laser could answer."""
        number = self.serial_number
        if not (number.isascii() and number.isprintable()) or ";" in number:
            raise ValueError(
                f"serial_number = {number!r}: must be of letters, digits and signs of ASCII, no ;"
            )
