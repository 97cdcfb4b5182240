"""Puts the service and what belongs to it in its place, and says what each file is for."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from gvgbot.config import Config, load_config
from gvgbot.errors import ConfigError, GvgbotError
from gvgbot.strict_yaml import packaged

_BACK_OFF_SINCE = 254  # the version of systemd from which on restarts can be spaced out
_BACK_OFF = "RestartSteps=6\nRestartMaxDelaySec=60\n"
_HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # by ProtectHome and PrivateTmp


@dataclass(frozen=True, slots=True)
class Written:
    """A file, its content, and why it is there. `kept`: one that exists already stays."""

    path: Path
    content: str
    purpose: str
    kept: bool = False

    @property
    def is_there(self) -> bool:
        """Whether it stays as somebody has left it."""
        return self.kept and self.path.exists()


def install_service(
    config: Path | None, *, user: bool, dry_run: bool, say: Callable[[str], None]
) -> int:
    """Write the files of the service, or only say what would be written; the exit status.

    Raises ConfigError for a configuration with mistakes, or with files that the service would not
    find, be it one that is kept, GvgbotError if the service could not run from where this program
    is, also of a dry run, or if a file cannot be written.
    """
    source = packaged("turtlebot2.yaml" if config is None else config)
    _check_paths(source, load_config(source), user=user)
    programs = Path(sys.executable).parent
    if not user:
        _check_place(Path(sys.executable))
    version = _systemd_version()
    wanted = (
        user_files(source, _settings(), programs, version)
        if user
        else system_files(source, Path("/"), programs, version)
    )
    for file in wanted:
        if file.is_there:
            _check_paths(file.path, load_config(file.path), user=user)
    for file in wanted:
        done = _would(file) if dry_run else _write(file, "" if user else ": try sudo, or --user")
        say(f"{done} {file.path}: {file.purpose}")
        if config is not None and file.is_there and _text(file.path) != file.content:
            say(f"  {config} is not used: to have it, remove the one that is kept, and repeat this")
    say("then run:")
    for command in USER_COMMANDS if user else SYSTEM_COMMANDS:
        say(f"  {command}")
    return 0


SYSTEM_COMMANDS = (
    "systemd-sysusers                                       # makes the user gvgbot",
    "systemd-tmpfiles --create                              # makes /etc/gvgbot as it should be",
    "udevadm control --reload && udevadm trigger            # names the ports",
    "systemctl daemon-reload && systemctl enable --now gvgbot",
    "systemctl status gvgbot; journalctl -fu gvgbot         # see what it does",
)
USER_COMMANDS = (
    "systemctl --user daemon-reload && systemctl --user enable --now gvgbot",
    "loginctl enable-linger                                 # to run while you are logged out",
    "systemctl --user status gvgbot; journalctl --user -fu gvgbot",
)


def system_files(source: Path, root: Path, programs: Path, version: int | None) -> list[Written]:
    """The files of a machine's own service below `root`, its programs in a folder.

    `version` is systemd's; None where it is not known.
    """
    etc = root / "etc"
    config = Path("/etc/gvgbot/gvgbot.yaml")
    return [
        Written(
            root / config.relative_to("/"), _text(source), "the configuration, yours to edit", True
        ),
        Written(
            etc / "systemd/system/gvgbot.service",
            _unit("gvgbot.service", programs, config, version),
            "the service",
        ),
        Written(
            etc / "udev/rules.d/60-gvgbot.rules",
            _packaged_text("60-gvgbot.rules"),
            "stable names for the ports, and no modem manager on them",
        ),
        Written(
            etc / "sysusers.d/gvgbot.conf",
            _packaged_text("sysusers.conf"),
            "the user that the service runs as",
        ),
        Written(
            etc / "tmpfiles.d/gvgbot.conf",
            _packaged_text("tmpfiles.conf"),
            "the folder of the configuration",
        ),
    ]


def user_files(source: Path, settings: Path, programs: Path, version: int | None) -> list[Written]:
    """The files of a person's own service, below the folder of their settings."""
    config = settings / "gvgbot/gvgbot.yaml"
    unit = _unit("gvgbot-user.service", programs, config, version)
    return [
        Written(config, _text(source), "the configuration, yours to edit", True),
        Written(settings / "systemd/user/gvgbot.service", unit, "the service"),
    ]


def _settings() -> Path:
    """Where the person's settings are, as the XDG Base Directory Specification says."""
    settings = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    return settings if settings.is_absolute() else Path.home() / ".config"


def _unit(name: str, programs: Path, config: Path, version: int | None) -> str:
    """A unit with the paths of this installation, and what this systemd knows beyond the common."""
    text = _packaged_text(name)
    text = text.replace("/etc/gvgbot/gvgbot.yaml", _word(config))
    for program in ("gvgbot", "python"):
        text = text.replace(f"/opt/gvgbot/bin/{program}", _word(programs / program))
    if version is not None and version >= _BACK_OFF_SINCE:
        text = text.replace("RestartSec=1\n", "RestartSec=1\n" + _BACK_OFF)
    return text


def _word(path: Path) -> str:
    """A path as systemd reads it in a command."""
    text = str(path).replace("%", "%%")
    return f'"{text}"' if " " in text else text


def _packaged_text(name: str) -> str:
    return (files("gvgbot") / "systemd" / name).read_text("utf-8")


def _text(path: Path) -> str:
    return path.read_text("utf-8")


def _would(file: Written) -> str:
    """What would be done with a file, in words."""
    return "would keep" if file.is_there else "would write"


def _write(file: Written, remedy: str) -> str:
    """Write a file; what was done, in a word. Raises GvgbotError with what helps who may not."""
    if file.is_there:
        return "kept"
    try:
        file.path.parent.mkdir(parents=True, exist_ok=True)
        file.path.write_text(file.content, "utf-8")
    except OSError as error:
        hint = remedy if isinstance(error, PermissionError) else ""
        raise GvgbotError(f"cannot write {file.path}: {error.strerror}{hint}") from error
    return "wrote"


def _check_paths(source: Path, config: Config, *, user: bool) -> None:
    """Raises ConfigError for a file that the service, which runs in a folder of its own, misses."""
    wanted = {
        "twin.world": Path(config.twin.world),
        "telemetry.zenoh_file": config.telemetry.zenoh_file,
        "ros2.zenoh_file": config.ros2.zenoh_file,
        "service.map": config.service.map,
    }
    for key, path in wanted.items():
        if path is None:
            continue
        exists = path.is_dir() if key == "service.map" else path.is_file()
        is_here = exists and not path.is_absolute()
        hidden = None if user else _hidden(path.resolve() if is_here else path)
        if hidden is not None:
            raise ConfigError(
                f"{source}: {key}: {path}: the service sees nothing of {hidden}: "
                "put it elsewhere, for instance into /etc/gvgbot"
            )
        if is_here:
            raise ConfigError(
                f"{source}: {key}: {path}: the service runs in another folder: "
                f"must be {path.resolve()}, or wherever it shall be"
            )


def _hidden(path: Path) -> str | None:
    """The folder that a service sees nothing of, if the path is in one."""
    return next((home for home in _HIDDEN if path.is_relative_to(home)), None)


def _check_place(executable: Path) -> None:
    """Raises GvgbotError if the service, which sees neither homes nor /tmp, would not find it."""
    elsewhere = "install gvgbot elsewhere, for instance with python3 -m venv /opt/gvgbot"
    another = (
        "make its environment with a Python that is elsewhere, for instance with "
        f"/usr/bin/python3 -m venv --clear {executable.parent.parent}, and install gvgbot again"
    )
    for path, remedy in ((executable, elsewhere), (executable.resolve(), another)):
        hidden = _hidden(path)
        if hidden is not None:
            raise GvgbotError(
                f"the service cannot see {path}, for it sees nothing of {hidden}: {remedy}"
            )


def _systemd_version() -> int | None:
    """The version of the systemd that is installed here."""
    systemctl = shutil.which("systemctl")
    if systemctl is None:
        return None
    done = subprocess.run(
        [systemctl, "--version"], check=False, capture_output=True, text=True, timeout=10
    )
    found = re.match(r"systemd (\d+)", done.stdout)
    return int(found[1]) if found else None
