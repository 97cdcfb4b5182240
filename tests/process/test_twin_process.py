"""The twins on pseudo-terminals, as other programs meet them, and what the daemon sends there."""

import os
import select
import shlex
import signal
import socket
import subprocess
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import reduce
from itertools import pairwise
from operator import xor
from pathlib import Path

import pytest

from benchmarks.rigs.programs import gvgbot
from benchmarks.rigs.run_rig import base_commands
from gvgbot.cli import main

pytestmark = pytest.mark.slow
PATIENCE = 30.0  # s, for a busy machine
START_MS, BOOT_MS = 0x500000, 2000  # of the laser's clock
GET_GAIN = bytes.fromhex("aa55 03 0e 01 00 0c")
GAINS = bytes.fromhex("150d 00 a0860100 64000000 d0070000")


@contextmanager
def twins(cwd: Path, *settings: str) -> Iterator["subprocess.Popen[str]"]:
    """Both twins, at `laser` and `base` in the directory."""
    arguments = [word for setting in settings for word in ("--set", setting)]
    links = ("--laser-link", str(cwd / "laser"), "--base-link", str(cwd / "base"))
    with gvgbot("twin", *links, *arguments, cwd=cwd) as process:
        assert process.stdout is not None
        while "base:" not in (line := process.stdout.readline()):
            assert line, "the twins did not start"
        yield process


@contextmanager
def opened(path: Path) -> Iterator[int]:
    """A client that changes no setting of the port, as `cat` does not."""
    client = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        yield client
    finally:
        os.close(client)


def collect(client: int, enough: Callable[[bytes], bool]) -> bytes:
    """What can be read until it is enough."""
    data = b""
    while not enough(data):
        if select.select([client], [], [], 0.1)[0]:
            data += os.read(client, 4096)
    return data


def frames(data: bytes) -> list[bytes]:
    """Whole frames with a right checksum from the first header on; there must be nothing else."""
    found = []
    data = data[data.index(b"\xaa\x55") :]
    while len(data) > 3 and len(data) >= data[2] + 4:
        frame, data = data[: data[2] + 4], data[data[2] + 4 :]
        assert frame[:2] == b"\xaa\x55"
        assert reduce(xor, frame[2:]) == 0
        found.append(frame)
    return found


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The directory of twins that several tests talk to."""
    where = tmp_path_factory.mktemp("twins")
    settings = (f"twin.laser.clock_start_ms={START_MS}", f"twin.laser.boot_s={BOOT_MS / 1000}")
    with twins(where, *settings) as process:
        yield where
        process.send_signal(signal.SIGTERM)
        log, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, log
    assert "Traceback" not in log
    assert not list(where.iterdir())  # stopped twins leave no links


def test_the_laser_boots_when_it_is_started_and_its_clock_begins_then(both: Path) -> None:
    with opened(both / "laser") as client:
        os.write(client, b"II\n")
        answer = collect(client, lambda data: data.endswith(b"\n\n"))
    (shown,) = (line[5:11] for line in answer.split(b"\n") if line.startswith(b"TIME:"))
    assert BOOT_MS <= int(shown, 16) - START_MS < BOOT_MS + 1000 * PATIENCE


def test_any_program_can_talk_to_the_base_and_come_and_go(both: Path) -> None:
    for _ in range(2):
        with opened(both / "base") as client:
            stream = frames(collect(client, lambda data: len(data) > 2000))
            stamps = [int.from_bytes(frame[5:7], "little") for frame in stream]
            assert {(b - a) % 65536 for a, b in pairwise(stamps[5:])} == {20}
            os.write(client, GET_GAIN)
            answer = collect(client, lambda data: GAINS in data)
            assert GET_GAIN not in answer  # it would be, if the terminal echoed


def test_a_client_that_does_not_read_loses_whole_frames_only(both: Path) -> None:
    with opened(both / "base") as client:
        collect(client, lambda data: len(data) > 1000)
        select.select([], [], [], 2.0)  # which makes 8 kB, and the terminal holds 4
        stream = frames(collect(client, lambda data: len(data) > 12_000))
        stamps = [int.from_bytes(frame[5:7], "little") for frame in stream]
        steps = {(b - a) % 65536 for a, b in pairwise(stamps)}
        assert min(steps) == 20
        assert max(steps) > 200


def test_a_laser_on_ethernet_is_reached_by_its_address(tmp_path: Path) -> None:
    links = ("--laser-link", "tcp://127.0.0.1:0", "--base-link", str(tmp_path / "base"))
    with gvgbot("twin", *links, "--set", "twin.laser.model=UST-10LX", cwd=tmp_path) as process:
        assert process.stdout is not None
        while not (line := process.stdout.readline()).startswith("laser:"):
            assert line, "the twins did not start"
        number = int(line.rpartition(":")[2])
        for _ in range(2):
            with socket.create_connection(("127.0.0.1", number), timeout=PATIENCE) as client:
                client.sendall(b"QT\n")
                assert client.recv(100) == b"QT\n00P\n\n"


def test_a_file_in_the_place_of_a_link_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base").write_text("precious")
    assert main(["twin", "--base-link", "base"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "base" in line
    assert (tmp_path / "base").read_text() == "precious"


def test_both_twins_cannot_have_one_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["twin", "--laser-link", "port", "--base-link", "./port"]) == 2
    told = "gvgbot: port cannot be both the laser and the base: name two links\n"
    assert capsys.readouterr() == ("", told)
    assert not (tmp_path / "port").exists()


def test_what_the_twins_propose_to_try_finds_them_well_and_a_missing_port_not(
    tmp_path: Path,
) -> None:
    """And the same robot as theirs."""
    here = tmp_path / "my robot"
    here.mkdir()
    links = ("--laser-link", "laser", "--base-link", str(here / "base"))
    settings = ("--set", "robot.name=karl", "--set", "twin.base.firmware_version=1.1.4")
    with gvgbot("twin", "husky.yaml", *links, *settings, cwd=here) as process:
        assert process.stdout is not None
        while not (line := process.stdout.readline()).startswith("try: "):
            assert line, "the twins did not start"
        program, *words = shlex.split(line.removeprefix("try: "))
        assert program == "gvgbot"
        with gvgbot(*words, cwd=here) as checking:
            well, _ = checking.communicate(timeout=PATIENCE)
        with gvgbot(*words, "--set", "base.port=/no/base", cwd=here) as checking_in_vain:
            ill, _ = checking_in_vain.communicate(timeout=PATIENCE)
    assert checking.returncode == 0, well
    assert f"robot karl, laser laser, base {here / 'base'}" in well
    assert "UTM-30LX" in well
    assert "firmware 1.1.4" in well
    assert "16.1 V" in well
    assert checking_in_vain.returncode == 1
    (failed,) = [line for line in ill.splitlines() if line.startswith("fail")]
    assert "/no/base" in failed


def test_a_moving_robot_is_told_to_stand_as_its_daemon_ends(tmp_path: Path) -> None:
    """With the terminal that it was started from, say."""
    here, there = os.openpty()
    tty.setraw(there)
    settings = ["twin.enabled=false", "telemetry.enabled=false"]
    settings += [f"laser.port={tmp_path / 'laser'}", f"base.port={os.ttyname(there)}"]
    arguments = [word for setting in settings for word in ("--set", setting)]
    with (
        twins(tmp_path, "twin.base.odometry=perfect"),
        opened(tmp_path / "base") as base,
        gvgbot("run", *arguments, cwd=tmp_path) as process,
    ):
        sent, asked = b"", False
        while process.poll() is None:
            for source in select.select([here, base], [], [], 0.05)[0]:
                data = os.read(source, 4096)
                os.write(base if source == here else here, data)
                sent += data if source == here else b""
            if not asked and any(speed for speed, _ in base_commands(whole(sent))[-3:]):
                process.send_signal(signal.SIGHUP)
                asked = True
        if select.select([here], [], [], 0.1)[0]:
            sent += os.read(here, 4096)
    os.close(here)
    os.close(there)
    speeds = [speed for speed, _ in base_commands(sent)]
    assert any(speeds[-60:])
    assert speeds[-1] == 0


def whole(data: bytes) -> bytes:
    """The data without the frame that has not come to its end."""
    end = 0
    while end + 3 <= len(data) and end + data[end + 2] + 4 <= len(data):
        end += data[end + 2] + 4
    return data[:end]
