import errno
import json
import math
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from gvgbot.autonomy.events import Recovery
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.maps.run_directory import RunDirectory
from tests.unit.persistence.test_mission_files import full_disk


@dataclass(frozen=True)
class LoopClosed:
    stamp: float
    vertex: int
    offset_m: float


def names(directory: Path) -> set[str]:
    return {path.name for path in directory.iterdir()}


def test_runs_of_a_world_are_numbered(tmp_path: Path) -> None:
    for _ in range(2):
        RunDirectory.create(world="office", runs=tmp_path / "runs").close()
    RunDirectory.create(world="cave", runs=tmp_path / "runs").close()
    assert names(tmp_path / "runs") == {"office-1", "office-2", "cave-1"}


@pytest.mark.parametrize(("after_all", "number"), [(False, 13), (True, 31)])
def test_a_number_is_greater_than_those_before(
    tmp_path: Path, after_all: bool, number: int
) -> None:
    for name in ("office-2", "office-12", "office-old", "cave-30", "office.yaml-40x", "50"):
        (tmp_path / name).mkdir()
    with RunDirectory.create(world="office", runs=tmp_path, after_all=after_all) as run:
        assert run.path == tmp_path / f"office-{number}"


def test_a_directory_that_was_asked_for_is_made_with_its_parents(tmp_path: Path) -> None:
    with RunDirectory.create(tmp_path / "a" / "b", world="office") as run:
        run.write({"map.pgm": b"P5", "map.yaml": "image: map.pgm — ü\n"})
    assert (tmp_path / "a" / "b" / "map.pgm").read_bytes() == b"P5"
    assert (tmp_path / "a" / "b" / "map.yaml").read_text("utf-8") == "image: map.pgm — ü\n"


@pytest.mark.parametrize("out", ["file", "file/below"])
def test_a_file_in_the_way_is_a_usage_error(tmp_path: Path, out: str) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UsageError, match=r"cannot write a run to .*file"):
        RunDirectory.create(tmp_path / out, world="office")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_file_where_the_runs_should_go_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("mine")
    with pytest.raises(UsageError, match="cannot write a run"):
        RunDirectory.create(world="office", runs=tmp_path / "runs")


@pytest.mark.parametrize("below", ["", "runs"])
def test_a_link_to_a_disk_that_is_not_there_is_a_usage_error(tmp_path: Path, below: str) -> None:
    link = tmp_path / "link"
    link.symlink_to("/media/none")
    for out in (None, link / below):
        with pytest.raises(UsageError, match="link to /media/none, which is not there"):
            RunDirectory.create(out, world="office", runs=link / below)


def test_a_directory_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").mkdir()
    with pytest.raises(UsageError, match="directory"):
        RunDirectory.create(tmp_path, world="office")


def test_a_failed_write_keeps_the_whole_old_set(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as run:
        run.write({"map.geojson": "old", "map.png": b"old"})
        before = names(tmp_path)
        with pytest.raises(GvgbotError, match=r"missing/map\.png"):
            run.write({"map.geojson": "new", "map.yaml": "new", "missing/map.png": b"new"})
        with pytest.raises(TypeError):
            run.write({"map.geojson": "new", "map.yaml": cast("bytes", 5)})
    assert names(tmp_path) == before
    assert (tmp_path / "map.geojson").read_text() == "old"


def test_the_rubble_of_a_killed_run_does_not_stay(tmp_path: Path) -> None:
    (tmp_path / ".map.png.tmp").write_bytes(b"half")
    with RunDirectory(tmp_path) as run:
        run.write({"map.png": b"whole"})
    assert names(tmp_path) == {"map.png", "events.jsonl"}


def test_every_event_is_a_line_that_is_there_at_once(tmp_path: Path) -> None:
    with RunDirectory.create(tmp_path, world="office") as run:
        for stamp in (1.5, 2.5):
            run.append_event(LoopClosed(stamp, 7, 0.04))
            last = (tmp_path / "events.jsonl").read_text().splitlines()[-1]
            assert json.loads(last) == {
                "event": "loop_closed",
                "stamp": stamp,
                "vertex": 7,
                "offset_m": 0.04,
            }
        assert (tmp_path / "events.jsonl").read_text().count("\n") == 2


def test_a_disk_that_was_full_for_a_while_has_no_half_of_an_event(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as directory:
        directory.append_event(Recovery(1.0, "turn round", "before"))
        size = (tmp_path / "events.jsonl").stat().st_size
        with full_disk(size + 20), pytest.raises(GvgbotError, match="too large"):
            directory.append_event(Recovery(2.0, "turn round", "no room for all of it"))
        directory.append_event(Recovery(3.0, "turn round", "after"))
    lines = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["stamp"] for line in lines] == [1.0, 3.0]


def test_an_opened_run_goes_on(tmp_path: Path) -> None:
    with RunDirectory.create(tmp_path, world="office") as run:
        run.append_event(LoopClosed(1.0, 1, 0.0))
        run.write_summary({"outcome": "explored"})
    with RunDirectory(tmp_path) as run:
        run.append_event(LoopClosed(2.0, 2, 0.0))
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["stamp"] for line in lines] == [1.0, 2.0]
    assert (tmp_path / "summary.json").exists()


def test_a_run_that_cannot_go_on_keeps_its_events(tmp_path: Path) -> None:
    with RunDirectory(tmp_path / "run") as run:
        run.append_event(LoopClosed(1.0, 2, 0.5))
    run = RunDirectory(tmp_path / "run")
    with pytest.raises(UsageError), run.emptied_by_failure():
        raise UsageError("its recording cannot begin")
    assert len((tmp_path / "run" / "events.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize("rest", [b'{"event": "loop_cl', b"\0" * 700, b'{"event": "l\0\0\0', b""])
def test_what_a_power_cut_has_left_of_an_event_is_cut_off(tmp_path: Path, rest: bytes) -> None:
    with RunDirectory(tmp_path) as run:
        run.append_event(LoopClosed(1.0, 1, 0.0))
    with (tmp_path / "events.jsonl").open("ab") as events:
        events.write(rest)
    with RunDirectory(tmp_path) as run:
        run.append_event(LoopClosed(2.0, 2, 0.0))
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["stamp"] for line in lines] == [1.0, 2.0]


def test_events_go_on_on_a_disk_that_was_out_for_a_while(tmp_path: Path) -> None:
    disk, pulled_out = tmp_path / "disk", tmp_path / "elsewhere"
    with RunDirectory(disk / "run") as run:
        run.append_event(LoopClosed(1.0, 1, 0.0))
        disk.rename(pulled_out)
        with pytest.raises(GvgbotError, match="No such file"):
            run.append_event(LoopClosed(2.0, 2, 0.0))
        shutil.copytree(pulled_out, disk)
        with (disk / "run" / "events.jsonl").open("ab") as events:
            events.write(b'{"event": "loop_cl')
        run.append_event(LoopClosed(2.0, 2, 0.0))
    lines = (disk / "run" / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["stamp"] for line in lines] == [1.0, 2.0]
    assert len((pulled_out / "run" / "events.jsonl").read_text().splitlines()) == 1


def test_a_list_that_was_removed_begins_anew(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as run:
        run.append_event(LoopClosed(1.0, 1, 0.0))
        (tmp_path / "events.jsonl").unlink()
        run.append_event(LoopClosed(2.0, 2, 0.0))
    assert json.loads((tmp_path / "events.jsonl").read_text())["stamp"] == 2.0


def test_of_a_list_that_ends_in_its_first_event_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").write_bytes(b'{"event": "loop_cl')
    RunDirectory(tmp_path).close()
    assert (tmp_path / "events.jsonl").read_bytes() == b""


@pytest.mark.parametrize("name", ["events.jsonl", "map.geojson", "summary.json", "snapshot.gvg"])
def test_a_run_that_is_there_stays(tmp_path: Path, name: str) -> None:
    """Whether it has ended, was killed after its map was saved, or before."""
    (tmp_path / name).write_text("mine\n")
    with pytest.raises(UsageError, match="holds a run already: choose another directory"):
        RunDirectory.create(tmp_path, world="office")
    assert names(tmp_path) == {name}
    assert (tmp_path / name).read_text() == "mine\n"


def test_a_directory_with_other_files_will_do(tmp_path: Path) -> None:
    """A world to explore, say, and the empty list of a run that did not get going."""
    (tmp_path / "floor.yaml").write_text("mine")
    for _ in range(2):
        RunDirectory.create(tmp_path, world="office").close()
    assert names(tmp_path) == {"floor.yaml", "events.jsonl"}


@pytest.mark.parametrize("others", [set(), {"floor.yaml"}])
def test_a_blank_directory_goes_and_nobody_else_s_files(tmp_path: Path, others: set[str]) -> None:
    directory = RunDirectory(tmp_path / "run")
    for name in others:
        (tmp_path / "run" / name).write_text("mine")
    assert directory.is_blank
    directory.remove_blank()
    assert {path.name for path in tmp_path.glob("run/*")} == others
    assert (tmp_path / "run").exists() == bool(others)


def test_a_directory_that_somebody_removes_is_made_again(tmp_path: Path) -> None:
    with RunDirectory(tmp_path / "runs" / "office-1") as directory:
        directory.append_event(LoopClosed(1.0, 3, 0.5))
        shutil.rmtree(directory.path)
        directory.append_event(LoopClosed(2.0, 3, 0.5))
        assert names(directory.path) == {"events.jsonl"}
        shutil.rmtree(directory.path)
        directory.write({"map.geojson": "{}"})
        assert names(directory.path) == {"map.geojson"}


def test_a_directory_is_not_made_where_its_disk_has_gone(tmp_path: Path) -> None:
    with RunDirectory(tmp_path / "disk" / "runs" / "office-1") as directory:
        shutil.rmtree(tmp_path / "disk" / "runs")
        with pytest.raises(GvgbotError, match="No such file"):
            directory.write({"map.geojson": "{}"})
        assert names(tmp_path / "disk") == set()


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="needs a second file system")
def test_a_directory_is_not_made_on_the_disk_below_the_one_that_has_gone(tmp_path: Path) -> None:
    mounted, at = tmp_path / "disk", tmp_path / "mnt"
    mounted.mkdir()
    at.symlink_to(mounted)
    with tempfile.TemporaryDirectory(dir="/dev/shm") as below, RunDirectory(at / "run") as run:
        at.unlink()
        at.symlink_to(below)
        with pytest.raises(GvgbotError, match="No such file"):
            run.append_event(LoopClosed(1.0, 3, 0.5))
        assert names(Path(below)) == set()


def test_a_list_of_events_that_came_with_another_disk_stays(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "run")
    (tmp_path / "run").rename(tmp_path / "hidden")
    with RunDirectory(tmp_path / "run") as other:
        other.append_event(Recovery(1.0, "back off", "bumper"))
    directory.remove_blank()
    assert (tmp_path / "run" / "events.jsonl").read_text()


def test_where_no_directory_can_be_made_for_want_of_room_that_is_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(UsageError, match=r"No space left on device, make room$"):
        RunDirectory(tmp_path / "run")


@pytest.mark.parametrize(
    "name", ["map.yaml", "map.pgm", "map.png", "seen.png", "world.yaml", "world.png"]
)
def test_a_map_that_is_no_run_s_stays(tmp_path: Path, name: str) -> None:
    """Such as the one that is to be explored."""
    (tmp_path / name).write_text("mine\n")
    with pytest.raises(UsageError, match=rf"would replace .*{name}: choose another directory"):
        RunDirectory.create(tmp_path, world="office")
    assert names(tmp_path) == {name}
    assert (tmp_path / name).read_text() == "mine\n"


def test_of_very_many_events_the_latest_stay(tmp_path: Path) -> None:
    """Ten megabytes and the ten before them at most."""
    line = 1_000_000
    with RunDirectory(tmp_path) as run:
        for number in range(35):
            run.append_event(Recovery(float(number), "", "x" * line))
    kept = [
        json.loads(text)["stamp"]
        for name in ("events-before.jsonl", "events.jsonl")
        for text in (tmp_path / name).read_text().splitlines()
    ]
    assert kept == [float(number) for number in range(35 - len(kept), 35)]
    assert 10 * line < sum(path.stat().st_size for path in tmp_path.iterdir()) < 22 * line


def test_a_summary_is_strict_json_whatever_is_in_it(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as run:
        run.write_summary(
            {
                "outcome": "stopped",
                "distance_m": np.float32(1.5),
                "duration_s": math.inf,
                "wall_s": math.nan,
                "vertices": np.int64(3),
                "completed": np.bool_(False),
                "seed": None,
                "config": {"out": Path("runs"), "laser": LoopClosed(1.0, 2, math.nan)},
                "axes": np.array([[1.0, math.nan]]),
                "pair": (1, "two"),
            }
        )

    def refuse(word: str) -> None:
        raise AssertionError(word)

    assert json.loads((tmp_path / "summary.json").read_text(), parse_constant=refuse) == {
        "outcome": "stopped",
        "distance_m": 1.5,
        "duration_s": None,
        "wall_s": None,
        "vertices": 3,
        "completed": False,
        "seed": None,
        "config": {"out": "runs", "laser": {"stamp": 1.0, "vertex": 2, "offset_m": None}},
        "axes": [[1.0, None]],
        "pair": [1, "two"],
    }


def test_a_full_disk_is_reported_in_one_line(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no device that is always full")
    (tmp_path / "events.jsonl").symlink_to("/dev/full")
    complaint = r"cannot write .*events\.jsonl: No space left"
    with RunDirectory(tmp_path) as run, pytest.raises(GvgbotError, match=complaint):
        run.append_event(LoopClosed(1.0, 1, 0.0))
