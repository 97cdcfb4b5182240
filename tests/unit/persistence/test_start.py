"""Where a run begins, by what was asked for and what is there."""

import shlex
import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest
import structlog

from gvgbot.autonomy.events import Requested
from gvgbot.cli import main
from gvgbot.config import Config, ServiceConfig, load_config
from gvgbot.errors import UsageError
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import Keeper
from gvgbot.persistence.mission_files import SNAPSHOT, SNAPSHOT_BEFORE
from gvgbot.persistence.start import Start, Wanted, begin, held, state_directory, wanted
from gvgbot.session import Session
from tests.unit.persistence.test_mission_files import written

STORED = Path(__file__).parents[2] / "data" / "mission_v1"
ELSEWHERE = {"STATE_DIRECTORY": "/var/lib/gvgbot:/var/lib/other"}


@pytest.mark.parametrize(
    ("configured", "environment", "expected"),
    [
        (None, {}, None),
        (None, {"STATE_DIRECTORY": ""}, None),
        (None, ELSEWHERE, Path("/var/lib/gvgbot")),
        ("/data", ELSEWHERE, Path("/data")),
    ],
)
def test_the_state_directory_is_the_configured_one_or_the_service_s(
    configured: str | None, environment: dict[str, str], expected: Path | None
) -> None:
    config = Config(service=ServiceConfig(state_dir=configured))
    assert state_directory(config, environment) == expected


def begun(wanted: Wanted) -> Start:
    with ExitStack() as stack:
        return begin(wanted, world="office", stack=stack)


def mission(path: Path) -> Path:
    path.mkdir(parents=True)
    written(path)
    return path


def test_the_first_run_of_a_state_directory_is_a_new_one(tmp_path: Path) -> None:
    start = begun(Wanted(state_dir=tmp_path))
    assert start.directory.path == tmp_path / "runs" / "office-1"
    assert start.saved is None


def test_the_run_with_the_highest_number_that_left_a_mission_goes_on(tmp_path: Path) -> None:
    for number in (2, 9, 10):
        mission(tmp_path / "runs" / f"office-{number}")
    (tmp_path / "runs" / "office-11").mkdir()  # ended before it had seen anything
    (tmp_path / "runs" / "office-10" / "events.jsonl").write_text("{}\n")
    start = begun(Wanted(state_dir=tmp_path))
    assert start.directory.path.name == "office-10"
    assert start.saved is not None
    assert len(start.saved.past) == 5
    assert (start.directory.path / "events.jsonl").read_text() == "{}\n"


def test_a_new_mission_goes_on_after_a_restart_whatever_older_ones_were_removed(
    tmp_path: Path,
) -> None:
    mission(tmp_path / "runs" / "office-5")
    new = begun(Wanted(anew=True, state_dir=tmp_path)).directory.path
    written(new)
    assert begun(Wanted(state_dir=tmp_path)).directory.path == new


def test_a_new_mission_goes_on_after_a_restart_whatever_the_robot_was_called(
    tmp_path: Path,
) -> None:
    mission(tmp_path / "runs" / "old-7")
    new = begun(Wanted(anew=True, state_dir=tmp_path)).directory.path
    assert new.name.startswith("office-")
    written(new)
    assert begun(Wanted(state_dir=tmp_path)).directory.path == new


def test_a_real_robot_does_not_go_on_with_the_map_of_a_simulated_one(tmp_path: Path) -> None:
    """Who tries the service with the twins first finds no office in the building."""
    runs = tmp_path / "runs"
    real, simulated = mission(runs / "office-1"), runs / "office-2"
    shutil.copytree(STORED, simulated)  # of a twin
    for is_simulated, expected in ((None, simulated), (True, simulated), (False, real)):
        start = begun(Wanted(state_dir=tmp_path, simulated=is_simulated))
        assert start.directory.path == expected
        assert start.saved is not None
    shutil.rmtree(real)
    with structlog.testing.capture_logs() as logs:
        start = begun(Wanted(state_dir=tmp_path, simulated=False))
    assert start.saved is None
    assert start.directory.path == runs / "office-3"
    assert [log["event"] for log in logs] == ["mission passed over"]


def test_only_one_mission_is_begun_because_another_cannot_be_read(tmp_path: Path) -> None:
    damaged = mission(tmp_path / "runs" / "office-9")
    for name in (SNAPSHOT, SNAPSHOT_BEFORE):
        (damaged / name).write_bytes(b"?")
    new = begun(Wanted(state_dir=tmp_path)).directory.path
    assert new != damaged
    written(new)
    again = begun(Wanted(state_dir=tmp_path))
    assert again.directory.path == new
    assert again.saved is not None


@pytest.mark.parametrize("given", ["anew", "out"])
def test_a_new_map_can_be_asked_for(tmp_path: Path, given: str) -> None:
    old = mission(tmp_path / "runs" / "office-1")
    out = tmp_path / "elsewhere" if given == "out" else None
    start = begun(Wanted(out=out, anew=given == "anew", state_dir=tmp_path))
    assert start.saved is None
    assert start.directory.path == (out or tmp_path / "runs" / "office-2")
    assert (old / SNAPSHOT).exists()


def test_a_known_map_begins_a_run_of_its_own(tmp_path: Path) -> None:
    known = mission(tmp_path / "known")
    before = {path.name: path.read_bytes() for path in known.iterdir()}
    start = begun(Wanted(known=known, state_dir=tmp_path))
    assert start.saved is not None
    assert start.directory.path == tmp_path / "runs" / "office-1"
    assert not start.files.is_begun
    assert {path.name: path.read_bytes() for path in known.iterdir()} == before


def test_a_run_begun_with_a_known_map_goes_on_when_it_is_started_with_that_again(
    tmp_path: Path,
) -> None:
    """As a service does whose command has `--map`; what was asked for must outlive it."""
    known = mission(tmp_path / "known")
    first = begun(Wanted(known=known, state_dir=tmp_path))
    with RunDirectory(first.directory.path) as directory:
        session = Session(load_config(), directory, None)
        keeper = Keeper(session, first.files, first.saved)
        session.pipeline.errands.pause()
        keeper.on_event(Requested(1.0, "pause", "test", True, ""))
        keeper.finish()
    again = begun(Wanted(known=known, state_dir=tmp_path))
    assert again.directory.path == first.directory.path
    assert again.saved is not None
    assert again.saved.memory.intent.is_paused
    assert len(again.saved.past) == 5
    assert not again.saved.is_current  # nobody vouches for where it is
    known.rename(tmp_path / "elsewhere")
    assert begun(Wanted(known=known, state_dir=tmp_path)).directory.path == first.directory.path
    with pytest.raises(UsageError, match=r"cannot begin with .*: there is no such directory"):
        begun(Wanted(known=known, anew=True, state_dir=tmp_path))
    (tmp_path / "elsewhere").rename(known)
    anew = begun(Wanted(known=known, anew=True, state_dir=tmp_path))
    assert anew.directory.path != first.directory.path
    other = begun(Wanted(known=first.directory.path, state_dir=tmp_path))
    assert other.directory.path != first.directory.path


def test_one_run_at_a_time_writes_to_a_directory(tmp_path: Path) -> None:
    with held(tmp_path):
        with pytest.raises(UsageError, match="in use"), held(tmp_path):
            pass
        with pytest.raises(UsageError, match="in use"), held(tmp_path):
            pass
    with held(tmp_path):
        assert list(tmp_path.iterdir()) == []


def test_a_mission_is_not_read_while_another_program_writes_to_it(tmp_path: Path) -> None:
    """It may end the next moment, and what it wrote since would be cut off."""
    run = mission(tmp_path / "runs" / "office-1")
    with held(run), pytest.raises(UsageError, match="in use"):
        begun(Wanted(state_dir=tmp_path))
    with ExitStack() as stack:
        start = begin(Wanted(state_dir=tmp_path), world="office", stack=stack)
        assert start.saved is not None
        with pytest.raises(UsageError, match="in use"):
            begun(Wanted(state_dir=tmp_path))
    with held(run):
        pass


@pytest.mark.parametrize("is_resumed", [False, True])
def test_a_directory_that_is_made_again_is_held_again(tmp_path: Path, is_resumed: bool) -> None:
    if is_resumed:
        mission(tmp_path / "runs" / "office-1")
    with ExitStack() as stack:
        start = begin(Wanted(state_dir=tmp_path), world="office", stack=stack)
        path = start.directory.path
        assert (start.saved is not None) == is_resumed
        shutil.rmtree(path)
        start.directory.write({"map.geojson": "{}"})
        with pytest.raises(UsageError, match="in use"), held(path):
            pass
    with held(path):
        pass


def test_links_in_a_ring_are_no_map(tmp_path: Path) -> None:
    (tmp_path / "ring").symlink_to(tmp_path / "ring")
    with pytest.raises(UsageError, match="cannot begin with"):
        begun(Wanted(known=tmp_path / "ring"))


def test_a_mission_that_cannot_be_read_stays_where_it_is(tmp_path: Path) -> None:
    old = mission(tmp_path / "runs" / "office-1")
    for name in (SNAPSHOT, SNAPSHOT_BEFORE):
        (old / name).write_bytes(b"?")
    with structlog.testing.capture_logs() as logs:
        start = begun(Wanted(state_dir=tmp_path))
    assert start.directory.path.name == "office-2"
    assert (old / SNAPSHOT).read_bytes() == b"?"
    assert [log["event"] for log in logs] == ["mission cannot be read, a new one begins"]


def test_of_a_directory_without_a_mission_what_may_have_been_meant_is_named(tmp_path: Path) -> None:
    runs, floor = tmp_path / "runs", tmp_path / "floor"
    floor.mkdir()
    with pytest.raises(UsageError, match=r"give the directory of a run$"):
        begun(Wanted(known=floor))
    mission(runs / "office-1")
    with pytest.raises(UsageError, match=f"such as {runs / 'office-1'}$"):
        begun(Wanted(known=runs))
    (floor / "map.yaml").touch()
    with pytest.raises(UsageError, match=f"try gvgbot map import {floor}/map.yaml --out"):
        begun(Wanted(known=floor))


@pytest.mark.parametrize("is_damaged", [False, True])
def test_what_to_do_without_a_mission_can_be_pasted_into_a_shell(
    is_damaged: bool, tmp_path: Path
) -> None:
    """That of a later version, or one that is cut short, is no mission either."""
    floor = tmp_path / "my floor"
    floor.mkdir()
    (floor / "map.yaml").touch()
    if is_damaged:
        (floor / SNAPSHOT).write_bytes(b"?")
    with pytest.raises(UsageError, match="cannot begin with") as refused:
        begun(Wanted(known=floor))
    command = str(refused.value).partition("; try ")[2]
    expected = ["gvgbot", "map", "import", f"{floor}/map.yaml", "--out", f"{floor}-imported"]
    assert shlex.split(command) == expected


def test_of_a_file_for_a_known_map_what_may_have_been_meant_is_named(tmp_path: Path) -> None:
    picture, floor = mission(tmp_path / "run") / "map.png", tmp_path / "floor.yaml"
    picture.touch()
    floor.touch()
    with pytest.raises(UsageError, match=f"give the directory of the run, {tmp_path / 'run'}$"):
        begun(Wanted(known=picture))
    with pytest.raises(UsageError, match=f"try gvgbot map import {floor} --out floor$"):
        begun(Wanted(known=floor))


def test_the_known_map_is_the_configured_one_unless_an_option_names_another() -> None:
    config = Config(service=ServiceConfig(map=Path("floor")))
    assert wanted(config, {}).known == Path("floor")
    assert wanted(config, {}, known=Path("hall")).known == Path("hall")
    assert wanted(Config(), {}).known is None


@pytest.mark.parametrize("given", [["--map", "{}"], ["--set", "service.map={}"]])
@pytest.mark.parametrize("damage", [None, b"?"])
def test_a_known_map_that_cannot_be_read_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: bytes | None, given: list[str]
) -> None:
    if damage is not None:
        (tmp_path / SNAPSHOT).write_bytes(damage)
    with pytest.raises(UsageError):
        begun(Wanted(known=tmp_path))
    arguments = ["--set", "telemetry.enabled=false", "--out", str(tmp_path / "out")]
    assert main(["run", *(word.format(tmp_path) for word in given), *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(tmp_path) in line
    assert not (tmp_path / "out").exists()
