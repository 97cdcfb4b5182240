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
from gvgbot.log_order import LONGEST_PAUSE_S, Line, in_order
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
_STEADY, _MOSTLY = 0.01, 0.9  # m and rad; of the sweeps
_COARSE, _TIMELESS = 0.5, 0.95  # shares of the motion at stamps that are the same
_DIGITS = 4  # of a place on the base
_HITS = 0.01  # share of all beams that hit something at least; in millimetres hardly any does
_MANY, _OFTEN = 3, 0.01  # beams of a sweep that have the same range; of the sweeps


@dataclass(frozen=True, slots=True, eq=False)
class CarmenLog:
    """What a log holds, each by its stamp, and which of its lines, from 1, were left out.

    At those in `set_back` its clock was. An archive that `is_cut` ends before the log does.
    """

    odometry: list[Odometry]
    scans: list[Scan]
    damaged_lines: list[int]
    set_back: list[int]
    is_cut: bool

    @property
    def damaged(self) -> int:
        """How many lines were left out."""
        return len(self.damaged_lines)

    @property
    def pauses(self) -> int:
        """How often it goes on after so long that nothing is known of the time between."""
        stamps = pairwise(one.stamp for one in self.odometry)
        return sum(later - earlier > LONGEST_PAUSE_S for earlier, later in stamps)

    @property
    def hits(self) -> float:
        """The share of all beams that hit something."""
        return float(np.isfinite(np.concatenate([scan.ranges for scan in self.scans])).mean())

    @property
    def spacing_m(self) -> float:
        """How far it drove from one scan to the next, on average."""
        way = pairwise(one.odom_base for one in self.odometry)
        return sum(a.distance(b) for a, b in way) / len(self.scans)

    @property
    def likely_no_echo_m(self) -> float | None:
        """The greatest range, if so many beams have it that nothing can have been hit there."""
        sweeps = [scan.ranges[np.isfinite(scan.ranges)] for scan in self.scans]
        greatest = max((float(ranges.max(initial=0.0)) for ranges in sweeps), default=0.0)
        often = sum(int((ranges == greatest).sum()) >= _MANY for ranges in sweeps)
        return greatest if often > _OFTEN * len(sweeps) else None

    @property
    def timeless(self) -> float:
        """The share of its motion (m and rad) for which the clock of the base stands still."""
        steps = np.diff(rows_of(one.odom_base for one in self.odometry), axis=0)
        motion = np.hypot(steps[:, 0], steps[:, 1]) + np.abs(wrap_angles(steps[:, 2]))
        still = motion[np.diff([one.stamp for one in self.odometry]) == 0.0].sum()
        return float(still / motion.sum()) if still else 0.0


def read_carmen(path: Path, *, no_echo_m: float, base_laser: Pose) -> CarmenLog:
    """The odometry and the scans of a log, plain or packed with gzip, bzip2 or xz.

    A FLASER sweep covers the half-circle ahead, or what lasers with so many beams cover. Ranges
    from `no_echo_m` on, or from the greatest that a ROBOTLASER1 line says it can measure, mean
    that nothing was hit. The base's pose at each scan counts as odometry too. The laser is at
    `base_laser`, or where the log has it if that is the middle of the base. The logger's stamps
    count where most others are the same. Raises UsageError for a file that cannot be read, is no
    text, or has no sweep, no times, or no ranges in metres in it.
    """
    log = _read(path, no_echo_m, by_logger=False)
    if log.timeless > _COARSE:
        log = min(log, _read(path, no_echo_m, by_logger=True), key=attrgetter("timeless"))
    if not log.scans:
        damage = f": {first_of('damaged lines', log.damaged_lines)}" if log.damaged else ""
        raise UsageError(
            f"{path} is no recording (MCAP), and as a CARMEN log it has no FLASER or ROBOTLASER1 "
            f"line to read{damage}"
        )
    if log.timeless > _TIMELESS:
        raise UsageError(
            f"{path}: nearly all its lines have the same stamp as the next; give them their own, "
            "in s"
        )
    if log.hits < _HITS:
        raise UsageError(
            f"{path}: hardly any range is less than {no_echo_m:g} m: if they are in another unit, "
            "make them metres; if its laser reaches farther, give --no-echo METRES"
        )
    return replace(log, scans=_mounted(log.scans, base_laser))


def _read(path: Path, no_echo_m: float, *, by_logger: bool) -> CarmenLog:
    """A log by the stamps of those who sent the messages, or of the logger. Raises UsageError."""
    lines, damaged, is_cut = list[Line](), list[int](), False
    for number, text in enumerate(_lines(path), start=1):
        if text is None:
            is_cut = True
            break
        try:
            match _words(text, by_logger=by_logger):
                case ["ODOM", *words]:
                    lines.append(Line(number, _odometry(words), None))
                case ["FLASER" | "ROBOTLASER1" as kind, *words]:
                    sweep = _sweep if kind == "FLASER" else _robot_sweep
                    lines.append(sweep(number, words, no_echo_m))
        except ValueError:
            damaged.append(number)
    kept, set_back = in_order(lines)
    left_out = {line.number for line in lines} - {line.number for line in kept}
    return CarmenLog(
        odometry=[line.odometry for line in kept],
        scans=[line.scan for line in kept if line.scan is not None],
        damaged_lines=sorted([*damaged, *left_out]),
        set_back=set_back,
        is_cut=is_cut,
    )


def first_of(what: str, lines: list[int]) -> str:
    """How many lines, and where to look."""
    return f"{what}: {len(lines)}, the first in line {lines[0]}"


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


def _sweep(number: int, words: list[str], no_echo_m: float) -> Line:
    """Its scan is from where it has the laser. Raises ValueError."""
    beams = int(words[0]) if words else 0
    if beams < 2 or len(words) != 1 + beams + _TAIL:
        raise ValueError(words)
    laser, base, stamp = _poses(words[beams + 1 : beams + 7], words[beams + 7])
    steps = beams - beams % 2  # 180 or 181 beams are a degree apart
    field = math.radians(_FIELDS_DEG.get(steps, 180.0))
    ranges = _ranges(words[1 : 1 + beams], no_echo_m)
    at = base.to(laser)
    scan = Scan(stamp, ranges, -field / 2, field / steps, 0.0, no_echo_m, base_laser=at)
    return Line(number, Odometry(stamp, base, STANDSTILL), scan)


def _robot_sweep(number: int, words: list[str], no_echo_m: float) -> Line:
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
    return Line(number, Odometry(stamp, base, STANDSTILL), scan)


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
        parts = max(1, math.ceil(gap / _LONGEST_GAP_S)) if gap <= LONGEST_PAUSE_S else 1
        for part in range(1, parts):
            share = part / parts
            stamp = earlier.stamp + share * gap
            odom_base = earlier.odom_base.towards(later.odom_base, share)
            yield Odometry(stamp, odom_base, later.twist)
        yield later
