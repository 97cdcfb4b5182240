"""What `install-service` writes, where, and what it says of it."""

import errno
import os
import sys
from pathlib import Path

import pytest

from gvgbot import installation
from gvgbot.cli import main
from gvgbot.config import load_config
from gvgbot.installation import system_files, user_files
from gvgbot.strict_yaml import packaged

PROGRAMS = Path("/srv/robot/bin")
SOURCE = packaged("turtlebot2.yaml")


@pytest.fixture(autouse=True)
def _settings_are_at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)


def contents(version: int | None) -> dict[str, str]:
    files = system_files(SOURCE, Path("/"), PROGRAMS, version)
    return {str(file.path): file.content for file in files}


def test_everything_goes_where_systemd_and_udev_look_for_it() -> None:
    assert list(contents(252)) == [
        "/etc/gvgbot/gvgbot.yaml",
        "/etc/systemd/system/gvgbot.service",
        "/etc/udev/rules.d/60-gvgbot.rules",
        "/etc/sysusers.d/gvgbot.conf",
        "/etc/tmpfiles.d/gvgbot.conf",
    ]
    assert contents(252)["/etc/gvgbot/gvgbot.yaml"] == SOURCE.read_text()


def test_the_unit_starts_the_programs_of_this_installation() -> None:
    unit = contents(252)["/etc/systemd/system/gvgbot.service"].splitlines()
    assert "ExecStart=/srv/robot/bin/gvgbot run /etc/gvgbot/gvgbot.yaml" in unit
    stop = "ExecStopPost=-/srv/robot/bin/python -m gvgbot.stop_base /etc/gvgbot/gvgbot.yaml"
    assert stop in unit


def test_the_service_may_open_serial_ports_by_usb_and_of_the_board() -> None:
    """Majors as in Documentation/admin-guide/devices.txt of Linux."""
    majors = {"ttyS": 4, "ttyACM": 166, "ttyUSB": 188, "ttyAMA": 204}
    unit = contents(252)["/etc/systemd/system/gvgbot.service"].splitlines()
    allowed = {line for line in unit if line.startswith("DeviceAllow=")}
    assert allowed == {f"DeviceAllow=char-{major} rw" for major in majors.values()}


@pytest.mark.parametrize(("version", "spaced"), [(None, False), (253, False), (254, True)])
def test_restarts_are_spaced_out_where_systemd_can(version: int | None, spaced: bool) -> None:
    unit = contents(version)["/etc/systemd/system/gvgbot.service"].splitlines()
    assert ("RestartMaxDelaySec=60" in unit) == spaced


def test_a_person_s_service_stays_below_their_settings(tmp_path: Path) -> None:
    files = user_files(SOURCE, tmp_path, PROGRAMS, None)
    assert all(file.path.is_relative_to(tmp_path) for file in files)
    assert f"run {tmp_path}/gvgbot/gvgbot.yaml" in files[1].content


def test_a_blank_in_the_name_of_a_home_is_part_of_a_path() -> None:
    home = Path("/srv/my 100% robot")
    unit = user_files(SOURCE, home, home / "bin", None)[1].content.splitlines()
    quoted = '"/srv/my 100%% robot/'
    config = f'{quoted}gvgbot/gvgbot.yaml"'
    assert f'ExecStart={quoted}bin/gvgbot" run {config}' in unit
    assert f'ExecStopPost=-{quoted}bin/python" -m gvgbot.stop_base {config}' in unit


def test_a_dry_run_says_all_and_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["install-service", "--user", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert f"would write {tmp_path}/.config/systemd/user/gvgbot.service" in said
    assert "systemctl --user" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("settings", "below"), [("/srv/mine", "/srv/mine"), ("", None), ("x", None)]
)
def test_a_person_s_service_is_where_systemd_looks_for_their_settings(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    settings: str,
    below: str | None,
) -> None:
    """XDG Base Directory Specification: by default ~/.config; relative paths are not valid."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", settings)
    assert main(["install-service", "--user", "--dry-run"]) == 0
    folder = below or f"{tmp_path}/.config"
    assert f"would write {folder}/systemd/user/gvgbot.service" in capsys.readouterr().out


def test_a_dry_run_says_what_the_real_run_would_keep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["install-service", "--user"]) == 0
    capsys.readouterr()
    assert main(["install-service", "--user", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert f"would keep {tmp_path}/.config/gvgbot/gvgbot.yaml" in said
    assert f"would write {tmp_path}/.config/systemd/user/gvgbot.service" in said


def test_what_is_written_can_be_used_and_a_configuration_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["install-service", "--user", "sim.yaml"]) == 0
    config = tmp_path / ".config/gvgbot/gvgbot.yaml"
    assert load_config(config) == load_config()
    config.write_text("{robot: {name: mine}}")
    assert main(["install-service", "--user"]) == 0
    assert load_config(config).robot.name == "mine"
    said = capsys.readouterr().out
    assert f"kept {config}" in said
    assert "not used" not in said
    assert main(["install-service", "--user", "turtlebot2.yaml"]) == 0
    assert load_config(config).robot.name == "mine"
    assert "turtlebot2.yaml is not used" in capsys.readouterr().out


def test_a_kept_configuration_that_this_version_refuses_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    config = tmp_path / ".config/gvgbot/gvgbot.yaml"
    config.parent.mkdir(parents=True)
    config.write_text("{robot: {nam: mine}}")
    assert main(["install-service", "--user"]) == 2
    assert capsys.readouterr().err.startswith(f"gvgbot: {config}: robot.nam")
    assert list(config.parent.parent.iterdir()) == [config.parent]


def test_who_may_not_write_at_home_is_not_sent_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(path: Path, **_: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(Path, "mkdir", refuse)
    assert main(["install-service", "--user"]) == 1
    wanted = tmp_path / ".config/gvgbot/gvgbot.yaml"
    assert capsys.readouterr().err == f"gvgbot: cannot write {wanted}: Permission denied\n"


def test_a_configuration_with_mistakes_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    bad = tmp_path / "bad.yaml"
    bad.write_text("{robot: {nam: mine}}")
    assert main(["install-service", "--user", str(bad)]) != 0
    assert "nam" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [bad]


@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ("telemetry: {zenoh_file: mine}", "telemetry.zenoh_file"),
        ("ros2: {zenoh_file: mine}", "ros2.zenoh_file"),
        ("twin: {world: mine}", "world"),
        ("service: {map: mine}", "service.map"),
    ],
)
def test_a_configuration_with_files_that_the_service_would_not_find_is_not_installed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    setting: str,
    key: str,
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    make_mine = Path.mkdir if key == "service.map" else Path.touch
    make_mine(tmp_path / "mine")
    (tmp_path / "robot.yaml").write_text(setting)
    assert main(["install-service", "--user", "robot.yaml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert key in line
    assert f"must be {tmp_path / 'mine'}" in line
    (tmp_path / "robot.yaml").write_text(setting.replace("mine", str(tmp_path / "mine")))
    assert main(["install-service", "--user", "--dry-run", "robot.yaml"]) == 0


@pytest.mark.parametrize(
    "setting",
    [
        "telemetry: {zenoh_file: %s}",
        "ros2: {zenoh_file: %s}",
        "twin: {world: %s}",
        "service: {map: %s}",
    ],
)
def test_a_configuration_with_files_that_the_service_cannot_see_is_not_installed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    setting: str,
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(sys, "executable", "/opt/gvgbot/bin/python")
    config = tmp_path / "robot.yaml"
    config.write_text(setting % "/home/me/mine")
    assert main(["install-service", "--dry-run", str(config)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "sees nothing of /home" in line
    assert main(["install-service", "--dry-run", "--user", str(config)]) == 0
    config.write_text(setting % "/tmp/mine")  # it has one of its own
    assert main(["install-service", "--dry-run", str(config)]) == 2
    assert "sees nothing of /tmp" in capsys.readouterr().err
    config.write_text(setting % "/etc/gvgbot/mine")
    assert main(["install-service", "--dry-run", str(config)]) == 0


@pytest.mark.parametrize("options", [[], ["--dry-run"]], ids=["real", "dry"])
def test_a_service_that_could_not_see_its_program_is_not_installed(
    options: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "executable", "/home/me/gvgbot/bin/python")
    assert main(["install-service", *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "/home/me/gvgbot/bin/python" in line
    assert "/opt/gvgbot" in line


def test_an_environment_whose_interpreter_the_service_could_not_see_is_to_be_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(installation, "_HIDDEN", ("/home",))  # not where this test makes its own
    python = tmp_path / "gvgbot/bin/python"
    python.parent.mkdir(parents=True)
    python.symlink_to("/home/me/.pyenv/bin/python3.11")
    monkeypatch.setattr(sys, "executable", str(python))
    assert main(["install-service", "--dry-run"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "/home/me/.pyenv/bin/python3.11" in line
    assert f"/usr/bin/python3 -m venv --clear {tmp_path / 'gvgbot'}" in line
