"""What the check says about devices that are well, and about those that are not."""

import contextlib
import errno
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import serial
import structlog

from gvgbot.check import Heard, _base_lines, _link, _own_parts, check, examine
from gvgbot.cli.entry import status_of
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.kobuki.driver import KobukiBase
from gvgbot.drivers.kobuki.feedback import Identity, LinkStatistics
from gvgbot.drivers.transport import _obstacle
from gvgbot.geometry import Pose
from gvgbot.hal.messages import Scan
from gvgbot.simulation import Simulation, open_place

CONFIG = load_config()


def said(*overrides: str) -> tuple[int, dict[str, tuple[str, str]]]:
    """The exit status, and by subject the verdict and what follows it."""
    lines: list[str] = []
    config = load_config(None, overrides)
    status = status_of(lambda: check(config, lines.append))
    points = lines if status else lines[:-1]
    table = [(line[:5].strip(), line[6:20].strip(), line[21:]) for line in points]
    return status, {subject: (verdict, finding) for verdict, subject, finding in table}


def test_sound_twins_pass_on_every_point() -> None:
    status, points = said()
    assert status == 0
    assert {verdict for verdict, _ in points.values()} == {"ok"}
    assert set(points) >= {"laser", "laser rate", "base", "base rate", "battery", "contact"}
    assert points["base rate"][1].startswith("50.0 of 50")
    assert points["laser rate"][1].startswith("10.0 of 10")


def test_a_failure_is_told_in_one_line_where_errors_go(capsys: pytest.CaptureFixture[str]) -> None:
    assert said("twin.base.battery_v=13.1")[0] == 1
    error = capsys.readouterr().err
    assert re.fullmatch(r"gvgbot: 1 of \d+ points failed\n", error)


ILLS = {
    "abnormal laser": ("twin.laser.starts_abnormal=true", "laser", "fail", "check once more"),
    "empty battery": ("twin.base.battery_v=13.1", "battery", "fail", "charge it"),
    "low battery": ("twin.base.battery_v=13.9", "battery", "warn", "charge it"),
    "slow converter": ("twin.base.link.jitter_s=0.016", "base clock", "warn", "latency_timer"),
    "damaged bytes": ("twin.base.link.lost_bytes_per_kb=0.3", "base link", "warn", "cable"),
    "few scans": ("twin.laser.bad_checksum_fraction=0.2", "laser rate", "fail", "cable"),
    "silent base": ("twin.base.link.silences_per_h=36000", "base", "fail", "switched on"),
    "lifted robot": ("twin.base.mishaps.wheel_drops_per_h=36000", "contact", "warn", "floor"),
    "charging by cable": ("twin.base.has_adapter=true", "contact", "warn", "off the charger's"),
}


@pytest.mark.parametrize(
    ("identity", "says"),
    [
        (Identity("1.0.4", "1.2.0"), "ok    base           hardware 1.0.4, firmware 1.2.0"),
        (Identity(), "warn  base           does not answer what it is: check the wire"),
    ],
)
def test_a_base_that_answers_in_part_has_a_sound_wire(identity: Identity, says: str) -> None:
    base = SimpleNamespace(
        identity=identity, statistics=LinkStatistics(), battery=None, contact=None
    )
    heard = Heard([0.0, 0.02], [0.0, 0.02], [0, 1])
    first = next(_base_lines(cast(KobukiBase, base), heard))
    assert str(first).startswith(says)


def test_what_a_link_suffered_is_counted() -> None:
    once, often = LinkStatistics(9, 1, missed_frames=1, malformed=1), LinkStatistics(1, resets=2)
    said_of_both = [_link("base link", statistics).finding for statistics in (once, often)]
    assert said_of_both == [
        "9 messages, 1 bad frame, 1 missed frame, 1 malformed",
        "1 message, 2 resets",
    ]


def test_parts_that_only_newer_firmware_knows_are_no_damage() -> None:
    status, points = said("twin.base.mishaps.unknown_parts_per_h=36000")
    verdict, finding = points["base link"]
    assert (status, verdict) == (0, "ok")
    assert finding.endswith(" unknown parts")


@pytest.mark.parametrize(("override", "subject", "verdict", "remedy"), ILLS.values(), ids=ILLS)
def test_what_is_wrong_is_named_with_a_remedy(
    override: str, subject: str, verdict: str, remedy: str
) -> None:
    overrides = [override]
    if "silences" in override:
        overrides.append("twin.base.link.silence_s=60")
    if "wheel_drops" in override:
        overrides.append("twin.base.mishaps.duration_s=60")
    status, points = said(*overrides)
    assert points[subject][0] == verdict
    assert remedy in points[subject][1]
    assert status == (1 if verdict == "fail" else 0)


def test_a_late_laser_is_not_said_to_have_a_timer_of_converters() -> None:
    """On its own USB plug it is a CDC-ACM device, which has none, and so has Ethernet."""
    verdict, finding = said("twin.laser.link.jitter_s=0.03")[1]["laser clock"]
    assert verdict == "warn"
    assert "latency_timer" not in finding
    assert finding.endswith("busy with, and the network if it is on Ethernet")


def test_a_laser_that_does_not_look_where_the_robot_drives_is_not_ready() -> None:
    narrow = "laser.first_angle_deg=-60", "laser.last_angle_deg=60"
    assert said(*narrow)[0] == 0
    status, points = said(*narrow, "laser.yaw_deg=180")
    verdict, finding = points["laser mount"]
    assert (status, verdict) == (1, "fail")
    assert "laser.yaw_deg" in finding


def test_a_laser_with_nothing_within_range_may_be_covered() -> None:
    status, points = said(
        "twin.world=open_hall", "twin.laser.model=URG-04LX", "twin.start=[16.0, 12.4, 0.0]"
    )
    verdict, finding = points["laser view"]
    assert (status, verdict) == (0, "warn")
    assert "nothing within range" in finding


@pytest.mark.parametrize(
    ("post_m", "ahead_m", "remedy"),
    [(0.12, 0.0, "laser.min_range_m=0.14"), (0.12, 0.1, None), (0.3, 0.0, None), (inf, 0.0, None)],
    ids=["a post of the robot", "of which the laser is ahead", "of something else", "nothing"],
)
def test_a_laser_that_sees_the_robot_itself_is_found_out(
    post_m: float, ahead_m: float, remedy: str | None
) -> None:
    """The robot is round, with a radius of 0.177 m."""
    ranges = np.full(683, 2.0)
    ranges[330:352], ranges[:20] = post_m, nan
    step = math.tau / 1024
    scan = Scan(0.0, ranges, -341 * step, step, 0.02, 5.6, base_laser=Pose(ahead_m, 0.0))
    lines = [str(line) for line in _own_parts([scan, scan], 0.177)]
    assert len(lines) == (remedy is not None)
    assert all("22 beams" in line and remedy in line for line in lines if remedy)


def test_the_rate_is_compared_with_what_the_laser_was_asked_for() -> None:
    """Of the 40 scans a second that a UTM-30LX measures, its data sheet says."""
    _, points = said("laser.rate_hz=40")
    assert points["laser rate"][1].startswith("40.0 of 40")


@pytest.mark.parametrize("setting", ["laser.rate_hz=0.5", "laser.skip=9", "laser.skip=4"])
def test_a_laser_whose_scans_are_too_rare_to_drive_by_is_not_ready(setting: str) -> None:
    """A URG-04LX turns ten times a second."""
    status, points = said("twin.laser.model=URG-04LX", setting)
    verdict, finding = points["laser rate"]
    assert (status, verdict) == (1, "fail")
    assert "robot.limits.max_scan_age_s" in finding
    assert finding.endswith("raise laser.rate_hz or laser.baud, or lower laser.skip")


def test_a_laser_whose_scans_are_just_in_time_is_ready() -> None:
    status, points = said("twin.laser.model=URG-04LX", "laser.skip=3")
    assert (status, points["laser rate"][0]) == (0, "ok")


@pytest.mark.parametrize(
    ("skip", "limit_s", "is_told"), [(9, 0.5, True), (3, 0.5, False), (0, 0.09, True)]
)
def test_whoever_drives_by_scans_that_are_too_rare_is_told(
    skip: int, limit_s: float, is_told: bool
) -> None:
    """A URG-04LX turns ten times a second."""
    with structlog.testing.capture_logs() as logs:
        limit = f"robot.limits.max_scan_age_s={limit_s}"
        said("twin.laser.model=URG-04LX", f"laser.skip={skip}", limit)
    told = [line["remedy"] for line in logs if line["event"] == "scans are too rare to drive by"]
    assert len(told) == is_told
    assert all("robot.limits.max_scan_age_s" in remedy for remedy in told)


@pytest.mark.parametrize(
    ("settings", "is_told"),
    [
        (("laser.cluster=10",), False),
        (("laser.cluster=11",), True),
        (("laser.cluster=5", "laser.first_angle_deg=-60", "laser.last_angle_deg=60"), True),
    ],
)
def test_whoever_maps_by_too_few_beams_is_told(settings: tuple[str, ...], is_told: bool) -> None:
    """A UTM-30LX has 1081."""
    with structlog.testing.capture_logs() as logs:
        points = said(*settings)[1]
    assert points.get("laser beams", ("ok", ""))[0] == ("warn" if is_told else "ok")
    told = [line for line in logs if line["event"] == "too few beams to map by"]
    assert len(told) == is_told
    assert all("laser.cluster" in line["remedy"] for line in told)


@pytest.mark.parametrize(("baud", "is_told"), [(19200, True), (115200, False)])
def test_whoever_drives_by_scans_that_a_slow_line_delays_is_told(baud: int, is_told: bool) -> None:
    """The least of a URG-04LX, every third step, is 733 bytes: 0.38 s at 19200 bit/s."""
    with structlog.testing.capture_logs() as logs:
        said("twin.laser.model=URG-04LX", "laser.link=serial", f"laser.baud={baud}")
    told = [line for line in logs if line["event"] == "scans are too rare to drive by"]
    assert len(told) == is_told
    assert all(line["every_s"] == 0.4 for line in told)
    assert all(line["late_s"] == pytest.approx(0.382 + 0.0755, abs=0.005) for line in told)


@contextmanager
def terminal(*, is_busy: bool) -> Iterator[str]:
    """What to open; a busy one has been opened by another program already."""
    device, client = os.openpty()
    path = os.ttyname(client)
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, device)
        stack.callback(os.close, client)
        if is_busy:
            stack.enter_context(serial.Serial(path, exclusive=True))
        yield path


def at_ports(laser: str, base: str) -> dict[str, tuple[str, str]]:
    ports = [f"laser.port={laser}", f"base.port={base}"]
    status, points = said("twin.enabled=false", *ports)
    assert status == 1
    return points


def test_a_port_that_is_not_there_or_none_is_named_with_what_to_do(tmp_path: Path) -> None:
    absent = str(tmp_path / "absent")
    points = at_ports(absent, str(tmp_path))
    for device, port, remedy in (("laser", absent, "plug it in"), ("base", tmp_path, "its name")):
        verdict, finding = points[device]
        assert verdict == "fail"
        assert str(port) in finding
        assert remedy in finding
        assert f"set {device}.port" in finding


def test_an_address_without_its_scheme_is_told_how_it_is_written() -> None:
    found = at_ports("192.168.0.10:10940", "/dev/nothing")
    assert found["laser"][1].endswith("set laser.port (on Ethernet it is tcp://host:number)")
    assert found["base"][1].endswith("set base.port")


def test_a_file_that_is_no_port_is_called_so(tmp_path: Path) -> None:
    file = tmp_path / "ttyUSB0"
    file.touch()
    verdict, finding = at_ports(str(file), str(tmp_path))["laser"]
    assert (verdict, finding) == ("fail", f"{file} is no serial port: set laser.port")


def test_a_port_that_another_program_holds_is_not_to_be_plugged_in(tmp_path: Path) -> None:
    with terminal(is_busy=True) as path:
        verdict, finding = at_ports(path, str(tmp_path))["laser"]
    assert verdict == "fail"
    assert "another program uses it: stop that one" in finding
    assert "plug" not in finding


def test_a_port_that_is_not_ours_to_open_says_which_group_to_join() -> None:
    assert "dialout" in _obstacle(PermissionError(errno.EACCES, "Permission denied"))


def test_a_port_where_nobody_answers_is_told_from_one_that_is_not_there(tmp_path: Path) -> None:
    with terminal(is_busy=False) as path:
        verdict, finding = at_ports(str(tmp_path), path)["base"]
    assert verdict == "fail"
    assert "no feedback" in finding
    assert "switched on" in finding


def test_devices_plugged_into_each_others_ports_are_told_to_be_looked_for_there() -> None:
    async def main() -> list[str]:
        simulation = Simulation(CONFIG, open_place(CONFIG), LoopClock())
        simulation.laser, simulation.base = simulation.base, simulation.laser
        return [str(line) for line in await examine(CONFIG, simulation)]

    laser, base = run_in_virtual_time(main())
    assert "laser.port is no laser's: check that it is not the base's port" in laser
    assert "base.port is its port" in base


def test_the_robot_is_not_moved() -> None:
    async def main() -> tuple[int, float, Pose]:
        simulation = Simulation(CONFIG, open_place(CONFIG), LoopClock())
        lines = await examine(CONFIG, simulation)
        body = simulation.body
        return len(lines), abs(body.left_travel) + abs(body.right_travel), body.pose

    count, travel, pose = run_in_virtual_time(main())
    assert count > 8
    assert travel == 0.0
    assert pose == open_place(CONFIG).start
