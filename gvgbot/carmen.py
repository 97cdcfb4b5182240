"""Logs in the text form of CARMEN: dead reckoning (`ODOM`) and laser sweeps.

    ODOM x y theta tv rv accel stamp host logger_stamp
    FLASER n r1 .. rn  laser_x laser_y laser_theta  x y theta  stamp host logger_stamp
    ROBOTLASER1 type start fov resolution max accuracy mode  n r1 .. rn  m remission1 .. m
        laser_x laser_y laser_theta  x y theta  tv rv forward side axis  stamp host logger_stamp

Metres, radians and seconds. Other lines are passed over.
"""

import bz2
import gzip
import lzma
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import BufferedReader
from itertools import pairwise
from operator import attrgetter
from pathlib import Path

import numpy as np

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.loop import Cycle
from gvgbot.errors import UsageError
from gvgbot.geometry import STANDSTILL, Array, Pose, rows_of, wrap_angles
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.recording import Lived

_GZIP, _BZIP2, _XZ = b"\x1f\x8b", b"BZh", b"\xfd7zXZ"  # how packed files begin
_BEGINNING = 64  # bytes, in which what is no text has a zero
_TAIL = 9  # words of a FLASER line after the ranges
_HEAD, _ROBOT_TAIL = 7, 14  # words of a ROBOTLASER1 line before and after its two lists
_ODOM_WORDS = 10
_STAMP, _HOST, _LOGGER_STAMP = -3, -2, -1  # the last words of each line
_FIELDS_DEG = {400: 100.0, 540: 270.0, 1080: 270.0}  # of sweeps with so many steps; others 180
_FULL_TURN = math.tau + 1e-3  # of a sweep, with rounding
_LARGEST = 1e10  # m, rad or s since 1970; what is beyond comes of a damaged line
_LONGEST_GAP_S = 0.2  # between messages; logs leave some out
_LONGEST_PAUSE_S = 300.0  # what is longer comes of a clock that was set, or of a damaged stamp
_JUMP_M, _JUMP_MPS = 10.0, 10.0  # from one pose to the next; what is beyond both is no motion
_STEADY, _MOSTLY = 0.01, 0.9  # m and rad; of the sweeps
_DIGITS = 4  # of a place on the base
_MANY, _OFTEN = 3, 0.01  # beams of a sweep that have the same range; of the sweeps


@dataclass(frozen=True, slots=True, eq=False)
class CarmenLog:
    """What a log holds, each by its stamp; `damaged` lines were left out.

    An archive that `is_cut` ends before the log does.
    """

    odometry: list[Odometry]
    scans: list[Scan]
    damaged: int
    is_cut: bool

    @property
    def pauses(self) -> int:
        """How often it goes on after so long that nothing is known of the time between."""
        stamps = pairwise(one.stamp for one in self.odometry)
        return sum(later - earlier > _LONGEST_PAUSE_S for earlier, later in stamps)

    @property
    def likely_no_echo_m(self) -> float | None:
        """The greatest range, if so many beams have it that nothing can have been hit there."""
        sweeps = [scan.ranges[np.isfinite(scan.ranges)] for scan in self.scans]
        greatest = max((float(ranges.max(initial=0.0)) for ranges in sweeps), default=0.0)
        often = sum(int((ranges == greatest).sum()) >= _MANY for ranges in sweeps)
        return greatest if often > _OFTEN * len(sweeps) else None

    @property
    def is_timeless(self) -> bool:
        """Whether the base moves while its clock stands still."""
        stamps = {one.stamp for one in self.odometry}
        return len(stamps) == 1 and len({one.odom_base for one in self.odometry}) > 1


def read_carmen(path: Path, *, no_echo_m: float, base_laser: Pose) -> CarmenLog:
    """The odometry and the scans of a log, plain or packed with gzip, bzip2 or xz.

    A FLASER sweep covers the half-circle ahead, or what lasers with so many beams do. Ranges from `no_echo_m` on, or from the greatest
    that a ROBOTLASER1 line says it can measure, mean that nothing was hit. The base's pose at each
    scan counts as odometry too. The laser is at `base_laser`, or where the log has it if that is
    the middle of the base. The logger's stamps count where all others are the same. Raises
    UsageError for a file that cannot be read, is no text, or has no sweep or no times in it.
    """
    log = _read(path, no_echo_m, by_logger=False)
    if log.is_timeless:
        log = _read(path, no_echo_m, by_logger=True)
    if not log.scans:
        raise UsageError(
            f"{path} is no recording (MCAP), and as a CARMEN log it has no FLASER or ROBOTLASER1 "
            "line to read"
        )
    if log.is_timeless:
        raise UsageError(f"{path}: all its lines have the same stamp; give them their own, in s")
    return replace(log, scans=_mounted(log.scans, base_laser))


def _read(path: Path, no_echo_m: float, *, by_logger: bool) -> CarmenLog:
    """A log by the stamps of those who sent the messages, or of the logger. Raises UsageError."""
    odometry, scans, damaged, is_cut = list[Odometry](), list[Scan](), 0, False
    for line in _lines(path):
        if line is None:
            is_cut = True
            break
        try:
            match _words(line, by_logger=by_logger):
                case ["ODOM", *words]:
                    odometry.append(_odometry(words))
                case ["FLASER" | "ROBOTLASER1" as kind, *words]:
                    sweep = _sweep if kind == "FLASER" else _robot_sweep
                    scan, at = sweep(words, no_echo_m)
                    scans.append(scan)
                    odometry.append(at)
        except ValueError:
            damaged += 1
    return replace(_in_order(odometry, scans, damaged), is_cut=is_cut)


def _in_order(odometry: list[Odometry], scans: list[Scan], damaged: int) -> CarmenLog:
    """A log in the order of its stamps, without those that must be damaged."""
    by_stamp = attrgetter("stamp")
    strays = _strays(sorted({one.stamp for one in odometry}))
    timely = sorted((one for one in odometry if one.stamp not in strays), key=by_stamp)
    within_reach = _within_reach(timely)
    kept = {one.stamp for one in within_reach}
    return CarmenLog(
        within_reach,
        sorted((scan for scan in scans if scan.stamp in kept), key=by_stamp),
        damaged + len(odometry) - len(within_reach),
        is_cut=False,
    )


def _mounted(scans: list[Scan], base_laser: Pose) -> list[Scan]:
    """The scans of a laser that does not move on its base."""
    if base_laser == Pose():
        base_laser = _steady_place([scan.base_laser for scan in scans])
    return [replace(scan, base_laser=base_laser) for scan in scans]


def _steady_place(places: list[Pose]) -> Pose:
    """Where a laser is all along; the middle if it moves, as when somebody corrected its poses."""
    if not places:
        return Pose()
    found = rows_of(places)
    turn = float(np.angle(np.exp(1j * found[:, 2]).sum()))
    found[:, 2] = turn + wrap_angles(found[:, 2] - turn)  # one that looks back is at pi and -pi
    middle = np.median(found, axis=0)
    is_there = np.abs(found - middle).max(axis=1) < _STEADY
    if is_there.mean() <= _MOSTLY:
        return Pose()
    return Pose(*middle.round(_DIGITS).tolist())


def _strays(stamps: list[float]) -> set[float]:
    """Those of ascending stamps that are far from all others, unless all are."""
    gaps = [math.inf, *(later - earlier for earlier, later in pairwise(stamps)), math.inf]
    nearest = map(min, pairwise(gaps))
    found = {s for s, gap in zip(stamps, nearest, strict=False) if gap > _LONGEST_PAUSE_S}
    return found if len(found) < len(stamps) else set()


def _within_reach(odometry: list[Odometry]) -> list[Odometry]:
    """Those to which a base can have driven, on and back from the longest way without a jump."""
    pairs = enumerate(pairwise(odometry), start=1)
    jumps = [k for k, (earlier, later) in pairs if not _can_reach(earlier, later)]
    stretches = pairwise([0, *jumps, len(odometry)])
    end = max(stretches, key=lambda stretch: stretch[1] - stretch[0])[1]
    return [*_reached(odometry[:end][::-1])[::-1], *_reached(odometry[end - 1 :])[1:]]


def _reached(odometry: list[Odometry]) -> list[Odometry]:
    """Those that can be reached from the one before that can be, as the first is."""
    reached = odometry[:1]
    for one in odometry[1:]:
        if _can_reach(reached[-1], one):
            reached.append(one)
    return reached


def _can_reach(one: Odometry, other: Odometry) -> bool:
    a, b = one.odom_base, other.odom_base
    return math.hypot(b.x - a.x, b.y - a.y) <= max(
        _JUMP_M, _JUMP_MPS * abs(other.stamp - one.stamp)
    )


def _lines(path: Path) -> Iterator[str | None]:
    """The lines, as far as the file goes; None after those of an archive that was cut."""
    try:
        with _opened(path) as file:
            if b"\0" in file.peek(_BEGINNING)[:_BEGINNING]:
                raise UsageError(
                    f"{path} is neither a recording (MCAP) nor a CARMEN log; if it is an archive, "
                    "give the log that is in it"
                )
            yield from (line.decode(errors="replace") for line in file)
    except EOFError:
        yield None
    except (OSError, zlib.error, lzma.LZMAError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UsageError(f"cannot read {path}: {reason}") from error


def _opened(path: Path) -> gzip.GzipFile | bz2.BZ2File | lzma.LZMAFile | BufferedReader:
    """A log, unpacked if it is packed. Raises OSError."""
    with path.open("rb") as file:
        start = file.read(_BEGINNING)
    if start.startswith(_GZIP):
        return gzip.open(path)
    if start.startswith(_BZIP2):
        return bz2.open(path)
    if start.startswith(_XZ):
        return lzma.open(path)
    return path.open("rb")


def _words(line: str, *, by_logger: bool) -> list[str]:
    """Raises ValueError for a line with a zero in it, as a power cut leaves it."""
    if "\0" in line:
        raise ValueError(line)
    words = line.split()
    if by_logger:
        words[_STAMP:_HOST] = words[_LOGGER_STAMP:]
    return words


def _odometry(words: list[str]) -> Odometry:
    """Raises ValueError."""
    if len(words) != _ODOM_WORDS - 1:
        raise ValueError(words)
    x, y, theta, stamp = _numbers([*words[:3], words[6]])
    return Odometry(stamp, Pose(x, y, theta), STANDSTILL)


def _sweep(words: list[str], no_echo_m: float) -> tuple[Scan, Odometry]:
    """A scan, from where the line has the laser, and where the base was. Raises ValueError."""
    beams = int(words[0]) if words else 0
    if beams < 2 or len(words) != 1 + beams + _TAIL:
        raise ValueError(words)
    laser, base, stamp = _poses(words[beams + 1 : beams + 7], words[beams + 7])
    steps = beams - beams % 2  # 180 or 181 beams are a degree apart
    field = math.radians(_FIELDS_DEG.get(steps, 180.0))
    ranges = _ranges(words[1 : 1 + beams], no_echo_m)
    at = base.to(laser)
    scan = Scan(stamp, ranges, -field / 2, field / steps, 0.0, no_echo_m, base_laser=at)
    return scan, Odometry(stamp, base, STANDSTILL)


def _robot_sweep(words: list[str], no_echo_m: float) -> tuple[Scan, Odometry]:
    """The same of a line that says itself how the laser looks. Raises ValueError."""
    head, (found, rest) = words[:_HEAD], _listed(words[_HEAD:])
    _, tail = _listed(rest)
    if len(found) < 2 or len(tail) != _ROBOT_TAIL:
        raise ValueError(words)
    start, step, range_max = _numbers([head[1], head[3], head[4]])
    laser, base, stamp = _poses(tail[:6], tail[11])
    if range_max <= 0.0 or not 0.0 < step * (len(found) - 1) <= _FULL_TURN:
        raise ValueError(words)
    range_max = min(range_max, no_echo_m)
    ranges = _ranges(found, range_max)
    scan = Scan(stamp, ranges, start, step, 0.0, range_max, base_laser=base.to(laser))
    return scan, Odometry(stamp, base, STANDSTILL)


def _poses(words: list[str], stamp: str) -> tuple[Pose, Pose, float]:
    """Of the laser and of the base, with their stamp. Raises ValueError."""
    x, y, theta, base_x, base_y, base_theta, at = _numbers([*words, stamp])
    return Pose(x, y, theta), Pose(base_x, base_y, base_theta), at


def _listed(words: list[str]) -> tuple[list[str], list[str]]:
    """A list with its length before it, and what follows. Raises ValueError."""
    count = int(words[0]) if words else -1
    if not 0 <= count < len(words):
        raise ValueError(words)
    return words[1 : 1 + count], words[1 + count :]


def _ranges(words: list[str], range_max: float) -> Array:
    """Numbers, and inf and nan as in logs converted from those of ROS. Raises ValueError."""
    ranges = np.array([float(word) for word in words])
    if (np.abs(ranges[np.isfinite(ranges)]) > _LARGEST).any():
        raise ValueError(words)
    ranges[ranges >= range_max] = np.inf
    ranges[ranges <= 0.0] = np.nan
    return ranges


def _numbers(words: list[str]) -> list[float]:
    """Numbers that something can have measured. Raises ValueError."""
    numbers = [float(word) for word in words]
    if not all(abs(number) <= _LARGEST for number in numbers):
        raise ValueError(words)
    return numbers


def messages(log: CarmenLog) -> Iterator[tuple[float, Lived]]:
    """A log as a robot would have lived through it, by the stamps."""
    scans = iter(log.scans)
    scan = next(scans, None)
    for odometry in _without_gaps(log.odometry):
        yield odometry.stamp, Cycle(odometry, Felt(), STANDSTILL, STANDSTILL)
        while scan is not None and scan.stamp <= odometry.stamp:
            yield odometry.stamp, scan
            scan = next(scans, None)


def _without_gaps(odometry: list[Odometry]) -> Iterator[Odometry]:
    """The messages, and evenly spread ones in between, but none in pauses."""
    yield from odometry[:1]
    for earlier, later in pairwise(odometry):
        gap = later.stamp - earlier.stamp
        parts = max(1, math.ceil(gap / _LONGEST_GAP_S)) if gap <= _LONGEST_PAUSE_S else 1
        for part in range(1, parts):
            share = part / parts
            stamp = earlier.stamp + share * gap
            odom_base = earlier.odom_base.towards(later.odom_base, share)
            yield Odometry(stamp, odom_base, later.twist)
        yield later
