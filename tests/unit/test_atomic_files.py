"""What is on the disk, and when, if the power may be cut at any moment."""

import errno
import os
import stat
import threading
from pathlib import Path

import pytest

from gvgbot.atomic_files import replace_file, write_all, write_files
from gvgbot.errors import GvgbotError

OLD = {"map.yaml": b"old", "map.png": b"old"}
NEW: dict[str, bytes | str] = {"map.yaml": "new\n", "map.png": b"new one"}


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    write_files(tmp_path, OLD)
    return tmp_path


def contents(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def is_directory(descriptor: int) -> bool:
    return stat.S_ISDIR(os.fstat(descriptor).st_mode)


def test_all_is_on_the_disk_before_an_old_file_goes_and_then_its_name(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int | str] = []

    def fsync(descriptor: int) -> None:
        if is_directory(descriptor):
            assert contents(directory) == {"map.yaml": b"new\n", "map.png": b"new one"}
            synced.append("directory")
        else:
            assert contents(directory).items() >= OLD.items()
            synced.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    write_files(directory, NEW)
    assert set(synced[:-1]) == {4, 7}
    assert synced[-1] == "directory"


def test_a_slow_disk_takes_files_that_belong_together_at_once(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    both = threading.Barrier(2, timeout=60.0)

    def fsync(descriptor: int) -> None:
        if not is_directory(descriptor):
            both.wait()

    monkeypatch.setattr(os, "fsync", fsync)
    write_files(directory, NEW)
    assert contents(directory) == {"map.yaml": b"new\n", "map.png": b"new one"}


def test_where_no_thread_can_be_started_files_are_written_all_the_same(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(thread: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("threading.Thread.start", refuse)
    write_files(directory, NEW)
    assert contents(directory) == {"map.yaml": b"new\n", "map.png": b"new one"}


def test_a_disk_that_does_not_take_a_file_keeps_the_old_ones(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(GvgbotError, match=r"map\.png .*Input/output error"):
        write_files(directory, NEW)
    assert contents(directory) == OLD


def test_a_disk_on_which_nothing_can_be_removed_either_is_no_other_failure(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when the kernel makes a failing card read-only; then a daemon must explore on."""

    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(os, "fsync", refuse)
    monkeypatch.setattr(os, "unlink", refuse)
    with pytest.raises(GvgbotError, match="Read-only file system"):
        write_files(directory, NEW)


def test_a_filesystem_may_be_unable_to_sync_a_directory(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(descriptor: int) -> None:
        if is_directory(descriptor):
            raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", fsync)
    write_files(directory, NEW)
    assert (directory / "map.png").read_bytes() == b"new one"


def test_what_takes_a_file_s_place_is_on_the_disk_before_the_old_one_moves(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int | str] = []

    def fsync(descriptor: int) -> None:
        if is_directory(descriptor):
            assert contents(directory) == {**OLD, "map.png": b"new one", "before.png": b"old"}
            synced.append("directory")
        else:
            assert contents(directory).items() >= OLD.items()
            synced.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    replace_file(directory / "map.png", b"new one", keep=directory / "before.png")
    assert synced == [7, "directory"]


def test_a_disk_that_does_not_take_what_replaces_a_file_keeps_both_old_ones(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(OSError, match="Input/output error"):
        replace_file(directory / "map.png", b"new", keep=directory / "map.yaml")
    assert contents(directory) == OLD


def test_what_is_taken_in_parts_is_written_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, data: write(file, data[:3]))
    with (tmp_path / "file").open("wb", buffering=0) as file:
        write_all(file.fileno(), b"one, two, three")
    assert (tmp_path / "file").read_bytes() == b"one, two, three"
