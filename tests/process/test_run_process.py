"""The daemon as a process of its own, as a person or a service manager starts it."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tty
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from threading import Event
from typing import Any

import msgspec
import pytest
import zenoh

from benchmarks.rigs.addresses import free_endpoint, plain_session
from benchmarks.rigs.programs import gvgbot, until
from gvgbot.cli import main

pytestmark = pytest.mark.slow

RUN = {
    "map.geojson",
    "map.yaml",
    "map.pgm",
    "map.png",
    "summary.json",
    "events.jsonl",
    "estimate.tum",
    "online.tum",
    "odometry.tum",
    "truth.tum",
}
PATIENCE = 20.0  # s, for a busy machine
# header, length, base control of speed 0 and radius 0, and the XOR of 06 01 04
STANDSTILL = bytes.fromhex("aa55 06 01 04 0000 0000 03")


STOPPED = ["map:     run/map.geojson", "picture: run/map.png", "gvgbot: interrupted"]


def until_driving(samples: "Queue[zenoh.Sample]") -> tuple[str, list[dict[str, Any]]]:
    """The encoding and all states up to the first one that says that the robot has driven."""
    states: list[dict[str, Any]] = []
    while True:
        sample = samples.get(timeout=PATIENCE)
        states.append(msgspec.msgpack.decode(sample.payload.to_bytes()))
        if states[-1]["distance"] > 0.0:
            return str(sample.encoding), states


def until_kept(state: Path) -> None:
    """Wait for a mission that another program could go on with."""
    until(lambda: bool(list(state.glob("runs/*/snapshot.gvg"))), patience_s=PATIENCE)


def until_found(events: Path, vertices: int, process: "subprocess.Popen[str]") -> None:
    """Wait until an exploration has found so many vertices: the comb has the first nearby."""
    while not (events.exists() and events.read_text().count("vertex_added") >= vertices):
        assert process.poll() is None
        select.select([], [], [], 0.1)


def ask(session: zenoh.Session, selector: str) -> tuple[str, bytes]:
    """The encoding and the payload of the only answer."""
    (reply,) = list(session.get(selector, timeout=PATIENCE))
    assert reply.ok is not None
    return str(reply.ok.encoding), reply.ok.payload.to_bytes()


@dataclass(frozen=True)
class Life:
    """What a robot did that was watched, asked and stopped, and what came of a second one."""

    status: int
    log: str
    out: Path
    encoding: str
    states: list[dict[str, Any]]
    tokens: list[zenoh.Reply]
    as_json: tuple[str, bytes]
    as_msgpack: tuple[str, bytes]
    second: tuple[int, str]
    goes_on: bool  # the first one, when there was a second one


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory) -> Life:
    endpoint, where = free_endpoint(), tmp_path_factory.mktemp("life")
    (where / "robot.yaml").write_text("")
    settings = [f"--set=service.state_dir={where / 'state'}", "--set=robot.name=sim"]
    with (
        gvgbot(
            "run", "robot.yaml", *settings, f"--set=telemetry.listen=[{endpoint}]", cwd=where
        ) as process,
        plain_session(endpoint, patience_s=PATIENCE) as session,
    ):
        samples: Queue[zenoh.Sample] = Queue()
        with session.declare_subscriber("gvgbot/*/state", samples.put):
            encoding, states = until_driving(samples)
            tokens = list(session.liveliness().get("gvgbot/*/alive"))
            as_json = ask(session, "gvgbot/sim/state?format=json")
            as_msgpack = ask(session, "gvgbot/sim/state")
        until_kept(where / "state")
        with gvgbot("run", *settings, "--set=telemetry.enabled=false", cwd=where) as second:
            said, _ = second.communicate(timeout=PATIENCE)
        goes_on = process.poll() is None
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)  # as impatient people do
        log, _ = process.communicate(timeout=PATIENCE)
    (out,) = (where / "state" / "runs").iterdir()
    return Life(
        status=process.returncode,
        log=log,
        out=out,
        encoding=encoding,
        states=states,
        tokens=tokens,
        as_json=as_json,
        as_msgpack=as_msgpack,
        second=(second.returncode, said),
        goes_on=goes_on,
    )


def test_a_running_robot_is_watched_asked_and_stopped(life: Life) -> None:
    assert life.status == 0, life.log
    assert life.encoding == life.as_msgpack[0] == "application/msgpack;gvgbot.State.v1"
    numbers = [state["sequence"] for state in life.states]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    tokens = [str(reply.ok.key_expr) for reply in life.tokens if reply.ok]
    assert tokens == ["gvgbot/sim/alive"]
    assert life.as_json[0] == "application/json"
    assert json.loads(life.as_json[1])["sequence"] >= numbers[-1]
    assert msgspec.msgpack.decode(life.as_msgpack[1])["phase"] == "exploring"
    assert {path.name for path in life.out.iterdir()} >= RUN
    assert json.loads((life.out / "summary.json").read_text())["outcome"] == "stopped"
    assert "signal=SIGINT" in life.log
    assert "Traceback" not in life.log


def test_a_mission_that_another_program_goes_on_with_is_left_to_it(life: Life) -> None:
    status, said = life.second
    assert (status, life.goes_on) == (2, True)
    assert said.startswith("gvgbot: ")
    assert "in use" in said
    assert len(said.splitlines()) == 1


def test_a_configuration_that_was_cut_short_is_said_to_tell_of_no_devices(life: Life) -> None:
    """After a power cut, say. A robot that stands is a riddle to who does not know of the twins."""
    line = next(line for line in life.log.splitlines() if "simulated" in line)
    assert "warning" in line
    assert "robot.yaml has no section twin" in line
    assert "enabled: false" in line


def test_a_simulated_exploration_whose_terminal_is_closed_leaves_its_map(tmp_path: Path) -> None:
    events = tmp_path / "run" / "events.jsonl"
    with gvgbot("explore", "--world", "comb", "--out", "run", cwd=tmp_path) as process:
        until_found(events, 1, process)
        process.send_signal(signal.SIGHUP)
        log, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert log.splitlines()[-3:] == STOPPED
    assert json.loads((events.parent / "map.geojson").read_text())["features"]


@pytest.mark.parametrize("pause_s", [0.0, 0.1])
def test_an_exploration_that_is_stopped_twice_ends_as_after_once(
    pause_s: float, tmp_path: Path
) -> None:
    """As people press Ctrl-C again who see that something goes on."""
    events = tmp_path / "run" / "events.jsonl"
    with gvgbot("explore", "--world", "comb", "--out", "run", cwd=tmp_path) as process:
        until_found(events, 1, process)
        process.send_signal(signal.SIGINT)
        Event().wait(pause_s)
        process.send_signal(signal.SIGINT)
        log, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, log
    assert log.splitlines() == STOPPED


def test_an_exploration_that_a_script_left_in_the_background_is_stopped_as_any(
    tmp_path: Path,
) -> None:
    """There `&` has Ctrl-C ignored, and that it stays. Of several robots, as of one above."""
    events = tmp_path / "run" / "robot-1" / "events.jsonl"
    deaf = ["sh", "-c", 'trap "" INT; exec "$0" "$@"', sys.executable]
    arguments = ["explore", "--world", "comb", "--out", "run", "--robots", "2"]
    with gvgbot(*arguments, cwd=tmp_path, python=deaf) as process:
        until_found(events, 1, process)
        process.send_signal(signal.SIGINT)
        until_found(events, 2, process)
        process.send_signal(signal.SIGTERM)
        log, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert log.splitlines()[-3:] == STOPPED
    assert "Traceback" not in log
    assert json.loads((tmp_path / "run" / "map.geojson").read_text())["features"]


def test_a_robot_without_any_stream_maps_all_the_same(tmp_path: Path) -> None:
    """As what a program starts that has closed them all."""
    command = "-m gvgbot explore --world ring --set twin.time_limit_s=2 --out run"
    closed = f'exec "$0" {command} <&- >&- 2>&-'
    subprocess.run(["sh", "-c", closed, sys.executable], cwd=tmp_path, check=False)
    assert {path.name for path in (tmp_path / "run").iterdir()} >= RUN


STOPPED_AS_IT_LOADS = """
import importlib.abc, signal, sys

class Stop(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "gvgbot.daemon":
            signal.raise_signal(signal.SIGTERM)

sys.meta_path.insert(0, Stop())
from gvgbot.cli import main

sys.exit(main(["run", "--set", "telemetry.enabled=false"]))
"""


def test_a_robot_that_is_stopped_while_it_is_loaded_ends_and_leaves_nothing(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", STOPPED_AS_IT_LOADS],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    assert "nothing was seen" in done.stderr
    assert not list((tmp_path / "runs").iterdir())


def test_a_request_that_nobody_answers_can_be_stopped(tmp_path: Path) -> None:
    """The library waits for it to connect, and hears of no signal meanwhile."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        with gvgbot("ctl", "pause", "--connect", address, cwd=tmp_path) as process:
            connection, _ = silent.accept()
            with connection:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGINT  # ended by it, and not by the end of its patience


def test_an_address_in_use_is_one_line_and_leaves_nothing(
    endpoint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    host, _, port = endpoint.removeprefix("tcp/").partition(":")
    with socket.create_server((host, int(port))):
        assert main(["run", "--out", "run", "--set", f"telemetry.listen=[{endpoint}]"]) == 1
    said = capsys.readouterr()
    (line,) = (said.out + said.err).splitlines()
    assert endpoint in line
    assert "in use" in line
    assert f"--set 'telemetry.listen=[tcp/{host}:{int(port) + 1}]'" in line
    assert not list(tmp_path.iterdir())


def test_a_missing_port_is_named_and_waited_for(tmp_path: Path) -> None:
    settings = ["telemetry.enabled=false", "laser.port=/no/laser", "base.port=/no/base"]
    arguments = [word for setting in settings for word in ("--set", setting)]
    with gvgbot("run", "turtlebot2.yaml", *arguments, cwd=tmp_path) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(3)]
        process.send_signal(signal.SIGTERM)
        log, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, log
    (laser,) = [line for line in lines if "/no/laser: there is no such port" in line]
    (base,) = [line for line in lines if "/no/base: there is no such port" in line]
    assert "laser.port" in laser
    assert "base.port" in base


def test_the_base_can_be_stopped_from_outside(tmp_path: Path) -> None:
    here, there = os.openpty()
    tty.setraw(there)
    config = tmp_path / "robot.yaml"
    config.write_text(f"{{twin: {{enabled: false}}, base: {{port: {os.ttyname(there)}}}}}")
    command = [sys.executable, "-m", "gvgbot.stop_base", str(config)]
    try:
        done = subprocess.run(command, check=False, capture_output=True, timeout=PATIENCE)
        assert done.returncode == 0, done.stderr
        assert os.read(here, 100) == STANDSTILL
    finally:
        os.close(here)
        os.close(there)


def test_a_base_on_the_network_can_be_stopped_from_outside(tmp_path: Path) -> None:
    config = tmp_path / "robot.yaml"
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        config.write_text(f"{{twin: {{enabled: false}}, base: {{port: '{port}'}}}}")
        command = [sys.executable, "-m", "gvgbot.stop_base", str(config)]
        with subprocess.Popen(command) as process:
            base, _ = server.accept()
            with base:  # which says nothing
                base.settimeout(PATIENCE)
                assert base.recv(100) == STANDSTILL
                assert process.wait(PATIENCE) == 0


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("{twin: {enabled: false}, base: {port: /no/such/port}}", "/no/such/port"),
        ("{twin: {enabled: false}, base: {prot: /dev/null}}", "prot"),
        ("twin: [", "not a configuration"),
    ],
)
def test_a_base_that_cannot_be_stopped_is_a_line_and_exit_status_1(
    text: str, named: str, tmp_path: Path
) -> None:
    config = tmp_path / "robot.yaml"
    config.write_text(text)
    command = [sys.executable, "-m", "gvgbot.stop_base", str(config)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 1
    assert named in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_that_takes_no_bytes_has_not_stopped_the_base(tmp_path: Path) -> None:
    here, there = os.openpty()
    tty.setraw(there)
    os.set_blocking(there, False)
    while select.select([], [there], [], 0.3)[1]:  # the system makes room for some time
        with suppress(BlockingIOError):
            os.write(there, b"x" * 1000)
    with suppress(BlockingIOError):
        while True:  # into what is left, too
            os.write(there, b"x")
    config = tmp_path / "robot.yaml"
    config.write_text(f"{{twin: {{enabled: false}}, base: {{port: {os.ttyname(there)}}}}}")
    command = [sys.executable, "-m", "gvgbot.stop_base", str(config)]
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=PATIENCE
        )
        assert done.returncode == 1
        assert os.ttyname(there) in done.stderr
    finally:
        os.close(here)
        os.close(there)


def test_what_stops_the_base_loads_nothing_that_takes_long() -> None:
    code = "import sys, gvgbot.stop_base; print('scipy' in sys.modules, 'zenoh' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["False", "False"]
