"""The keeper: beside a disk that refuses for a while, and with a map from elsewhere."""

import asyncio
import copy
import errno
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
import pytest
import structlog

from gvgbot.autonomy.events import (
    DoubtSettled,
    LoopClosed,
    Requested,
    VertexMoved,
    WayForgotten,
)
from gvgbot.autonomy.memory import growth, recall, remember
from gvgbot.autonomy.returning import ReturningPipeline
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.kobuki.feedback import FeedbackMemory, FeedbackReader
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.persistence.keeper import (
    BEAT_EVERY,
    KEEP_EVERY,
    KEPT_WITHIN,
    MOST,
    RETRY_WITHIN,
    Keeper,
)
from gvgbot.persistence.mission_files import JOURNAL, SNAPSHOT, MissionFiles
from gvgbot.persistence.mission_state import Saved, Snapshot, boot_id
from gvgbot.persistence.records import packed
from gvgbot.session import Session
from tests.unit.persistence.test_mission_files import full_disk

MISSION = Path(__file__).parents[2] / "data" / "mission_v1"


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """One that has driven five metres."""
    saved = MissionFiles(MISSION).read()
    assert saved is not None
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    session.journey = saved.journey
    recall(session.pipeline, saved.memory, saved.past)
    return session


def test_a_full_disk_is_said_once_and_all_is_kept_when_there_is_room_again(
    session: Session, tmp_path: Path
) -> None:
    keeper = Keeper(session, MissionFiles(tmp_path))
    with structlog.testing.capture_logs() as logs:
        for room in (0, 10, 50_000):
            with full_disk(room):
                keeper.keeping(20.0)()
                assert keeper.trouble is not None
        keeper.keeping(21.0)()
        keeper.keeping(22.0)()
    assert keeper.trouble is None
    assert [(log["event"], log["log_level"]) for log in logs] == [
        ("mission not kept", "warning"),
        ("mission kept again", "info"),
    ]
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert len(saved.past) == len(session.pipeline.past.keyframes)
    assert saved.journey.stamps == session.journey.stamps
    assert packed(saved.memory) == packed(remember(session.pipeline))


def test_a_journal_that_somebody_removes_is_written_anew(session: Session, tmp_path: Path) -> None:
    """It is the largest file of a run: whoever makes room on a disk finds it first."""
    keeper, begins = Keeper(session, MissionFiles(tmp_path)), 20.0
    keeper.keeping(begins)()
    (tmp_path / JOURNAL).unlink()
    with structlog.testing.capture_logs() as logs:
        keeper.keeping(begins + BEAT_EVERY)()
        killed = found(tmp_path)
        keeper.keeping(begins + 2 * BEAT_EVERY)()
    assert [log["event"] for log in logs] == [
        "mission not kept",
        "mission kept again",
    ]
    assert packed(killed.memory) == packed(remember(session.pipeline))
    saved = found(tmp_path)
    assert packed(saved.past) == packed(growth(session.pipeline))
    assert saved.journey.stamps == session.journey.stamps
    assert saved.is_current


def test_of_a_disk_that_was_pulled_out_the_journal_goes_on(
    session: Session, tmp_path: Path
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    keeper, begins = Keeper(session, MissionFiles(disk)), 20.0
    keeper.keeping(begins)()
    written = (disk / JOURNAL).read_bytes()
    disk.rename(tmp_path / "pulled out")
    keeper.keeping(begins + BEAT_EVERY)()
    (tmp_path / "pulled out").rename(disk)
    keeper.keeping(begins + 2 * BEAT_EVERY)()
    assert (disk / JOURNAL).read_bytes().startswith(written)
    assert packed(found(disk).past) == packed(growth(session.pipeline))


@pytest.mark.parametrize("is_old", [False, True])
def test_who_is_unfit_leaves_the_map_of_before_or_none(
    session: Session, tmp_path: Path, *, is_old: bool
) -> None:
    keeper = Keeper(session, MissionFiles(tmp_path))
    keeper.keeping(20.0)()
    if is_old:
        files = MissionFiles(tmp_path)
        keeper = Keeper(session, files, files.read())
    keyframes = len(session.pipeline.past.keyframes)
    drive_on(session, 3)
    session.pipeline.errands.halt(21.0, "its laser hangs upside down", spoils_map=True)
    keeper.keeping(21.0)()
    keeper.finish()
    saved = MissionFiles(tmp_path).read()
    if is_old:
        assert saved is not None
        assert len(saved.past) == keyframes
        assert not saved.is_current
    else:
        assert saved is None


def test_whose_base_does_not_move_goes_on_with_its_map_when_it_is_started_again(
    session: Session, tmp_path: Path
) -> None:
    keeper = Keeper(session, MissionFiles(tmp_path))
    keeper.keeping(20.0)()
    keyframes = len(session.pipeline.past.keyframes)
    session.pipeline.errands.halt(21.0, "the base does not move", spoils_map=False)
    session.pipeline.mission.stop(21.0, "the base does not move", "failed")
    keeper.keeping(21.0)()
    keeper.finish()
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert len(saved.past) == keyframes
    assert saved.memory.intent.outcome is None


def drive_on(session: Session, keyframes: int) -> None:
    """Let it have so many keyframes more, a row with each."""
    pipeline, journey = session.pipeline, session.journey
    last = pipeline.past.keyframes[-1]
    pipeline.past.keyframes += [replace(last, stamp=last.stamp + i + 1.0) for i in range(keyframes)]
    pipeline.past.steps += pipeline.past.steps[-1:] * keyframes
    for keyframe in range(len(pipeline.past.keyframes) - keyframes, len(pipeline.past.keyframes)):
        journey.stamps.append(journey.stamps[-1] + 1.0)
        journey.keyframes.append(keyframe)
        journey.odom_base.append(journey.odom_base[-1])
        journey.map_base.append(journey.map_base[-1])
        if journey.world_base:
            journey.world_base.append(journey.world_base[-1])


def found(path: Path) -> Saved:
    saved = MissionFiles(path).read()
    assert saved is not None
    return saved


def test_much_that_was_not_kept_is_kept_bit_by_bit(session: Session, tmp_path: Path) -> None:
    """Until all of it is, the robot that is killed knows that it has lived through more."""
    keeper, pipeline = Keeper(session, MissionFiles(tmp_path)), session.pipeline
    keeper.keeping(20.0)()
    before, snapshot = len(pipeline.past.keyframes), (tmp_path / SNAPSHOT).read_bytes()
    drive_on(session, 2 * MOST + 100)
    keeper.on_event(DoubtSettled(21.0, 99, 98, 1.0, 0.1))
    with structlog.testing.capture_logs(), full_disk(10):
        keeper.keeping(21.0)()
    for part in (1, 2):
        keeper.keeping(21.0 + part)()
        killed = found(tmp_path)
        assert packed(killed.past) == packed(growth(pipeline, 0, before + part * MOST))
        rows = sum(keyframe < len(killed.past) for keyframe in session.journey.keyframes)
        assert killed.journey.stamps == session.journey.stamps[:rows]
        assert not killed.is_current
        assert (tmp_path / SNAPSHOT).read_bytes() == snapshot
    keeper.keeping(24.0)()
    saved = found(tmp_path)
    assert saved.is_current
    assert packed(saved.past) == packed(growth(pipeline))
    assert saved.journey.stamps == session.journey.stamps
    assert packed(saved.memory) == packed(remember(pipeline))


def test_what_the_journal_holds_is_not_taken_from_it_bit_by_bit(
    session: Session, tmp_path: Path
) -> None:
    keeper = Keeper(session, MissionFiles(tmp_path))
    keeper.keeping(20.0)()
    drive_on(session, 2 * MOST)
    for stamp in (21.0, 22.0):
        keeper.keeping(stamp)()
    keeper.on_event(DoubtSettled(23.0, 99, 98, 1.0, 0.1))
    session.pipeline.mapper.observations[0] = replace(session.pipeline.mapper.observations[0])
    keeper.keeping(23.0)()
    assert len(found(tmp_path).past) == len(session.pipeline.past.keyframes)


def test_whoever_begins_with_a_known_map_has_driven_nothing_yet(
    session: Session, tmp_path: Path
) -> None:
    """Not what was driven to make it, nor to find a place on it."""
    drive_on(session, 3)
    session.pipeline.past.sought_m = 7.0
    (tmp_path / "known").mkdir()
    Keeper(session, MissionFiles(tmp_path / "known")).finish()
    with RunDirectory(tmp_path / "run") as directory:
        again = Session(load_config(), directory, None)
    Keeper(again, MissionFiles(tmp_path / "run"), found(tmp_path / "known"))
    assert again.pipeline.driven == 0.0


def test_a_known_map_is_kept_whole_when_something_is_asked_of_a_robot_that_is_lost(
    session: Session, tmp_path: Path
) -> None:
    drive_on(session, 2 * MOST)
    keeper = Keeper(session, MissionFiles(tmp_path / "known"))
    (tmp_path / "known").mkdir()
    keeper.finish()
    with RunDirectory(tmp_path / "run") as directory:
        again = Session(load_config(), directory, None)
    keeper = Keeper(again, MissionFiles(tmp_path / "run"), found(tmp_path / "known"))
    assert again.pipeline.is_lost
    again.pipeline.mission.outcome = "failed"  # it has found no place: the next life looks again
    keeper.on_event(Requested(1.0, "pause", "test", True, ""))
    keeper.keeping(1.0)()
    assert found(tmp_path / "run").memory.intent.outcome is None
    assert isinstance(again.pipeline, ReturningPipeline)
    again.pipeline._is_back = True
    keeper.keeping(2.0)()
    assert len(found(tmp_path / "run").past) == len(session.pipeline.past.keyframes)


def test_a_disk_that_is_full_for_an_hour_is_tried_now_and_then(
    session: Session, tmp_path: Path
) -> None:
    keeper, tries = Keeper(session, MissionFiles(tmp_path)), 0

    async def at_once(work: Callable[[], None]) -> None:
        nonlocal tries
        tries += 1
        work()

    async def hour() -> None:
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(keeper.keep(clock, at_once))
            with full_disk(10):
                await clock.sleep_until(clock.now() + 3600.0)
            assert tries <= 3600.0 / RETRY_WITHIN + 10
            drive_on(session, 2 * MOST)
            await clock.sleep_until(clock.now() + RETRY_WITHIN + 4 * KEEP_EVERY)
            keeping.cancel()

    with structlog.testing.capture_logs():
        run_in_virtual_time(hour())
    assert len(found(tmp_path).past) == len(session.pipeline.past.keyframes)


def test_a_disk_with_room_for_the_journal_only_takes_nothing_from_it_when_that_is_gone_too(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = MissionFiles(tmp_path)
    keeper = Keeper(session, files)
    keeper.keeping(20.0)()

    def no_room(snapshot: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files, "save", no_room)
    with structlog.testing.capture_logs():
        for stamp in (30.0, 31.0):
            drive_on(session, 5)
            keeper.keeping(stamp)()
        held = len(session.pipeline.past.keyframes)
        assert len(found(tmp_path).past) == held
        drive_on(session, 5)
        with full_disk((tmp_path / JOURNAL).stat().st_size):
            keeper.keeping(32.0)()
    assert len(found(tmp_path).past) == held


@pytest.mark.parametrize("is_ended", [False, True], ids=["pause", "stop"])
def test_who_was_told_to_stand_stands_after_a_power_cut_though_the_disk_is_full(
    session: Session, tmp_path: Path, *, is_ended: bool
) -> None:
    """It is full for so long that it is hardly tried any more."""
    keeper, errands = Keeper(session, MissionFiles(tmp_path)), session.pipeline.errands
    keeper.keeping(20.0)()
    asked = Requested(60.0, "anything", "ana", True, "so be it")

    async def at_once(work: Callable[[], None]) -> None:
        work()

    async def story() -> None:
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(keeper.keep(clock, at_once))
            drive_on(session, 5)
            await clock.sleep_until(clock.now() + 101.0)
            assert not found(tmp_path).memory.intent.is_paused
            for rests in (True, False, True):
                if not rests:
                    errands.explore(60.0) if is_ended else errands.resume()
                else:
                    errands.stop(60.0) if is_ended else errands.pause()
                keeper.on_event(asked)
                await clock.sleep_until(clock.now() + 2 * KEEP_EVERY)
                assert found(tmp_path).memory.intent.is_paused == rests
            keeping.cancel()

    with structlog.testing.capture_logs(), full_disk(10):
        run_in_virtual_time(story())
    keeper.keeping(200.0)()
    assert packed(found(tmp_path).memory) == packed(remember(session.pipeline))


@pytest.mark.parametrize("takes_s", [0.0, 3.0], ids=["quick disk", "slow disk"])
def test_who_hears_that_the_robot_stands_finds_it_so_after_a_power_cut(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, takes_s: float
) -> None:
    """And so does who ends the program while it waits for the disk."""
    keeper, stands = Keeper(session, MissionFiles(tmp_path)), list[bool]()
    keeper.keeping(20.0)()
    monkeypatch.setattr(
        os, "fsync", lambda _: stands.append(found(tmp_path).memory.intent.is_paused)
    )

    async def off_loop(work: Callable[[], None]) -> None:
        work()
        await asyncio.sleep(takes_s)

    async def story() -> None:
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(keeper.keep(clock, off_loop))
            await clock.sleep_until(clock.now() + 0.1)  # and for long nothing is due
            session.pipeline.errands.pause()
            keeper.on_event(Requested(60.0, "pause", "ana", True, ""))
            asked = clock.now()
            await keeper.wish_kept()
            assert clock.now() - asked == pytest.approx(min(takes_s, KEPT_WITHIN))
            assert found(tmp_path).memory.intent.is_paused
            keeping.cancel()

    run_in_virtual_time(story())
    assert stands
    assert all(stands)


def test_who_paused_because_it_was_carried_looks_for_its_place_after_a_restart(
    session: Session, tmp_path: Path
) -> None:
    keeper, errands = Keeper(session, MissionFiles(tmp_path)), session.pipeline.errands
    errands.is_paused = errands.is_carried = True

    async def off_loop(work: Callable[[], None]) -> None:
        await asyncio.sleep(0.05)
        work()

    async def story() -> None:
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(keeper.keep(clock, off_loop))
            for _ in range(2):  # the second before the first is kept
                keeper.on_event(Requested(60.0, "save", "ana", True, ""))
                await clock.sleep_until(clock.now() + 0.03)
            await clock.sleep_until(clock.now() + 2.0)
            keeping.cancel()

    run_in_virtual_time(story())
    assert not found(tmp_path).memory.intent.is_paused


def test_a_crowd_of_requests_is_kept_at_once(session: Session, tmp_path: Path) -> None:
    keeper, times = Keeper(session, MissionFiles(tmp_path)), 0

    async def off_loop(work: Callable[[], None]) -> None:
        nonlocal times
        times += 1

    async def story() -> None:
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(keeper.keep(clock, off_loop))
            for number in range(1000):
                keeper.on_event(Requested(60.0, f"goto {number}", "ana", True, ""))
                await clock.sleep_until(clock.now() + 0.01)
            keeping.cancel()

    run_in_virtual_time(story())
    assert times <= 2 * 10.0 / KEEP_EVERY + 2


def test_what_did_not_change_is_not_written_again(session: Session, tmp_path: Path) -> None:
    keeper = Keeper(session, MissionFiles(tmp_path))
    keeper.keeping(20.0)()
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    for stamp in (20.5, 21.0, 20.0 + BEAT_EVERY - 0.5):
        keeper.keeping(stamp)()
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before


def test_the_journal_is_on_the_disk_before_the_snapshot_that_goes_on_from_it(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []

    def fsync(descriptor: int) -> None:
        if not (tmp_path / SNAPSHOT).exists():
            sizes.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    Keeper(session, MissionFiles(tmp_path)).keeping(20.0)()
    assert (tmp_path / JOURNAL).stat().st_size in sizes
    assert (tmp_path / SNAPSHOT).exists()


def test_a_robot_at_rest_gives_signs_of_life_that_take_no_room(
    session: Session, tmp_path: Path
) -> None:
    """By the newest it is known, a week later, that the base has counted all the time."""
    keeper, sizes = Keeper(session, MissionFiles(tmp_path)), set()
    keeper.keeping(20.0)()
    whole = (tmp_path / JOURNAL).stat().st_size
    for beat in range(1, 100):
        stamp = 20.0 + beat * BEAT_EVERY
        keeper.keeping(stamp)()
        sizes.add((tmp_path / JOURNAL).stat().st_size)
        saved = MissionFiles(tmp_path).read()
        assert saved is not None
        assert saved.beat.stamp == stamp
        assert len(saved.past) == len(session.pipeline.past.keyframes)
    assert max(sizes) < whole + 1000
    assert max(sizes) < min(sizes) + 10  # as numbers grow


def test_all_that_was_not_kept_is_kept_in_parts_at_the_end(
    session: Session, tmp_path: Path
) -> None:
    drive_on(session, 2 * MOST + 100)
    Keeper(session, MissionFiles(tmp_path)).finish()
    saved = found(tmp_path)
    assert saved.is_current
    assert packed(saved.past) == packed(growth(session.pipeline))
    assert max(np.diff([count.keyframes for count in saved.counts], prepend=0)) <= MOST


def test_a_way_that_is_forgotten_leaves_the_journal_whole_and_short(
    session: Session, tmp_path: Path
) -> None:
    """As on a patrol: of twenty keyframes and more only the newest is kept."""
    pipeline, whole = session.pipeline, copy.deepcopy(session.journey)
    keyframes = pipeline.past.keyframes.copy()
    kept, newest = len(keyframes) - 20, len(keyframes) - 1
    explored = sum(keyframe < kept for keyframe in whole.keyframes)
    keeper, sizes = Keeper(session, MissionFiles(tmp_path)), []
    session.journey.forget(kept)
    for journey, count in ((session.journey, kept), (whole, len(keyframes))):
        session.journey, pipeline.past.keyframes[:] = journey, keyframes[:count]
        keeper.keeping(20.0 + count)()
        sizes.append((tmp_path / JOURNAL).stat().st_size)
    pipeline.past.lasting, pipeline.past.keyframes[kept:] = kept, keyframes[-1:]
    del pipeline.past.steps[kept:]
    pipeline.mapper.forget_between(kept, newest)
    forgotten = WayForgotten(99.0, kept, newest - kept)
    session.note_events([forgotten])
    keeper.on_event(forgotten)
    with structlog.testing.capture_logs(), full_disk(10):
        keeper.keeping(99.0)()
    assert keeper.trouble is not None
    keeper.keeping(99.5)()
    assert sizes[0] < (tmp_path / JOURNAL).stat().st_size < sizes[1]
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert packed(saved.past) == packed(growth(pipeline))
    assert packed(saved.memory) == packed(remember(pipeline))
    assert len(saved.journey.stamps) == explored > 0


def test_a_way_is_cut_where_it_was_forgotten_even_if_the_robot_has_explored_on_since(
    session: Session, tmp_path: Path
) -> None:
    pipeline = session.pipeline
    keyframes, newest = pipeline.past.keyframes.copy(), len(pipeline.past.keyframes) - 1
    kept = newest - 20
    keeper = Keeper(session, MissionFiles(tmp_path))
    for count in (kept, newest + 1):
        pipeline.past.keyframes[:] = keyframes[:count]
        keeper.keeping(20.0 + count)()
    pipeline.past.keyframes[kept:] = keyframes[-1:] * 22  # the last one, and later ones
    del pipeline.past.steps[kept:]
    pipeline.past.steps += pipeline.past.steps[-1:] * 21
    pipeline.mapper.forget_between(kept, newest)
    keeper.on_event(WayForgotten(99.0, kept, newest - kept))
    pipeline.past.lasting = len(pipeline.past.keyframes)
    keeper.keeping(99.0)()
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert packed(saved.past) == packed(growth(pipeline))


def test_a_closure_that_was_revoked_does_not_come_back(session: Session, tmp_path: Path) -> None:
    """Nor what was seen by it: smoothing would lay the map by that."""
    pipeline, keeper = session.pipeline, Keeper(session, MissionFiles(tmp_path))
    mapper, unsettled = pipeline.mapper, pipeline.mapper.unsettled
    keyframes, steps = pipeline.past.keyframes.copy(), pipeline.past.steps.copy()
    half = len(keyframes) // 2
    mapper.observations[:] = [seen for seen in mapper.observations if seen.keyframe < half]
    pipeline.past.keyframes[half:], pipeline.past.steps[half - 1 :] = [], []
    keeper.keeping(20.0)()
    right, wrong = mapper.observations.copy(), replace(mapper.observations[-1], keyframe=half)
    unsettled.note_closure(mapper.graph.vertices[wrong.vertex], is_surprising=True)
    mapper.observations += [wrong, replace(wrong, keyframe=half + 2)]
    pipeline.past.keyframes[:], pipeline.past.steps[:] = keyframes, steps
    keeper.on_event(LoopClosed(21.0, wrong.vertex, 9.0, 1.0, 6.0, 0.9))
    keeper.keeping(21.0)()
    (edge, *_) = mapper.graph.edges.values()
    unsettled.note_way(edge, arrived=99)
    for event in unsettled.revoke(22.0):
        keeper.on_event(event)
    with structlog.testing.capture_logs(), full_disk(10):
        keeper.keeping(22.0)()
    keeper.keeping(22.5)()
    saved = MissionFiles(tmp_path).read()
    assert saved is not None
    assert mapper.observations == right
    assert packed(saved.past) == packed(growth(pipeline))


def test_what_was_seen_of_a_vertex_that_proved_to_be_another_is_kept_as_that_one_s(
    session: Session, tmp_path: Path
) -> None:
    keeper, mapper = Keeper(session, MissionFiles(tmp_path)), session.pipeline.mapper
    keeper.keeping(20.0)()
    one, other = sorted(mapper.graph.vertices)
    mapper.observations[:] = [
        replace(seen, vertex=one) if seen.vertex == other else seen for seen in mapper.observations
    ]
    keeper.on_event(DoubtSettled(21.0, other, one, 12.0, 0.1))
    keeper.keeping(21.0)()
    saved = found(tmp_path)
    assert {seen.vertex for grown in saved.past for seen in grown.observations} == {one}
    assert packed(saved.past) == packed(growth(session.pipeline))


def test_what_was_seen_of_a_vertex_before_it_proved_to_stand_elsewhere_is_not_kept(
    session: Session, tmp_path: Path
) -> None:
    keeper, mapper = Keeper(session, MissionFiles(tmp_path)), session.pipeline.mapper
    keeper.keeping(20.0)()
    stays, moved = sorted(mapper.graph.vertices)
    latest = [seen for seen in mapper.observations if seen.vertex == moved][-1]
    mapper.observations[:] = [seen for seen in mapper.observations if seen.vertex == stays]
    mapper.observations.append(replace(latest, keyframe=len(session.pipeline.past.keyframes) - 1))
    keeper.on_event(VertexMoved(21.0, moved, 0.4))
    keeper.keeping(21.0)()
    assert packed(found(tmp_path).past) == packed(growth(session.pipeline))


def test_a_robot_that_saw_nothing_leaves_no_mission(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as directory:
        keeper = Keeper(Session(load_config(), directory, None), MissionFiles(tmp_path))
    keeper.keeping(1.0)()
    keeper.finish()
    assert MissionFiles(tmp_path).read() is None


@pytest.mark.parametrize("done", [True, False])
def test_what_is_asked_of_a_robot_that_saw_nothing_yet_is_kept(tmp_path: Path, done: bool) -> None:
    """It waits for its laser, say, and is paused; after a kill it must not drive off."""
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    keeper = Keeper(session, MissionFiles(tmp_path))
    if done:
        session.pipeline.errands.pause()
    keeper.on_event(Requested(1.0, "pause", "test", done, ""))
    keeper.keeping(1.0)()
    for journal in ("whole", "damaged"):
        if journal == "damaged" and done:
            (tmp_path / JOURNAL).write_bytes(b"")
        files = MissionFiles(tmp_path)
        saved = files.read()
        assert (saved is not None) == done
        with RunDirectory(tmp_path) as directory:
            again = Session(load_config(), directory, None)
        Keeper(again, files, saved)
        assert again.pipeline.errands.is_paused == done
        assert not again.pipeline.is_lost


@pytest.mark.parametrize("resume", ["running", "paused"])
def test_an_interrupted_run_waits_if_the_configuration_says_so(tmp_path: Path, resume: str) -> None:
    shutil.copytree(MISSION, tmp_path, dirs_exist_ok=True)
    files = MissionFiles(tmp_path)
    with RunDirectory(tmp_path) as directory:
        config = load_config(overrides=[f"service.resume={resume}"])
        session = Session(config, directory, None)
    Keeper(session, files, files.read())
    assert session.pipeline.past.keyframes
    assert session.pipeline.errands.is_paused == (resume == "paused")


@pytest.mark.parametrize("journal", [None, b""], ids=["removed", "damaged"])
def test_who_had_finished_stands_though_the_journal_is_lost(
    tmp_path: Path, journal: bytes | None
) -> None:
    ended = found(MISSION).memory
    ended = replace(ended, intent=replace(ended.intent, outcome="stopped", is_waiting=True))
    snapshot = Snapshot(memory=ended, beat=found(MISSION).beat)
    MissionFiles(tmp_path).save(packed(snapshot))
    if journal is not None:
        (tmp_path / JOURNAL).write_bytes(journal)
    files = MissionFiles(tmp_path)
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    Keeper(session, files, files.read())
    assert session.pipeline.mission.outcome == "stopped"
    assert session.pipeline.errands.is_waiting
    assert session.pipeline.errands.is_resting


def test_a_first_start_with_a_known_map_was_not_interrupted(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(overrides=["service.resume=paused"]), directory, None)
    known = found(MISSION)
    intent = replace(known.memory.intent, is_paused=True, is_waiting=True)
    known = replace(known, memory=replace(known.memory, intent=intent))
    Keeper(session, MissionFiles(tmp_path), known)
    assert session.pipeline.past.keyframes
    assert not session.pipeline.errands.is_paused
    assert not session.pipeline.errands.is_waiting


class Wheels:
    """A base that has been heard again, and whether its counters are believed to have gone on."""

    is_unbroken, counting = True, False

    def recall(self, memory: FeedbackMemory, *, counting: bool) -> None:
        self.counting = counting


@pytest.mark.parametrize(
    ("goes_on", "is_current", "away_s", "counting"),
    [
        (True, True, 59.0, True),
        (True, True, 61.0, False),
        (True, False, 59.0, False),
        (False, True, 1.0, False),
    ],
    ids=["soon", "late", "something was not kept", "from elsewhere"],
)
def test_a_base_vouches_for_the_place_of_its_own_robot_alone_and_that_for_a_minute(
    tmp_path: Path, *, goes_on: bool, is_current: bool, away_s: float, counting: bool
) -> None:
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    if goes_on:
        shutil.copytree(MISSION, tmp_path, dirs_exist_ok=True)
    files, wheels = MissionFiles(tmp_path), Wheels()
    saved = files.read() if goes_on else found(MISSION)
    assert saved is not None

    async def come_back() -> bool:
        stamp = LoopClock().now() - away_s
        beat = msgspec.structs.replace(saved.beat, stamp=stamp, boot="this one", ahead=0.0)
        last = replace(saved, beat=beat, is_current=is_current)
        keeper = Keeper(session, files, last, boot="this one")
        keeper.clock()
        keeper.attach(cast(FeedbackReader, wheels))
        return keeper._is_vouched()

    assert run_in_virtual_time(come_back()) == goes_on
    assert wheels.counting == counting


def test_who_has_no_gyro_has_none_in_another_life_either(tmp_path: Path) -> None:
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(overrides=["base.heading=wheels"]), directory, None)
    lives = [session.pipeline.matching]
    Keeper(session, MissionFiles(tmp_path), MissionFiles(MISSION).read())
    lives += [session.pipeline.matching]
    assert lives == [session.config.mind.scan_matching] * 2


def test_time_goes_on_where_a_map_from_elsewhere_ended(tmp_path: Path) -> None:
    """The map may be that of a simulation on this computer, whose clock began with zero."""
    known = MissionFiles(MISSION).read()
    assert known is not None
    beat = msgspec.structs.replace(known.beat, stamp=1.0, boot=boot_id(), ahead=0.0)
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    keeper = Keeper(session, MissionFiles(tmp_path), replace(known, beat=beat))

    async def begins() -> float:
        return keeper.clock().now()

    assert asyncio.run(begins()) == pytest.approx(2.0, abs=1.0)


@pytest.mark.parametrize("boot", ["another one", ""], ids=["known to be another", "not told"])
def test_time_goes_on_after_a_restart_of_the_computer(tmp_path: Path, boot: str) -> None:
    """Some computers do not tell their starts apart, and the clock of each begins with zero."""
    with RunDirectory(tmp_path) as directory:
        session = Session(load_config(), directory, None)
    shutil.copytree(MISSION, tmp_path, dirs_exist_ok=True)
    files = MissionFiles(tmp_path)
    saved = files.read()
    assert saved is not None
    beat = msgspec.structs.replace(saved.beat, stamp=5000.0, boot="", ahead=0.0)
    keeper = Keeper(session, files, replace(saved, beat=beat), boot=boot)

    async def begins() -> float:
        return keeper.clock().now()

    assert run_in_virtual_time(begins()) > 5000.0
