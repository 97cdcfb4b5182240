"""The service under a systemd that was booted for it: ready, killed, hung, stopped."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.rigs.programs import until
from gvgbot.installation import system_files
from tests.process.machine import Machine, NoMachine, machine

pytestmark = pytest.mark.slow

CONFIG = "{twin: {enabled: true, world: ring}, telemetry: {enabled: false}}\n"
PATIENCE = 60.0  # s, for a busy machine


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    """A machine with the service as `install-service` installs it, on simulated devices."""
    folder = tmp_path_factory.mktemp("machine") / "disk"
    folder.mkdir()
    source = folder.parent / "robot.yaml"
    source.write_text(CONFIG)
    try:
        with machine(folder) as booted:
            version = int(booted.run("systemctl", "--version").split()[1])
            for file in system_files(source, Path("/"), Path("/opt/gvgbot/bin"), version):
                booted.write(file.path, file.content)
            booted.run("systemd-sysusers")
            booted.run("systemctl", "daemon-reload")
            yield booted
    except NoMachine as reason:
        pytest.skip(str(reason))


def is_up_anew(robot: Machine, before: str) -> bool:
    pid = robot.property("MainPID")  # 0 between two lives; no process, but a whole group to `kill`
    return robot.property("ActiveState") == "active" and pid not in ("0", before)


def test_it_is_ready_lives_through_a_kill_and_a_hang_and_stops(robot: Machine) -> None:
    robot.run("systemctl", "start", "gvgbot")  # returns when it is ready
    assert robot.property("ActiveState") == "active"
    assert robot.property("StatusText").startswith("exploring")
    first = robot.property("MainPID")
    assert robot.run("ps", "-o", "user=", "-p", first).strip() == "gvgbot"
    run = "/var/lib/gvgbot/runs/ring-1"
    until(lambda: "snapshot.gvg" in robot.run("ls", run), patience_s=PATIENCE)

    log = robot.run("journalctl", "-u", "gvgbot", "-o", "cat", "_PID=" + first).splitlines()
    assert "started" in [json.loads(line)["event"] for line in log]

    robot.run("kill", "-KILL", first)
    until(lambda: is_up_anew(robot, first), patience_s=PATIENCE)
    second = robot.property("MainPID")
    assert robot.run("ls", "/var/lib/gvgbot/runs").split() == ["ring-1"]

    robot.run("kill", "-STOP", second)
    until(lambda: is_up_anew(robot, second), patience_s=PATIENCE)
    assert int(robot.property("NRestarts")) == 2

    robot.run("systemctl", "stop", "gvgbot")
    assert robot.property("ActiveState") == "inactive"
    assert robot.property("Result") == "success"
    assert '"outcome"' in robot.read(f"{run}/summary.json")
