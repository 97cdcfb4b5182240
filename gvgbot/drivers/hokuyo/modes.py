"""Which scans to ask for: as configured if the link can carry them, else the next best."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from gvgbot.drivers.hokuyo.config import HokuyoConfig
from gvgbot.drivers.hokuyo.models import Parameters
from gvgbot.drivers.hokuyo.scip_messages import ScanRequest

BITS_PER_BYTE = 10  # on a serial line, with start and stop bit
LONGEST_IN_TWO_CHARACTERS = 4094  # mm; the next number also stands for everything beyond
COARSEST = 3  # steps per beam, before fewer scans are better than coarser ones
MOST_SKIPPED = 9
WHOLE = 1e-9  # of a step or a scan, so that rounding does not cost one


@dataclass(frozen=True, slots=True)
class Mode:
    """The scans that are asked for; `adapted` says what was changed for the link, and why.

    `transfer` is how long the link is busy with each of them (s).
    """

    request: ScanRequest
    adapted: str | None = None
    transfer: float = 0.0


def configured_request(config: HokuyoConfig, parameters: Parameters) -> ScanRequest:
    """What the configuration asks of this laser. Raises ValueError if no beam is left."""
    first, last = _steps(config, parameters)
    letters = ("M" if config.echo == "single" else "N", "E" if config.wants_intensities else "D")
    skip = _skip(config, parameters) if config.skip is None else config.skip
    wanted = ScanRequest(
        "".join(letters), first, last, config.cluster, skip, string=config.user_string
    )
    return _in_whole_groups(wanted)


def _in_whole_groups(request: ScanRequest) -> ScanRequest:
    """Without the last steps that make no whole group: its middle would be elsewhere.

    Raises ValueError if nothing is left.
    """
    steps = request.end - request.start + 1
    if steps < request.group:
        raise ValueError(f"laser.cluster is {request.group}, and there are {steps} steps only")
    return replace(request, end=request.end - steps % request.group)


def _skip(config: HokuyoConfig, parameters: Parameters) -> int:
    every = round(1.0 / (config.rate_hz * parameters.period))
    return min(max(every - 1, 0), MOST_SKIPPED)


def _steps(config: HokuyoConfig, parameters: Parameters) -> tuple[int, int]:
    """The first and last step within the configured angles. Raises ValueError without any."""
    low, high = math.radians(config.first_angle_deg), math.radians(config.last_angle_deg)
    if config.upside_down:
        low, high = -high, -low
    turn = parameters.step_angle
    first = max(parameters.first_step, math.ceil(parameters.front_step + low / turn - WHOLE))
    last = min(parameters.last_step, math.floor(parameters.front_step + high / turn + WHOLE))
    if last <= first:
        raise ValueError("the laser has no beam between first_angle_deg and last_angle_deg")
    return first, last


def frame_bytes(request: ScanRequest) -> int:
    """How long the message of one scan is, with a single echo per step."""
    characters = request.values * request.width * request.numbers
    lines = math.ceil(characters / 64)
    echo, status, stamp, end = len(request.text()) + 1, 4, 6, 1
    return echo + status + stamp + characters + 2 * lines + end


def transfer_time(request: ScanRequest, baud: int | None) -> float:
    """How long a link of this rate (bit/s; None: fast enough) is busy with one scan, s."""
    return 0.0 if baud is None else frame_bytes(request) * BITS_PER_BYTE / baud


def fits(request: ScanRequest, parameters: Parameters, baud: int | None) -> bool:
    """Whether a link of this rate (bit/s; None: fast enough) carries the scans as they come."""
    return transfer_time(request, baud) <= parameters.period * (request.skip + 1)


def choose_mode(config: HokuyoConfig, parameters: Parameters, baud: int | None) -> Mode:
    """The configured scans, or the best that the link (bit/s; None: fast enough) can carry.

    Up to a cluster of `COARSEST` the rate is kept, then scans are left out. Ranges of two
    characters are preferred to coarser beams where the configured range does not need more.
    Raises ValueError if nothing fits.
    """
    wanted = configured_request(config, parameters)
    if not config.adapt or fits(wanted, parameters, baud):
        return Mode(wanted, transfer=transfer_time(wanted, baud))
    for request in _alternatives(wanted, config, parameters):
        if fits(request, parameters, baud):
            change = _changes(wanted, request, parameters, baud)
            return Mode(request, change, transfer_time(request, baud))
    raise ValueError(f"no scans fit into {baud} bit/s: raise laser.baud or narrow the angles")


def _alternatives(
    wanted: ScanRequest, config: HokuyoConfig, parameters: Parameters
) -> Iterator[ScanRequest]:
    is_short = min(config.max_range_m * 1000, parameters.range_max_mm) <= LONGEST_IN_TWO_CHARACTERS
    commands = [wanted.command]
    if is_short and wanted.command == "MD":
        commands.append("MS")
    for skip in range(wanted.skip, MOST_SKIPPED + 1):
        for cluster in range(wanted.group, max(wanted.group, COARSEST) + 1):
            for command in commands:
                request = replace(wanted, command=command, cluster=cluster, skip=skip)
                yield _in_whole_groups(request)


def _changes(
    wanted: ScanRequest, request: ScanRequest, parameters: Parameters, baud: int | None
) -> str:
    changes = [
        f"{name} {getattr(request, name)} instead of {getattr(wanted, name)}"
        for name in ("command", "cluster", "skip")
        if getattr(request, name) != getattr(wanted, name)
    ]
    return f"{', '.join(changes)}: {wanted.command} needs {_needed(wanted, parameters)} of {baud}"


def _needed(request: ScanRequest, parameters: Parameters) -> str:
    rate = frame_bytes(request) * BITS_PER_BYTE / (parameters.period * (request.skip + 1))
    return f"{rate:.0f} bit/s"


def link_rate(config: HokuyoConfig, baud: int, port_name: str, sbps: str) -> int | None:
    """The link's bit/s, None where it is faster than any scan.

    `port_name` is the configured port with links resolved, `sbps` the laser's own account of its
    bit rate, which says USB or Ethernet on lasers that have nothing else. A pseudo-terminal has no
    rate of its own.
    """
    is_fast = "ttyACM" in port_name or "USB" in sbps or "Ethernet" in sbps
    is_fast = is_fast or (port_name.startswith("/dev/pts/") and "bps" not in sbps)
    match config.link:
        case "serial":
            return baud
        case "auto" if not is_fast and not port_name.startswith("tcp:"):
            return baud
    return None
