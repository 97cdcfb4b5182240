"""The command line says in one line what is wrong, with the right exit status."""

import errno
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gvgbot import __version__
from gvgbot.cli import main, status_of
from gvgbot.drivers.world import save_world
from gvgbot.errors import ConfigError, DeviceLost, ExtraMissing, UsageError, WorldError, extra_for
from gvgbot.worlds import open_world

Captured = pytest.CaptureFixture[str]


def said(captured: Captured) -> list[str]:
    output = captured.readouterr()
    assert output.out == ""
    return output.err.splitlines()


BAD_ARGUMENTS = {
    "no command": ([], "COMMAND"),
    "unknown command": (["dance"], "dance"),
    "mistyped command": (["eksplore"], "'eksplore': did you mean explore?"),
    "mistyped action": (["map", "sohw", "."], "'sohw': did you mean show?"),
    "unknown option": (["explore", "--wrold", "office"], "--wrold"),
    "an option that is a key here": (["run", "--world", "ring"], "it is --set twin.world=..."),
    "one with its value": (["twin", "--seed=3"], "it is --set twin.seed=... (see gvgbot twin"),
    "another command's option": (["run", "--config", "a.yaml"], "see gvgbot run --help"),
    "a range of nothing": (["replay", "x.log", "--no-echo", "0"], "a number above 0"),
    "two numbers for a start": (["explore", "--start", "1", "2"], "--start"),
    "a start that is no number": (
        ["explore", "--start", "1", "2", "north"],
        "'north' must be",
    ),
    "a start that is not finite": (
        ["explore", "--start", "1", "nan", "0"],
        "'nan' must be",
    ),
    "a seed that is no number": (["explore", "--seed", "x"], "from 0 on"),
    "a negative seed": (["explore", "--seed", "-1"], "from 0 on"),
    "no robot": (["explore", "--robots", "0"], "1 to 8"),
    "too many robots": (["explore", "--robots", "9"], "1 to 8"),
    "no action on a map": (["map"], "COMMAND"),
    "one frame": (["map", "show", ".", "--frames", "1"], "from 2 to 200"),
    "too many frames": (["map", "show", ".", "--frames", "100000"], "from 2 to 200"),
    "a tolerance below 0": (["map", "diff", ".", ".", "--tolerance", "-1"], "above 0"),
    "nowhere to explore to": (["explore", "--out", ""], "--out: it is empty: give a path"),
    "nowhere to import to": (["map", "import", "a.yaml", "--out", ""], "--out: it is empty"),
    "nowhere to draw": (["map", "show", ".", "--out", ""], "--out: it is empty"),
    "no run": (["map", "info", ""], "RUN_DIR: it is empty"),
    "a port above the last": (["web", "--port", "65536"], "there are 0 to 65535"),
    "no host for the page": (["web", "--host", ""], "--host: it is empty: 127.0.0.1 is this"),
    "no request": (["ctl"], "REQUEST"),
    "no such option of a request": (["ctl", "goto", "7", "--x"], "unrecognized arguments: --x"),
    "two configurations": (["run", "a.yaml", "b.yaml"], "b.yaml"),
}


@pytest.mark.parametrize(("arguments", "named"), BAD_ARGUMENTS.values(), ids=BAD_ARGUMENTS)
def test_bad_arguments_are_one_line_that_names_them_and_exit_2(
    arguments: list[str], named: str, capsys: Captured
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    (line,) = said(capsys)
    assert named in line
    assert "--help" in line


BAD_CONFIGURATIONS = {
    "missing file": (["run", "absent.yaml"], "absent.yaml: cannot read the file"),
    "mistyped configuration": (["run", "turtelbot2"], "did you mean turtlebot2.yaml?"),
    "missing file to explore": (["explore", "--config", "absent.yaml"], "absent.yaml"),
    "override without value": (["explore", "--set", "robot.name"], "must be key=value"),
    "unknown key": (["explore", "--set", "robot.nmae=x"], "did you mean robot.name?"),
    "unknown profile": (["explore", "--set", "twin.base.odometry=ideal"], "one of perfect"),
    "a directory for a world": (["explore", "--world", "/"], "/: cannot read the file: Is a dir"),
    "mistyped world": (["explore", "--world", "flor_plan:7"], "did you mean floor_plan:7?"),
    "a seed for a world that has none": (["explore", "--world", "office:3"], "takes no seed"),
    "mistyped world that has no seed": (["explore", "--world", "ofice:3"], "mean office? or"),
    "a directory to replay": (["replay", "."], "with no recording in it: explore or run with"),
    "no run to show": (["map", "show", "absent"], "there is no directory absent"),
    "no run to tell of": (["map", "info", "/"], "/ is no run directory: there is no map"),
    "a file to show": (["map", "show", "/etc/passwd"], "is a file: give the dir"),
    "a recording to show": (["map", "info", __file__], f"replay {shlex.quote(__file__)} makes one"),
    "seed out of range": (["explore", "--seed", str(2**40)], "twin.seed"),
}


@pytest.mark.parametrize(
    ("arguments", "named"), BAD_CONFIGURATIONS.values(), ids=BAD_CONFIGURATIONS
)
def test_a_bad_configuration_is_one_line_that_names_it_and_exits_2(
    arguments: list[str],
    named: str,
    capsys: Captured,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    (line,) = said(capsys)
    assert line.startswith("gvgbot: ")
    assert named in line


def test_of_a_directory_to_replay_the_recording_in_it_is_named(
    tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "run.mcap").touch()
    assert main(["replay", str(tmp_path)]) == 2
    (line,) = said(capsys)
    assert line.endswith(f"; give {tmp_path / 'run.mcap'}")


def test_a_missing_file_to_replay_is_taken_for_no_directory(
    tmp_path: Path, capsys: Captured
) -> None:
    assert main(["replay", str(tmp_path / "absent.mcap")]) == 2
    (line,) = said(capsys)
    assert line.endswith("absent.mcap: No such file or directory")


@pytest.mark.parametrize("name", ["k\udcfcche.yaml", "two\nlines.yaml", "it's a 'map'.yaml"])
def test_a_world_is_looked_for_under_whatever_name_a_file_may_have(
    name: str, tmp_path: Path
) -> None:
    hall, start = open_world("hall")
    assert start is not None
    world = save_world(hall, tmp_path).rename(tmp_path / name)
    where = [str(start.x), str(start.y), str(start.theta)]
    out = ["--out", str(tmp_path / "run"), "--set", "twin.time_limit_s=1"]
    main(["explore", "--world", str(world), "--start", *where, *out])
    assert (tmp_path / "run" / "summary.json").exists()


def test_a_team_that_shall_be_recorded_is_refused(tmp_path: Path, capsys: Captured) -> None:
    settings = ["--set", f"recording.path={tmp_path}/x.mcap", "--out", str(tmp_path / "run")]
    assert main(["explore", "--world", "ring", "--robots", "2", *settings]) == 2
    (line,) = said(capsys)
    assert "recording.path: a team is not recorded" in line
    assert not list(tmp_path.iterdir())


def test_virtual_walls_are_not_for_a_team_of_which_each_has_its_own_map(
    tmp_path: Path, capsys: Captured
) -> None:
    settings = ["--set", "autonomy.virtual_walls=[[[1, 2], [3, 4]]]", "--out", f"{tmp_path}/run"]
    assert main(["explore", "--world", "ring", "--robots", "2", *settings]) == 2
    (line,) = said(capsys)
    assert "autonomy.virtual_walls: they are on the map of one robot" in line
    assert not list(tmp_path.iterdir())


def test_a_recording_that_cannot_begin_leaves_no_run_in_the_way(
    tmp_path: Path, capsys: Captured
) -> None:
    words = ["explore", "--world", "ring", "--out", str(tmp_path / "run")]
    assert main([*words, "--set", f"recording.path={tmp_path}/nowhere/x.mcap"]) == 2
    (line,) = said(capsys)
    assert "nowhere" in line
    assert not list(tmp_path.iterdir())


def test_robots_that_have_no_room_are_too_many(tmp_path: Path, capsys: Captured) -> None:
    room = np.zeros((32, 32), np.uint8)
    room[2:-2, 2:-2] = 254  # 1.4 m wide
    Image.fromarray(room).save(tmp_path / "tiny.png")
    path = tmp_path / "tiny.yaml"
    path.write_text("{image: tiny.png, resolution: 0.05, origin: [0, 0, 0]}", encoding="utf-8")
    words = ["explore", "--robots", "2", "--world", str(path), "--start", "0.8", "0.8", "0"]
    assert main([*words, "--out", str(tmp_path / "run")]) == 2
    (line,) = said(capsys)
    assert line.endswith("no room for 2 robots; take fewer")


def test_a_missing_extra_is_one_line_to_copy_whatever_the_shell_knows(capsys: Captured) -> None:
    def lacking() -> int:
        with extra_for("the page needs websockets", "web", "websockets"):
            raise ModuleNotFoundError(name="websockets.http11")

    assert status_of(lacking) == 1
    (line,) = said(capsys)
    assert f": {shlex.quote(sys.executable)} -m pip install 'gvgbot[web]'" in line


def test_what_is_proposed_can_be_pasted_where_a_path_has_spaces(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", "/my robot/bin/python")
    install = shlex.split(str(ExtraMissing("bags need rosbags", "ros2")).partition(": ")[2])
    assert install == ["/my robot/bin/python", "-m", "pip", "install", "gvgbot[ros2]"]
    recording = tmp_path / "my run.mcap"
    recording.touch()
    assert main(["map", "info", str(recording)]) == 2
    words = shlex.split(capsys.readouterr().err)
    assert words[words.index("replay") + 1] == str(recording)


@pytest.mark.parametrize("error", [OSError(errno.EIO, "Input/output error"), PermissionError()])
def test_an_error_of_the_system_that_nobody_foresaw_keeps_its_traceback(error: OSError) -> None:
    with pytest.raises(type(error)) as raised:
        status_of(lambda: raising(error))
    assert raised.value is error


def test_every_mistake_of_a_configuration_has_its_own_line(
    capsys: Captured, tmp_path: Path
) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("{robto: {}, laser: {skip: many}}", encoding="utf-8")
    assert main(["run", str(path), "--set", "base.heading=nose"]) == 2
    assert len(said(capsys)) == 3


def raising(error: BaseException) -> int:
    raise error


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (UsageError("no such world"), 2),
        (ConfigError("no such world"), 2),
        (WorldError("no such world"), 2),
        (DeviceLost("no such world"), 1),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_becomes_its_line_and_its_exit_status(
    error: Exception, status: int, capsys: Captured
) -> None:
    assert status_of(lambda: raising(error)) == status
    assert said(capsys) == ["gvgbot: no such world"]


def test_what_may_not_be_read_or_written_is_named(capsys: Captured) -> None:
    error = PermissionError(13, "Permission denied", "/var/lib/gvgbot/map.geojson")
    assert status_of(lambda: raising(error)) == 1
    (line,) = said(capsys)
    assert "/var/lib/gvgbot/map.geojson: permission denied" in line


def test_a_name_longer_than_any_file_may_have_is_wrong(capsys: Captured) -> None:
    assert main(["map", "info", 300 * "a"]) == 2
    (line,) = said(capsys)
    assert line.endswith("File name too long: choose a shorter one")


def test_a_full_disk_to_print_to_is_one_line(capsys: Captured) -> None:
    """As where `> log` leads."""

    def show() -> int:
        with Path("/dev/full").open("w") as full:
            print("a line", file=full, flush=True)
        return 0

    assert status_of(show) == 1
    assert said(capsys) == ["gvgbot: output: no space left: make room"]


@pytest.mark.parametrize("asked", ["--version", "explore --help"])
def test_help_that_finds_no_room_is_not_lost_in_silence(asked: str) -> None:
    with Path("/dev/full").open("wb") as full:
        words = [sys.executable, "-m", "gvgbot", *asked.split()]
        ended = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (1, "gvgbot: output: no space left: make room\n")


@pytest.mark.parametrize("text", ["", "Unable to allocate 452. MiB"])
def test_a_world_that_no_memory_can_hold_is_one_line(text: str, capsys: Captured) -> None:
    tasks = ExceptionGroup("tasks", [MemoryError(text)])
    assert status_of(lambda: raising(tasks)) == 1
    (line,) = said(capsys)
    assert line.startswith("gvgbot: out of memory")
    assert text in line


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_what_a_task_met_with_is_said_and_not_that_a_task_met_with_something(
    number: int, capsys: Captured
) -> None:
    full = OSError(number, "No space left on device", "events.jsonl")
    tasks = ExceptionGroup("tasks", [ExceptionGroup("more", [full]), ValueError("later")])
    assert status_of(lambda: raising(tasks)) == 1
    assert said(capsys) == ["gvgbot: events.jsonl: no space left: make room"]


def test_an_interrupted_command_says_so_and_exits_as_shells_expect(capsys: Captured) -> None:
    assert status_of(lambda: raising(KeyboardInterrupt())) == 128 + 2
    assert said(capsys) == ["gvgbot: interrupted"]


def test_a_mistake_of_the_program_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        status_of(lambda: raising(ZeroDivisionError()))


NOBODY_READS = """
import sys
from gvgbot.cli import status_of
from gvgbot.cli.arguments import say
sys.exit(status_of(lambda: say("vertices")))
"""


def test_a_reader_that_has_gone_is_no_news() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    program = [sys.executable, "-c", NOBODY_READS]
    done = subprocess.run(
        program, stdout=writer, stderr=subprocess.PIPE, check=False, env=environment
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, b"")


@pytest.mark.parametrize("status", [0, 1])
def test_the_exit_status_of_a_command_is_passed_on(status: int) -> None:
    assert status_of(lambda: status) == status


def test_the_usage_of_a_command_fits_the_usual_terminal(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for command in ("ctl", "monitor", "web"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


@pytest.mark.parametrize(
    "command", ["explore", "run", "map show", "map info", "map export", "map diff", "replay"]
)
def test_every_command_explains_itself_with_an_example(command: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*command.split(), "--help"])
    assert caught.value.code == 0
    assert f"example: gvgbot {command}" in " ".join(capsys.readouterr().out.split())


def test_the_version_is_the_package_s(capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"gvgbot {__version__}\n"
