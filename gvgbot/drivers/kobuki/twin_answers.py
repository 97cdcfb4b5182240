"""What a simulated base tells when it is asked: versions, its number, and its gains."""

from dataclasses import astuple

from gvgbot.drivers.kobuki.commands import Extra, GetGain, RequestExtra, SetGain
from gvgbot.drivers.kobuki.payloads import (
    ControllerInfo,
    FeedbackPart,
    FirmwareVersion,
    HardwareVersion,
    Udid,
    Version,
)
from gvgbot.drivers.kobuki.sub_payloads import Unknown

_FACTORY_GAINS = ControllerInfo(0, 100_000, 100, 2_000)
_FIRST_WITH_GAINS = (1, 2, 0)  # firmware
_LAST_WITH_SHORT_VERSIONS = (1, 1, 1)  # firmware
_HARDWARE_ID, _FIRMWARE_ID = 10, 11
_FIRMWARE_1_0_0 = 123  # the one number whose digits are not the version

Question = RequestExtra | SetGain | GetGain


class Answers:
    """The replies that are due with the next frame, one of a kind, that they fit into it."""

    def __init__(self, hardware: str, firmware: str, udid: Udid) -> None:
        """Versions are written as major.minor.patch."""
        self._hardware, self._firmware = _version(hardware), _version(firmware)
        self._udid = udid
        self._gains = _FACTORY_GAINS
        self._due: dict[type, FeedbackPart] = {}

    def hear(self, question: Question) -> None:
        """Take in what is asked, or set."""
        match question:
            case RequestExtra(flags):
                self._tell(flags)
            case SetGain(kind, p, i, d) if self._has_gains:
                self._gains = ControllerInfo(kind, p, i, d) if kind else _FACTORY_GAINS
            case GetGain() if self._has_gains:
                self._due[ControllerInfo] = self._gains

    def take(self) -> list[FeedbackPart]:
        """The replies that are due, as sent; after that none are."""
        due, self._due = self._due, {}
        return [self._as_sent(reply) for reply in due.values()]

    def _tell(self, flags: int) -> None:
        if flags & Extra.HARDWARE:
            self._due[HardwareVersion] = HardwareVersion(self._hardware)
        if flags & Extra.FIRMWARE:
            self._due[FirmwareVersion] = FirmwareVersion(self._firmware)
        if flags & Extra.UDID:
            self._due[Udid] = self._udid

    @property
    def _has_gains(self) -> bool:
        return astuple(self._firmware) >= _FIRST_WITH_GAINS

    def _as_sent(self, reply: FeedbackPart) -> FeedbackPart:
        """The reply, or the two bytes in which early firmware tells a version."""
        if astuple(self._firmware) <= _LAST_WITH_SHORT_VERSIONS:
            match reply:
                case HardwareVersion(version):
                    return Unknown(_HARDWARE_ID, _digits(version).to_bytes(2, "little"))
                case FirmwareVersion(Version(1, 0, 0)):
                    return Unknown(_FIRMWARE_ID, _FIRMWARE_1_0_0.to_bytes(2, "little"))
                case FirmwareVersion(version):
                    return Unknown(_FIRMWARE_ID, _digits(version).to_bytes(2, "little"))
        return reply


def _digits(version: Version) -> int:
    return 100 * version.major + 10 * version.minor + version.patch


def _version(text: str) -> Version:
    major, minor, patch = map(int, text.split("."))
    return Version(major, minor, patch)
