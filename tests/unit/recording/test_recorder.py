"""Recordings on disk: whole, cut, rotated, and on disks that are full or slow."""

import errno
import os
import shutil
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, Writer
from structlog.testing import capture_logs

from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.loop import Cycle
from gvgbot.config import load_config
from gvgbot.daemon import recorded
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.geometry import Pose, Twist
from gvgbot.hal.messages import Battery, Odometry, Scan
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.recording import Lived, extra_needed, recorder
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.files import SPARE_BYTES, Entry, McapFiles, free_path
from gvgbot.recording.messages import RAW
from gvgbot.recording.reader import Recording
from gvgbot.recording.recorder import Recorder
from gvgbot.replay import Wanted, open_log
from gvgbot.session import Session

ABOUT = {"title": "ring", "config": "{}"}
STILL = Twist(0.0, 0.0)


def scan(stamp: float, seed: int = 0) -> Scan:
    ranges = np.random.default_rng(seed).uniform(0.1, 5.0, 400)
    return Scan(stamp, ranges, -1.0, 0.005, 0.1, 5.6)


def cycle(stamp: float) -> Cycle:
    return Cycle(Odometry(stamp, Pose(stamp, 0.0, 0.1), STILL), Felt(), STILL, STILL)


def record(to: Recorder, cycles: int) -> list[Lived]:
    """Fifty cycles a second, a scan after each fifth; what was recorded."""
    lived: list[Lived] = []
    for k in range(cycles):
        now = cycle(0.02 * k)
        to.on_cycle(now, None)
        lived.append(now)
        if k % 5 == 4:
            seen = scan(0.02 * k - 0.01, k)
            to.on_scan(seen)
            lived.append(seen)
    return lived


def config(path: Path, **settings: Any) -> RecordingConfig:
    return RecordingConfig(path=path, **settings)


def same(one: Lived, other: Lived) -> bool:
    if isinstance(one, Scan) and isinstance(other, Scan):
        return one.stamp == other.stamp and one.ranges.tobytes() == other.ranges.tobytes()
    return one == other


def read(path: Path) -> list[Lived]:
    return [message for _, message in Recording(path).messages()]


def assert_begins_as(found: Sequence[Lived], lived: Sequence[Lived]) -> None:
    assert all(same(a, b) for a, b in zip(found, lived, strict=False))
    assert len(found) <= len(lived)


def test_what_is_recorded_is_read_in_the_same_order(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        lived = record(to, 100)
        battery = Battery(1.0, 15.5, 0.8, charging=False)
        last = cycle(9.0)
        to.on_cycle(last, battery)
        to.on_cycle(last, battery)
    found = read(tmp_path / "run.mcap")
    assert len(found) == len(lived) + 3
    assert_begins_as(found, [*lived, last, battery, last])
    recording = Recording(tmp_path / "run.mcap")
    assert recording.about.title == "ring"
    times = [at for at, _ in recording.messages()]
    assert times == sorted(times)
    assert (recording.cut, recording.damaged, recording.missing) == ([], 0, None)


def test_messages_that_another_program_has_taken_out_of_their_chunks_are_read(
    tmp_path: Path,
) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        lived = record(to, 100)
    with (tmp_path / "run.mcap").open("rb") as file, (tmp_path / "flat.mcap").open("wb") as flat:
        reader, writer = make_reader(file), Writer(flat, use_chunking=False)
        writer.start()
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        ids: dict[str, int] = {}
        for _, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic not in ids:
                ids[channel.topic] = writer.register_channel(channel.topic, "protobuf", 0)
            at = message.log_time
            writer.add_message(ids[channel.topic], at, message.data, at)
        writer.finish()
    recording = Recording(tmp_path / "flat.mcap")
    found = [message for _, message in recording.messages()]
    assert_begins_as(found, lived)
    assert (len(found), recording.damaged) == (len(lived), 0)


def test_the_battery_is_taken_down_when_it_changes_and_once_a_minute(tmp_path: Path) -> None:
    """A base tells of it fifty times a second, with a stamp of its own each time."""
    stamps = np.arange(0.0, 100.0, 0.5).tolist()
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        for stamp in stamps:
            voltage = 15.5 if stamp < 20.0 else 15.4
            to.on_cycle(cycle(stamp), Battery(stamp, voltage, 0.8, charging=False))
    taken = [one for one in read(tmp_path / "run.mcap") if isinstance(one, Battery)]
    assert [(one.stamp, one.voltage) for one in taken] == [(0.0, 15.5), (20.0, 15.4), (80.0, 15.4)]


def test_requests_that_were_granted_are_counted(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT | {"resumed": "yes"}) as to:
        for done in (True, False, True):
            to.on_event({"event": "requested", "stamp": 1.0, "done": done})
    recording = Recording(tmp_path / "run.mcap")
    assert list(recording.messages()) == []
    assert (recording.requests, recording.about.resumed) == (2, True)


def test_another_reader_finds_all_topics_with_their_schemas(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        record(to, 10)
        to.on_event({"event": "decision", "stamp": 0.2, "reason": "ear"})
        to.on_bytes("base", b"\xaa\x55", said=True)
    with (tmp_path / "run.mcap").open("rb") as file:
        found = [
            (channel.topic, "" if schema is None else schema.name)
            for schema, channel, _ in make_reader(file).iter_messages()
        ]
    assert found.count(("/scan", "foxglove.LaserScan")) == 2
    assert found.count(("/cycle", "gvgbot.Cycle")) == 10
    assert found.count(("/tf", "foxglove.FrameTransform")) == 10
    assert found.count(("/events", "gvgbot.Event")) == 1
    assert found.count(("/raw/base/said", "")) == 1


def test_a_file_cut_at_any_byte_is_read_to_the_cut(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        lived = record(to, 250)
    whole = (tmp_path / "run.mcap").read_bytes()
    cut, lengths = tmp_path / "cut.mcap", []
    rng = np.random.default_rng(7)
    for size in [0, 1, 8, 9, 40, *sorted(rng.integers(0, len(whole), 200).tolist())]:
        cut.write_bytes(whole[:size])
        try:
            recording = Recording(cut)
        except UsageError:
            assert size < 1000
            continue
        found = [message for _, message in recording.messages()]
        assert recording.cut == [cut]
        assert_begins_as(found, lived)
        lengths.append(len(found))
    assert lengths == sorted(lengths)
    assert len(set(lengths)) > 3
    cut.write_bytes(whole[: len(whole) // 2])
    assert len(read(cut)) > 0.2 * len(lived)


def test_of_several_files_the_last_may_be_cut_at_any_byte(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap", file_mb=0.3), ABOUT, patient=True) as to:
        lived = record(to, 1400)
    last = max(tmp_path.iterdir(), key=lambda path: path.stem)
    whole = last.read_bytes()
    last.unlink()
    before, lengths = len(read(tmp_path / "run.mcap")), []
    rng = np.random.default_rng(11)
    for size in rng.integers(0, len(whole), 10).tolist():
        last.write_bytes(whole[:size])
        found = read(tmp_path / "run.mcap")
        assert_begins_as(found, lived)
        lengths.append(len(found))
    assert before <= min(lengths) < max(lengths)


def test_damage_costs_a_piece_and_nothing_worse(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        lived = record(to, 400)
    whole = np.frombuffer((tmp_path / "run.mcap").read_bytes(), np.uint8)
    rng = np.random.default_rng(3)
    for at in rng.integers(0, len(whole), 40).tolist():
        damaged = whole.copy()
        damaged[at] ^= 1 << int(rng.integers(8))
        (tmp_path / "bad.mcap").write_bytes(damaged.tobytes())
        try:
            recording = Recording(tmp_path / "bad.mcap")
        except UsageError:
            continue
        found = [message for _, message in recording.messages()]
        rest = iter(lived)
        assert all(any(same(one, other) for other in rest) for one in found)  # in their order
        assert len(found) == len(lived) or recording.damaged or recording.cut
        assert len(found) > 0.7 * len(lived)


@pytest.mark.parametrize(
    ("old", "new"), [(b"title", b"Title"), (b"part\1\0\0\0000", b"part\1\0\0\0p")]
)
def test_a_file_that_says_nonsense_of_itself_is_refused(
    old: bytes, new: bytes, tmp_path: Path
) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        record(to, 5)
    whole = (tmp_path / "run.mcap").read_bytes()
    assert old in whole[:1000]
    (tmp_path / "run.mcap").write_bytes(whole.replace(old, new, 1))
    with pytest.raises(UsageError, match="nothing of a gvgbot recording"):
        Recording(tmp_path / "run.mcap")


@pytest.mark.parametrize(
    ("at", "value"),
    [
        pytest.param(0, 0x7F, id="a record of no known kind, and no channels therefore"),
        pytest.param(32, 0xFF, id="a size beyond any memory"),
    ],
)
@pytest.mark.parametrize("has_index", [True, False])
def test_without_its_first_chunk_a_file_is_read_by_its_index(
    at: int, value: int, *, has_index: bool, tmp_path: Path
) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT, patient=True) as to:
        lived = record(to, 1000)
    whole = bytearray((tmp_path / "run.mcap").read_bytes())
    whole[first_chunk(whole) + at] = value
    (tmp_path / "run.mcap").write_bytes(whole if has_index else whole[:-9])
    recording = Recording(tmp_path / "run.mcap")
    found = [message for _, message in recording.messages()]
    if has_index:
        assert recording.damaged == 1
        assert len(found) > 0.8 * len(lived)
        assert all(map(same, found, lived[-len(found) :]))
    else:
        assert found == []
        assert recording.damaged > 1


def test_one_wrong_bit_costs_one_piece(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT, patient=True) as to:
        lived = record(to, 1000)
    whole = bytearray((tmp_path / "run.mcap").read_bytes())
    with (tmp_path / "run.mcap").open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes  # type: ignore[union-attr]
    hit = chunks[len(chunks) // 2]
    whole[hit.chunk_start_offset + hit.chunk_length // 2] ^= 1
    (tmp_path / "run.mcap").write_bytes(whole)
    recording = Recording(tmp_path / "run.mcap")
    found = [message for _, message in recording.messages()]
    assert recording.damaged == 1
    assert recording.cut == []
    assert same(found[-1], lived[-1])
    assert 1 - 2 / len(chunks) < len(found) / len(lived) < 1


def test_a_file_that_is_cut_or_missing_before_others_is_told(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap", file_mb=0.3), ABOUT, patient=True) as to:
        lived = record(to, 2000)
    whole = len(read(tmp_path / "run.mcap"))
    assert whole == len(lived)
    first, second = tmp_path / "run.mcap", tmp_path / "run.1.mcap"
    second.write_bytes(second.read_bytes()[:100_000])
    recording = Recording(first)
    found = [message for _, message in recording.messages()]
    assert recording.cut == [second]
    assert same(found[-1], lived[-1])
    second.unlink()
    recording = Recording(first)
    found = [message for _, message in recording.messages()]
    assert recording.missing == second
    assert_begins_as(found, lived)


def test_a_file_that_is_copied_without_those_that_follow_says_so(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap", file_mb=0.3), ABOUT, patient=True) as to:
        record(to, 2000)
    parts = ["", *(f".{number}" for number in range(1, len(list(tmp_path.iterdir()))))]
    missing = []
    for part in parts:
        (tmp_path / f"run{part}.mcap").rename(tmp_path / f"copy{part}.mcap")
        recording = Recording(tmp_path / "copy.mcap")
        assert list(recording.messages())
        missing.append(recording.missing)
    assert missing == [*(tmp_path / f"copy{part}.mcap" for part in parts[1:]), None]


def test_a_recording_behind_another_in_one_file_is_told(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        lived = record(to, 100)
    whole = (tmp_path / "run.mcap").read_bytes()
    joined = tmp_path / "joined.mcap"
    told = f"but:     {joined} has another one after its end, left out"
    for content, flaws in [(whole, []), (whole + whole, [told])]:
        joined.write_bytes(content)
        log = open_log(Wanted(path=joined, config=None, overrides=[], no_echo_m=None))
        assert len(list(log.messages)) == len(lived)
        assert log.flaws() == flaws


def test_a_recording_of_which_no_map_can_be_made_says_what_it_lacks(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(config(path), ABOUT) as to:
        to.on_cycle(cycle(1.0), None)
    log = open_log(Wanted(path=path, config=None, overrides=[], no_echo_m=None))
    assert len(list(log.messages)) == 1
    assert log.flaws() == ["but:     there is not one scan in it"]


def test_a_power_failure_costs_a_megabyte_at_most(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = [0]  # bytes of the file that the disk has, each time that it is told to keep them
    monkeypatch.setattr(os, "fsync", lambda file: kept.append(os.fstat(file).st_size))
    data, noise = 200_000, np.random.default_rng(1)  # no packing makes it smaller
    files = McapFiles(tmp_path / "run.mcap", ABOUT, file_bytes=1e9, total_bytes=1e9)
    for k in range(20):
        files.write([Entry(RAW["laser"][False], k, k, noise.bytes(data))])
        assert files.path.stat().st_size - kept[-1] <= 1e6
    files.finish()
    assert len(kept) > 3


def first_chunk(whole: bytes | bytearray) -> int:
    """Where its kind is said: a byte, and the length of what follows."""
    at = len(MCAP0_MAGIC)
    while whole[at] != Opcode.CHUNK:
        at += 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
    return at


@pytest.mark.parametrize("suffix", [".mcap", "", ".1"])
def test_files_follow_each_other_and_are_read_as_one(suffix: str, tmp_path: Path) -> None:
    with Recorder(config(tmp_path / f"run{suffix}", file_mb=0.3), ABOUT, patient=True) as to:
        lived = record(to, 2000)
    names = {path.name for path in tmp_path.iterdir()}
    assert {f"run{suffix}", f"run.1{suffix}", f"run.2{suffix}"} <= names
    found = read(tmp_path / f"run{suffix}")
    assert len(found) == len(lived)
    assert_begins_as(found, lived)
    later = read(tmp_path / f"run.1{suffix}")
    assert 0 < len(later) < len(lived)
    assert_begins_as(later[::-1], lived[::-1])


def test_what_follows_and_is_no_file_is_named(tmp_path: Path) -> None:
    with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
        record(to, 5)
    (tmp_path / "run.1.mcap").mkdir()
    with pytest.raises(UsageError, match=r"cannot read .*run\.1\.mcap: Is a directory"):
        read(tmp_path / "run.mcap")


def test_the_oldest_files_go_when_there_are_too_many_bytes(tmp_path: Path) -> None:
    limited = config(tmp_path / "run.mcap", file_mb=0.1, total_mb=0.5)
    with Recorder(limited, ABOUT, patient=True) as to:
        lived = record(to, 3000)
    assert not (tmp_path / "run.mcap").exists()
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 0.7e6
    assert len(list(tmp_path.iterdir())) >= 2
    oldest = min(tmp_path.iterdir(), key=lambda path: int(path.name.split(".")[1]))
    assert_begins_as(read(oldest)[::-1], lived[::-1])


def test_where_there_is_room_for_two_files_the_one_before_the_last_stays(tmp_path: Path) -> None:
    limited = config(tmp_path / "run.mcap", file_mb=0.1, total_mb=0.2)
    with Recorder(limited, ABOUT, patient=True) as to:
        lived = record(to, 3000)
    before, last = sorted(tmp_path.iterdir(), key=lambda path: int(path.name.split(".")[1]))
    assert before.stat().st_size > 0.1e6
    assert before.stat().st_size + last.stat().st_size < 0.3e6
    assert_begins_as(read(before)[::-1], lived[::-1])


@pytest.mark.parametrize("others", [0, 7])
def test_what_room_is_left_on_a_disk_is_the_missions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, others: int
) -> None:
    """Of a disk with room for seven pieces of a megabyte, seven of which others may take later."""
    data, noise, taken = 250_000, np.random.default_rng(1), 0.0  # no packing makes it smaller

    def disk_usage(path: Path) -> SimpleNamespace:
        held = sum(file.stat().st_size for file in path.iterdir())
        return SimpleNamespace(free=int(SPARE_BYTES + 7.5e6 - held - taken))

    monkeypatch.setattr(shutil, "disk_usage", disk_usage)
    files = McapFiles(tmp_path / "run.mcap", ABOUT, file_bytes=1e6, total_bytes=1e9)
    for k in range(60):
        files.write([Entry(RAW["laser"][False], k, k, noise.bytes(data))])
    kept = sorted(file.name for file in tmp_path.iterdir())
    assert 6 <= len(kept) <= 8
    assert "run.mcap" not in kept
    taken = 1e6 * others
    if others:
        with pytest.raises(OSError, match="less than 50 MB are left"):
            files.write([Entry(RAW["laser"][False], 60, 60, noise.bytes(1_100_000))])
    else:
        files.finish()
    (last, *_) = sorted(tmp_path.iterdir(), key=lambda file: int(file.suffixes[0][1:]))[::-1]
    with last.open("rb") as stream:
        assert make_reader(stream).get_summary() is not None  # it has its index


@pytest.fixture
def on_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Session]:
    nearly_full = SimpleNamespace(free=SPARE_BYTES - 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: nearly_full)
    settings = load_config(overrides=[f"recording.path={tmp_path / 'run.mcap'}"])
    with RunDirectory(tmp_path / "run") as directory:
        yield Session(settings, directory, None)
    assert not (tmp_path / "run.mcap").exists()


def test_a_robot_that_starts_on_a_full_disk_does_without_a_recording(on_full_disk: Session) -> None:
    """It is switched on again in a corridor, and nobody is there."""
    with capture_logs() as logged, recorded(on_full_disk, patient=False):
        assert on_full_disk.recorder is None
    assert [line["event"] for line in logged] == ["not recorded, exploring on"]


def test_a_simulation_that_cannot_be_recorded_does_not_begin(on_full_disk: Session) -> None:
    with pytest.raises(UsageError, match="less than 50 MB are left"):
        recorded(on_full_disk, patient=True)


def test_a_file_that_cannot_be_begun_is_not_left_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, "start", full)
    with pytest.raises(UsageError, match="No space left on device"):
        Recorder(config(tmp_path / "run.mcap"), ABOUT)
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_recording_stays(tmp_path: Path) -> None:
    for _ in range(2):
        with Recorder(config(tmp_path / "run.mcap"), ABOUT) as to:
            record(to, 5)
    assert {path.name for path in tmp_path.iterdir()} == {"run.mcap", "run-2.mcap"}
    (tmp_path / "run-2.1.mcap").touch()
    (tmp_path / "run-2.mcap").unlink()
    assert free_path(tmp_path / "run.mcap").name == "run-3.mcap"


def test_what_is_left_of_a_recording_stays_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "run[1].1.mcap").touch()
    assert free_path(tmp_path / "run[1].mcap").name == "run[1]-2.mcap"


class FullDisk(McapFiles):
    """Has room for one batch only."""

    left = 1

    def write(self, entries: Sequence[Entry]) -> None:
        if self.left == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.left -= 1
        super().write(entries)


def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path: Path) -> None:
    with (
        capture_logs() as logged,
        Recorder(config(tmp_path / "run.mcap"), ABOUT, files=FullDisk) as to,
    ):
        record(to, 200)
    said = [line for line in logged if line["event"] == "recording ended"]
    assert len(said) == 1
    assert said[0]["reason"] == "No space left on device"


def test_the_kernels_own_full_disk_is_survived() -> None:
    with (
        capture_logs() as logged,
        Recorder(config(Path("run.mcap")), ABOUT, files=OnDevFull) as to,
    ):
        record(to, 500)
    assert [line["event"] for line in logged] == ["recording ended"]


class OnDevFull(McapFiles):
    """Writes where nothing ever fits."""

    def __init__(self, first: Path, about: dict[str, str], **limits: float) -> None:
        super().__init__(Path("/dev/full"), about, **limits)

    def _open(self) -> None:
        self.path = self._first
        self._start(self.path.open("r+b", buffering=0))


class SlowDisk(McapFiles):
    """Waits until it is told to go on."""

    may_write = threading.Event()

    def write(self, entries: Sequence[Entry]) -> None:
        self.may_write.wait()
        super().write(entries)


def test_a_slow_disk_delays_nobody_and_the_gap_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "MOST_WAITING", 100_000)
    with capture_logs() as logged:
        with Recorder(config(tmp_path / "run.mcap"), ABOUT, files=SlowDisk) as to:
            record(to, 500)  # would never return if it waited
            SlowDisk.may_write.set()
            monkeypatch.setattr(recorder, "MOST_WAITING", 0)
            while to.is_behind:  # until all is written
                pass
            monkeypatch.setattr(recorder, "MOST_WAITING", 100_000)
            record(to, 30)  # too little to be behind again
        assert [line["event"] for line in logged] == [
            "recording cannot keep up: messages are left out",
            "recording goes on",
        ]
    recording = Recording(tmp_path / "run.mcap")
    kept = len(list(recording.messages()))
    assert recording.left_out == logged[1]["left_out"] > 0
    assert kept < 636


@pytest.mark.parametrize("name", ["", "missing/run.mcap"])
def test_where_nothing_can_be_written_nothing_begins(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"recording\.path"):
        Recorder(config(tmp_path / name), ABOUT)


def test_there_must_be_room_for_two_files(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="total_mb"):
        config(tmp_path, file_mb=10.0, total_mb=15.0)


@pytest.mark.parametrize("name", ["mcap", "mcap.writer", "google", "zstandard"])
def test_a_missing_package_is_one_clear_line(name: str) -> None:
    with pytest.raises(GvgbotError, match=r"gvgbot\[record\]"), extra_needed():
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def test_another_missing_module_is_a_mistake_of_the_program() -> None:
    with pytest.raises(ModuleNotFoundError), extra_needed():
        raise ModuleNotFoundError("No module named 'gvgbot.other'", name="gvgbot.other")
