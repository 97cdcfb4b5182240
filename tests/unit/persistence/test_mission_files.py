"""The files of a mission under everything that can happen to a disk."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from gvgbot.autonomy.keyframes import Keyframe, Step
from gvgbot.autonomy.memory import Growth, remember
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import Config
from gvgbot.geometry import Pose
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT, SNAPSHOT_BEFORE, MissionFiles
from gvgbot.persistence.mission_state import Batch, Beat, Header, Rows, Snapshot
from gvgbot.persistence.records import Damaged, packed, record, records
from gvgbot.session import Tally


def beat(stamp: float) -> Beat:
    tally = Tally(first_stamp=0.0, last_stamp=stamp, contacts=0, closures=0, recoveries=0)
    return Beat(stamp=stamp, boot="b", ahead=0.0, tally=tally, odometer=None)


def snapshot(stamp: float, last: Keyframe | None = None) -> bytes:
    config = Config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    pipeline.past.travelled = stamp
    pipeline.past.keyframes += [] if last is None else [last]
    return packed(Snapshot(memory=remember(pipeline), beat=beat(stamp)))


def batch(first: int, count: int = 1, *, since: float = 0.0) -> bytes:
    """Keyframes a metre and a second apart, a row with each."""
    places = [Pose(since + i, 0.0, 0.0) for i in range(first, first + count)]
    growth = [
        Growth(
            Keyframe(place.x, place, place, place, None),
            Step(Pose(1.0, 0.0, 0.0), np.eye(3)) if place.x > since else None,
            [],
        )
        for place in places
    ]
    poses = np.array([(place.x, 0.0, 0.0) for place in places])
    rows = Rows(
        stamps=poses[:, 0],
        keyframes=list(range(first, first + count)),
        odom_base=poses,
        map_base=poses,
        world_base=np.empty((0, 3)),
    )
    return packed(Batch(first=first, growth=growth, rows=rows, beat=beat(since + first + count)))


def written(path: Path, batches: int = 5) -> MissionFiles:
    files = MissionFiles(path)
    for i in range(batches):
        files.append(batch(i), sync=False)
    files.save(snapshot(3.0))
    files.save(snapshot(4.0))
    return files


def places(path: Path) -> list[float]:
    saved = MissionFiles(path).read()
    assert saved is not None
    assert len(saved.journey.stamps) == len(saved.past)
    return [grown.keyframe.map_base.x for grown in saved.past]


def is_current(path: Path) -> bool:
    saved = MissionFiles(path).read()
    assert saved is not None
    return saved.is_current


def test_where_nothing_was_written_nothing_is_read(tmp_path: Path) -> None:
    assert MissionFiles(tmp_path).read() is None


def test_all_that_was_written_is_read(tmp_path: Path) -> None:
    written(tmp_path)
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert places(tmp_path) == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert saved.memory.travelled == 4.0
    assert saved.beat.stamp == 5.0  # the journal is younger


def test_a_batch_that_takes_the_place_of_others_leaves_nothing_of_them(tmp_path: Path) -> None:
    files = written(tmp_path)
    files.append(batch(2), sync=True, after=2)
    data = (tmp_path / JOURNAL).read_bytes()
    assert [end for _, end in records(data)][-1] == len(data)
    assert places(tmp_path) == [0.0, 1.0, 2.0]


def test_a_batch_that_does_not_follow_the_one_before_ends_the_past(tmp_path: Path) -> None:
    files = written(tmp_path, batches=2)
    for first in (3, 4, 2):
        files.append(batch(first), sync=True)
    assert places(tmp_path) == [0.0, 1.0]


@pytest.mark.parametrize("cut", [1, 8, 40])
def test_a_journal_that_was_cut_has_lost_its_last_batch_only(tmp_path: Path, cut: int) -> None:
    written(tmp_path)
    data = (tmp_path / JOURNAL).read_bytes()
    (tmp_path / JOURNAL).write_bytes(data[:-cut])
    assert places(tmp_path) == [0.0, 1.0, 2.0, 3.0]


def test_a_flipped_bit_in_the_tail_costs_the_tail_only_and_the_journal_goes_on(
    tmp_path: Path,
) -> None:
    written(tmp_path)
    data = bytearray((tmp_path / JOURNAL).read_bytes())
    ends = [end for _, end in records(bytes(data))]
    data[(ends[-2] + ends[-1]) // 2] ^= 4
    (tmp_path / JOURNAL).write_bytes(data)
    files = MissionFiles(tmp_path)
    assert files.read() is not None
    files.append(batch(4, 3), sync=True)
    assert places(tmp_path) == [float(i) for i in range(7)]


@pytest.mark.parametrize("content", [b"", b"gvg", b"\0" * 500])
def test_without_a_journal_there_is_still_a_map(tmp_path: Path, content: bytes) -> None:
    written(tmp_path)
    (tmp_path / JOURNAL).write_bytes(content)
    assert places(tmp_path) == []


@pytest.mark.parametrize("size", [0, 10, 900])
def test_of_a_snapshot_that_was_cut_the_one_before_is_read(tmp_path: Path, size: int) -> None:
    written(tmp_path)
    data = (tmp_path / SNAPSHOT).read_bytes()
    (tmp_path / SNAPSHOT).write_bytes(data[:size])
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert saved.memory.travelled == 3.0


def test_a_snapshot_of_the_map_before_has_no_part_in_a_map_that_was_begun_anew(
    tmp_path: Path,
) -> None:
    """The new map's journal tells of a robot that may have been moved before it began."""
    files = MissionFiles(tmp_path)
    files.append(batch(0, since=3.0), sync=False)
    files.save(snapshot(2.0, Keyframe(2.0, Pose(), Pose(), Pose(), None)))
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert (saved.past, saved.counts, list(saved.journey.stamps)) == ([], [], [])
    assert not saved.is_current
    files.append(batch(0, 4), sync=False, after=0)
    assert places(tmp_path) == [0.0, 1.0, 2.0, 3.0]
    assert is_current(tmp_path)


def test_a_crash_between_the_two_renamings_loses_nothing(tmp_path: Path) -> None:
    written(tmp_path)
    (tmp_path / SNAPSHOT).replace(tmp_path / SNAPSHOT_BEFORE)
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert saved.memory.travelled == 4.0


def test_two_damaged_snapshots_are_named(tmp_path: Path) -> None:
    written(tmp_path)
    for name in (SNAPSHOT, SNAPSHOT_BEFORE):
        (tmp_path / name).write_bytes(b"?")
    with pytest.raises(Damaged, match=SNAPSHOT):
        MissionFiles(tmp_path).read()


def test_a_later_version_is_not_guessed_at(tmp_path: Path) -> None:
    content = record(packed(Header("gvgbot snapshot", 2))) + record(snapshot(1.0))
    (tmp_path / SNAPSHOT).write_bytes(content)
    with pytest.raises(Damaged, match="version 2"):
        MissionFiles(tmp_path).read()


def test_a_new_mission_forgets_the_one_that_was_there(tmp_path: Path) -> None:
    written(tmp_path)
    MissionFiles(tmp_path).append(batch(0), sync=False)
    assert MissionFiles(tmp_path).read() is None
    assert not (tmp_path / SNAPSHOT_BEFORE).exists()


@contextmanager
def full_disk(room: int) -> Iterator[None]:
    """No file grows beyond so many bytes; what fits is written first, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("room", [0, 20, 150])
def test_a_disk_without_room_for_a_batch_takes_it_later(tmp_path: Path, room: int) -> None:
    files = written(tmp_path)
    size = (tmp_path / JOURNAL).stat().st_size
    with full_disk(size + room), pytest.raises(OSError, match="too large"):
        files.append(batch(5, 40), sync=True)
    assert (tmp_path / JOURNAL).stat().st_size == size  # half a batch takes no room from others
    assert places(tmp_path) == [float(i) for i in range(5)]
    with full_disk(size + room):
        files.fall_behind()
    assert not is_current(tmp_path)
    files.append(batch(5, 40), sync=True)
    assert is_current(tmp_path)
    assert places(tmp_path) == [float(i) for i in range(45)]


def test_a_mission_that_goes_on_without_its_journal_keeps_its_snapshots_on_a_full_disk(
    tmp_path: Path,
) -> None:
    written(tmp_path)
    (tmp_path / JOURNAL).write_bytes(b"")
    files = MissionFiles(tmp_path)
    assert files.read() is not None
    with full_disk(100), pytest.raises(OSError, match="too large"):
        files.append(batch(0, 40), sync=True)
    for name in (SNAPSHOT, SNAPSHOT_BEFORE):
        assert (tmp_path / name).exists()
    assert places(tmp_path) == []
    files.append(batch(0, 40), sync=True)
    assert places(tmp_path) == [float(i) for i in range(40)]


def test_a_disk_without_room_for_a_snapshot_keeps_the_old_ones(tmp_path: Path) -> None:
    files = written(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with full_disk(200), pytest.raises(OSError, match="too large"):
        files.save(snapshot(9.0))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def gone(path: Path) -> None:
    for file in path.iterdir():
        file.unlink()
    path.rmdir()


def became_a_directory(path: Path) -> None:
    (path / JOURNAL).unlink()
    (path / JOURNAL).mkdir()


def test_without_a_journal_that_can_be_read_there_is_still_a_map(tmp_path: Path) -> None:
    written(tmp_path)
    became_a_directory(tmp_path)
    assert places(tmp_path) == []


@pytest.mark.parametrize("mishap", [gone, became_a_directory])
def test_what_cannot_be_written_is_an_error_and_no_loss(
    tmp_path: Path, mishap: Callable[[Path], None]
) -> None:
    path = tmp_path / "run"
    path.mkdir()
    files = written(path)
    mishap(path)
    with pytest.raises(OSError, match="journal"):
        files.append(batch(5), sync=True)


def test_a_damaged_snapshot_does_not_push_out_the_whole_one_before_it(tmp_path: Path) -> None:
    written(tmp_path)
    newest = tmp_path / SNAPSHOT
    newest.write_bytes(newest.read_bytes()[:-5])
    again = MissionFiles(tmp_path)
    saved = again.read()
    assert saved is not None
    assert saved.memory.travelled == 3.0
    again.save(snapshot(5.0))
    newest.write_bytes(newest.read_bytes()[:-5])
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert saved.memory.travelled == 3.0
