"""CARMEN logs: every field where the format has it, damage counted, no file that surprises."""

import bz2
import gzip
import itertools
import lzma
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gvgbot.carmen import CarmenLog, messages, read_carmen
from gvgbot.errors import UsageError
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from gvgbot.replay import Wanted, open_log

ODOM = "ODOM 1.0 2.0 0.5 0.1 0.2 0.0 7.25 host 3.0"
FLASER = "FLASER 4 1.5 81.83 0.0 2.5 9.0 9.0 9.0 1.1 2.1 0.6 7.5 host 3.25"


def read(path: Path) -> CarmenLog:
    return read_carmen(path, no_echo_m=80.0, base_laser=Pose(0.1, 0.0, 0.0))


def written(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_odometry_and_scans_are_read_by_the_fields_of_the_format(tmp_path: Path) -> None:
    log = read(written(tmp_path / "a.log", "# a comment", "PARAM x y", ODOM, FLASER))
    assert [(o.stamp, o.odom_base) for o in log.odometry] == [
        (7.25, Pose(1.0, 2.0, 0.5)),
        (7.5, Pose(1.1, 2.1, 0.6)),
    ]
    (scan,) = log.scans
    assert (scan.stamp, scan.base_laser, log.damaged) == (7.5, Pose(0.1, 0.0, 0.0), 0)
    np.testing.assert_array_equal(scan.ranges, [1.5, math.inf, math.nan, 2.5])


@pytest.mark.parametrize(
    ("beams", "start_deg", "step_deg"),
    [
        (180, -90.0, 1.0),
        (181, -90.0, 1.0),
        (360, -90.0, 0.5),
        (361, -90.0, 0.5),
        (400, -50.0, 0.25),
        (401, -50.0, 0.25),
        (541, -135.0, 0.5),
        (1081, -135.0, 0.25),
    ],
)
def test_the_count_of_beams_says_how_wide_a_sweep_is(
    beams: int, start_deg: float, step_deg: float, tmp_path: Path
) -> None:
    """As the makers have it: SICK LMS with 180 or 100 degrees, LMS1xx and Hokuyo with 270."""
    line = f"FLASER {beams} {' '.join(['1'] * beams)} 0 0 0 0 0 0 1 h 1"
    (scan,) = read(written(tmp_path / "a.log", line)).scans
    assert math.degrees(scan.angle_increment) == pytest.approx(step_deg)
    assert math.degrees(scan.angle_min) == pytest.approx(start_deg)


ROBOTLASER = (
    "ROBOTLASER1 2 -2.0 4.0 1.0 5.6 0.01 1 5 1.5 5.6 0.0 2.5 9.0 2 77 78"
    " 9.0 9.0 9.0 1.1 2.1 0.6 0.1 0.2 0.3 0.4 1e5 7.5 host 3.25"
)


@pytest.mark.parametrize("line", [FLASER, ROBOTLASER])
def test_ranges_may_be_inf_and_nan_as_in_logs_made_of_those_of_ros(
    line: str, tmp_path: Path
) -> None:
    """There inf is nothing in range, -inf something too near, and nan no measurement."""
    words = line.replace(" 1.5 ", " inf ").replace(" 0.0 2.5 ", " nan -inf ")
    log = read(written(tmp_path / "a.log", words, line))
    scan, _ = log.scans
    assert log.damaged == 0
    np.testing.assert_array_equal(scan.ranges[:4], [math.inf, math.inf, math.nan, math.nan])


def test_a_newer_line_says_itself_how_its_laser_looks(tmp_path: Path) -> None:
    """Type, start, width, step, greatest range, accuracy, mode; readings; remissions; poses."""
    log = read(written(tmp_path / "a.log", ROBOTLASER))
    (scan,), (odometry,) = log.scans, log.odometry
    assert (odometry.stamp, odometry.odom_base) == (7.5, Pose(1.1, 2.1, 0.6))
    assert (scan.stamp, scan.range_max, log.damaged) == (7.5, 5.6, 0)
    np.testing.assert_allclose(scan.bearings, [-2.0, -1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(scan.ranges, [1.5, math.inf, math.nan, 2.5, math.inf])


@pytest.mark.parametrize(
    "line",
    [
        "ROBOTLASER1",
        "ROBOTLASER1 2 -2.0 4.0 1.0 5.6 0.01 1",
        ROBOTLASER.replace(" 5 1.5", " 99 1.5"),
        ROBOTLASER.replace(" 2 77", " 3 77"),
        ROBOTLASER.replace(" 2 77", " -1 77"),
        ROBOTLASER.replace(" 1.0 5.6", " 3.0 5.6"),
        ROBOTLASER[:90],
        "ODOM 1 2",
        "ODOM 1 2 x 0 0 0 7 host 3",
        "ODOM 1 2 nan 0 0 0 7 host 3",
        "ODOM 1 1e300 0 0 0 0 7 host 3",
        "FLASER",
        FLASER.replace("FLASER 4", "FLASER 5"),
        FLASER.replace("1.5", "1.5.5"),
        FLASER.replace("1.5", "-1e300"),
        FLASER[:30],
    ],
)
def test_a_damaged_line_is_counted_and_passed_over(line: str, tmp_path: Path) -> None:
    log = read(written(tmp_path / "a.log", line, FLASER))
    assert (len(log.scans), len(log.odometry), log.damaged) == (1, 1, 1)


@pytest.mark.parametrize("pack", [bytes, gzip.compress], ids=["plain", "packed"])
@pytest.mark.parametrize(
    "line", [ODOM.replace("0.5", "0.\0"), ODOM + "\0", "\0\0\0" + ODOM, "\0" * 5000]
)
def test_a_line_with_a_zero_in_it_is_one_of_the_damaged(
    line: str, pack: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    """Such as the disk had not written when the power was cut; the rest is as good as ever."""
    path = tmp_path / "a.log"
    path.write_bytes(pack("\n".join([FLASER, line, FLASER]).encode()))
    assert (len(read(path).scans), len(read(path).odometry), read(path).damaged) == (2, 2, 1)


def turning(laser_x: float, *, corrected_m: float = 0.0) -> list[str]:
    """Sweeps of a base that turns where it stands, with the laser so far ahead of its middle.

    If they were corrected the laser's poses are shifted by more and more.
    """
    headings = [0.1 * k for k in range(20)]
    return [
        f"FLASER 2 1 1 {laser_x * math.cos(a) + corrected_m * a:.6f} {laser_x * math.sin(a):.6f}"
        f" {a:.6f} 0 0 {a:.6f} {10 * a + 1:.6f} host 0"
        for a in headings
    ]


@pytest.mark.parametrize(
    ("told", "corrected_m", "expected"),
    [(0.0, 0.0, 0.3), (0.1, 0.0, 0.1), (0.0, 0.5, 0.0)],
    ids=["by the log", "by the configuration", "by neither"],
)
def test_the_laser_is_where_it_is_told_to_be(
    told: float, corrected_m: float, expected: float, tmp_path: Path
) -> None:
    path = written(tmp_path / "a.log", *turning(0.3, corrected_m=corrected_m))
    scans = read_carmen(path, no_echo_m=80.0, base_laser=Pose(told, 0.0, 0.0)).scans
    assert {scan.base_laser for scan in scans} == {Pose(expected, 0.0, 0.0)}


def test_a_laser_that_looks_back_is_where_the_log_has_it(tmp_path: Path) -> None:
    """Its heading, rounded, is now a little less than half a turn, now a little more."""
    headings = [0.1 * k for k in range(20)]
    lines = [
        f"FLASER 2 1 1 {0.3 * math.cos(a):.6f} {0.3 * math.sin(a):.6f} "
        f"{a + math.pi + off:.6f} 0 0 {a:.6f} {10 * a + 1:.6f} host 0"
        for a, off in zip(headings, [1e-5, -1e-5] * 10, strict=True)
    ]
    for scan in read_carmen(
        written(tmp_path / "a.log", *lines), no_echo_m=80.0, base_laser=Pose()
    ).scans:
        assert scan.base_laser.distance(Pose(0.3, 0.0, 0.0)) < 1e-3
        assert math.cos(scan.base_laser.theta) == pytest.approx(-1.0)


@pytest.mark.parametrize(("beyond", "told"), [("8.19", 8.19), ("81.91", None), ("0.0", None)])
def test_a_laser_that_gives_its_own_greatest_range_for_no_echo_is_told(
    beyond: str, told: float | None, tmp_path: Path
) -> None:
    """Of a hundred beams a twentieth hits nothing."""
    walls = [f"{2 + 0.05 * k:.2f}" for k in range(95)]
    line = f"FLASER 100 {' '.join([*walls, *[beyond] * 5])} 0 0 0 0 0 0 1 h 1"
    path = written(tmp_path / "a.log", line)
    assert read(path).likely_no_echo_m == told
    log = open_log(Wanted(path=path, config=None, overrides=[], no_echo_m=None))
    assert [flaw.endswith(f"give --no-echo {told}") for flaw in log.flaws()] == [True] * bool(told)


@pytest.mark.parametrize(("step_m", "told"), [(0.9, []), (1.5, ["1.5 m apart"])])
def test_it_says_so_if_scans_have_too_little_in_common(
    step_m: float, told: list[str], tmp_path: Path
) -> None:
    lines = [at(7.5 + k).replace("1.1 2.1", f"{step_m * k:.1f} 2.1") for k in range(50)]
    path = written(tmp_path / "a.log", *lines)
    log = open_log(Wanted(path=path, config=None, overrides=[], no_echo_m=None))
    assert [flaw.split(":")[1].removeprefix("     scans are ") for flaw in log.flaws()] == told


@pytest.mark.parametrize(("no_echo_m", "last"), [(None, 2.5), (2.0, math.inf)])
def test_a_log_is_replayed_as_one_of_carmen_with_what_is_asked_for(
    no_echo_m: float | None, last: float, tmp_path: Path
) -> None:
    path = written(tmp_path / "a.log", FLASER)
    mount = ["laser.x_m=0.2", "laser.yaw_deg=90"]
    log = open_log(Wanted(path=path, config=None, overrides=mount, no_echo_m=no_echo_m))
    (scan,) = (message for _, message in log.messages if isinstance(message, Scan))
    assert log.config.robot.name == "carmen"
    assert scan.base_laser == Pose(0.2, 0.0, math.pi / 2)
    np.testing.assert_array_equal(scan.ranges, [1.5, math.inf, math.nan, last])


def test_lines_that_come_late_are_put_in_order(tmp_path: Path) -> None:
    late = ODOM.replace("7.25", "7.9")
    log = read(written(tmp_path / "a.log", late, FLASER, ODOM))
    assert [o.stamp for o in log.odometry] == [7.25, 7.5, 7.9]


def at(stamp: float) -> str:
    return FLASER.replace("7.5", f"{stamp:.2f}")


@pytest.mark.parametrize("stray", [76052857.0, 1976052857.0, -1e300, 1e300])
def test_a_line_with_a_damaged_stamp_is_one_of_the_damaged(stray: float, tmp_path: Path) -> None:
    lines = [at(976052857.0 + k) for k in range(50)]
    log = read(written(tmp_path / "a.log", *lines[:20], at(stray), *lines[20:]))
    stamps = [976052857.0 + k for k in range(50)]
    assert [scan.stamp for scan in log.scans] == stamps
    assert [one.stamp for one in log.odometry] == stamps
    assert (log.damaged, log.pauses) == (1, 0)


def driving(*stamps: float) -> list[str]:
    """Lines of a robot that drives on at 1 m/s, one a second, with these stamps."""
    return [at(t).replace("1.1 2.1", f"{k:.1f} 2.1") for k, t in enumerate(stamps)]


@pytest.mark.parametrize("seconds", [10.0, 30.0, 3000.0])
def test_where_a_clock_was_set_back_what_follows_comes_later(
    seconds: float, tmp_path: Path
) -> None:
    lines = driving(*[5000.0 + k - (seconds if k >= 40 else 0.0) for k in range(80)])
    lines[20:22] = lines[21:19:-1]  # late by a second
    log = read(written(tmp_path / "a.log", *lines))
    assert [one.odom_base.x for one in log.odometry] == [float(k) for k in range(80)]
    assert [one.stamp for one in log.odometry] == [scan.stamp for scan in log.scans]
    assert np.diff([scan.stamp for scan in log.scans]).tolist() == [1.0] * 39 + [0.0] + [1.0] * 39
    assert (log.set_back, log.damaged, log.pauses) == ([41], 0, 0)


def test_many_lines_that_come_late_are_put_in_order_all_the_same(tmp_path: Path) -> None:
    lines = driving(*[5000.0 + k for k in range(80)])
    log = read(written(tmp_path / "a.log", *lines[:30], *lines[40:50], *lines[30:40], *lines[50:]))
    assert [one.odom_base.x for one in log.odometry] == [float(k) for k in range(80)]
    assert log.set_back == []


def test_stamps_of_zero_here_and_there_are_damaged_ones(tmp_path: Path) -> None:
    stamps = [0.0 if k % 10 == 5 else 976052857.0 + k for k in range(50)]
    log = read(written(tmp_path / "a.log", *map(at, stamps)))
    assert [scan.stamp for scan in log.scans] == [stamp for stamp in stamps if stamp]
    assert (log.damaged, log.pauses) == (5, 0)


def standing_clock(*logger: float, last: float = 0.0) -> list[str]:
    """Lines of a robot that drives on, all but the last with the stamp 0, and the logger's own."""
    stamps = [*[0.0] * (len(logger) - 1), last]
    return [
        line.replace("3.25", f"{stamp:.2f}")
        for line, stamp in zip(driving(*stamps), logger, strict=True)
    ]


@pytest.mark.parametrize("last", [0.0, 100.0])
def test_the_logger_says_when_it_was_where_nobody_else_does(last: float, tmp_path: Path) -> None:
    stamps = [1.0, 2.0, 3.5, 4.0]
    log = read(written(tmp_path / "a.log", *standing_clock(*stamps, last=last)))
    assert [scan.stamp for scan in log.scans] == stamps
    found = [(one.stamp, one.odom_base.x) for one in log.odometry]
    assert found == list(zip(stamps, [0.0, 1.0, 2.0, 3.0], strict=True))


def test_a_log_without_times_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="same stamp"):
        read(written(tmp_path / "a.log", *standing_clock(0.0, 0.0, 0.0)))


@pytest.mark.parametrize("first", [0, 24, 47])
@pytest.mark.parametrize("off", [-40.0, 1e3, 1e6, 1e9])
def test_lines_whose_pose_no_robot_reaches_are_among_the_damaged(
    off: float, first: int, tmp_path: Path
) -> None:
    """Three in a row, 1 s apart, in a log of a robot that drives on at 1 m/s."""
    lines = [at(7.5 + k).replace("1.1 2.1", f"{k:.1f} 2.1") for k in range(50)]
    for k in range(first, first + 3):
        lines[k] = lines[k].replace(f"{k:.1f} 2.1", f"{off} 2.1")
    log = read(written(tmp_path / "a.log", *lines))
    kept = [float(k) for k in range(50) if not first <= k < first + 3]
    assert [one.odom_base.x for one in log.odometry] == kept
    assert [scan.stamp - 7.5 for scan in log.scans] == kept
    assert log.damaged == 3


def test_a_clock_that_was_set_makes_no_messages(tmp_path: Path) -> None:
    stamps = [5.0, 5.1, 976052857.0, 976052857.1]
    log = read(written(tmp_path / "a.log", *map(at, stamps)))
    lived = list(itertools.islice(messages(log), 100))
    assert [message.stamp for _, message in lived if isinstance(message, Scan)] == stamps
    assert (len(lived), log.damaged, log.pauses) == (8, 0, 1)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_a_log_may_be_packed(pack: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(pack("\n".join([ODOM, FLASER]).encode()))
    assert (len(read(path).scans), len(read(path).odometry)) == (1, 2)


def test_a_packed_log_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = gzip.compress("\n".join([FLASER] * 2000).encode(), mtime=0)
    path = tmp_path / "a.log.gz"
    path.write_bytes(whole)
    assert (len(read(path).scans), read(path).damaged, read(path).is_cut) == (2000, 0, False)
    path.write_bytes(whole[: len(whole) // 2])
    assert 0 < len(read(path).scans) < 2000
    assert read(path).is_cut


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no FLASER"),
        (ODOM.encode(), "no FLASER"),
        (f"# none\n{FLASER} 1 2\n{FLASER} 3".encode(), "damaged lines: 2, the first in line 2"),
        (f"FLASER 180{' 2500.0' * 180} 0 0 0 0 0 0 1 host 1".encode(), "make them metres"),
        (b"\x7fELF\0\0\1\n", "neither a recording"),
        (b"\x1f\x8bnot gzip at all", "cannot read"),
        (b"BZhnot bzip2 at all", "cannot read"),
        (b"\xfd7zXZnot xz at all", "cannot read"),
        (b"PK\x03\x04\x14\0\0\0\x08\0", "give the log that is in it"),
    ],
)
def test_a_file_that_is_no_log_is_refused(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=said):
        read(path)


def test_a_missing_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.log", tmp_path):
        with pytest.raises(UsageError, match="cannot read"):
            read(path)
