"""Keeps a session's mission on disk as it goes, and brings it back.

The journal gets what is new twice a second, and while nothing is, now and then a sign of life,
by which it is known later that the base has counted all the time. The snapshot is renewed when the
map has changed or the robot has come on, at most that often; the journal is synchronised with the
disk before. A disk that is full, read-only or slow holds up nothing: what was not written is
written later, bit by bit, and then the snapshot, which never knows more than the journal.
"""

import asyncio
import contextlib
import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import msgspec
import structlog

from gvgbot.autonomy import events
from gvgbot.autonomy.memory import growth, remember
from gvgbot.autonomy.returning import ReturningPipeline
from gvgbot.autonomy.views import Observation
from gvgbot.clock import Clock, LoopClock, OffLoop
from gvgbot.drivers.kobuki.feedback import FeedbackReader
from gvgbot.persistence.mission_files import MissionFiles
from gvgbot.persistence.mission_state import (
    Batch,
    Beat,
    Count,
    Saved,
    Snapshot,
    boot_id,
    rows,
)
from gvgbot.persistence.records import packed
from gvgbot.session import Session

KEEP_EVERY = 0.5  # s between two batches
RETRY_WITHIN = 30.0  # s between two attempts, at most, while the disk refuses
MOST = 500  # keyframes in a batch: it is packed on the loop, and in memory
SNAPSHOT_EVERY = 5.0  # s between two snapshots, if nothing but the robot's place has changed
KEPT_WITHIN = 1.0  # s that who asks for something waits, at most, until it is kept
BEAT_EVERY = 20.0  # s between two signs of life, while nothing is new
_PAUSE_S = 1.0  # that the robot's clock is said to have stood while the computer was off
_COUNTING_S = 60.0  # away for longer, the base's counters may have come round
_SETTLED = (
    events.VertexAdded,
    events.VertexRemoved,
    events.VertexMoved,
    events.EdgeJoined,
    events.LoopClosed,
    events.DoubtSettled,
    events.ClosureRevoked,
    events.Requested,
    events.ErrandEnded,
    events.Finished,
    events.WayForgotten,
)
_RETELLING = (events.VertexMoved, events.ClosureRevoked, events.DoubtSettled)

log = structlog.get_logger()


class Keeper:
    """Writes what a session learns into its run directory, after bringing back what is there.

    Whoever has a keeper makes the robot's clock and its links by it.
    """

    def __init__(
        self,
        session: Session,
        files: MissionFiles,
        saved: Saved | None = None,
        *,
        boot: str | None = None,
    ) -> None:
        """Make the session what was `saved`, if it was; in other files if it shall begin there.

        `boot` names the computer's start, if it is not to be asked.
        """
        self._session, self._files, self._saved = session, files, saved
        self._boot = boot_id() if boot is None else boot
        self._ahead = 0.0  # s, the robot's clock minus the computer's
        self._feedback: FeedbackReader | None = None
        self._counts: list[Count] = []  # of what is in the journal after each batch
        self._stay = math.inf  # keyframes in the journal, the first: others have been forgotten
        self._observed: list[Observation] | None = None  # in the journal, if that is known
        self._is_retold = False  # some may be others since
        self._beat_at = -math.inf  # stamp of the last batch
        self._snapshot_at = -math.inf  # stamp of the last snapshot
        self._snapshot_of = -1  # keyframes in it
        self._settled = False  # the map has changed since the last snapshot
        self._is_asked = False  # for something, in this life
        self._urgent = asyncio.Event()  # to keep what it was asked for last
        self._wish_kept = asyncio.Event()  # or tried to be
        self._goes_on = files.is_begun  # in the files in which it ended
        self._same_life = False  # the computer and its clock have gone on since
        self.trouble: str | None = None  # why nothing can be written just now
        if saved is not None:
            self._revive(saved)

    # -- coming back -------------------------------------------------------------------------------

    def _revive(self, saved: Saved) -> None:
        session = self._session
        config = session.config
        session.begin_with(
            ReturningPipeline(
                config.mind,
                config.exploration,
                config.robot.radius_m,
                saved.memory,
                saved.past,
                self._is_vouched,
                localisation=config.localisation,
            )
        )
        if self._goes_on:
            self._counts = list(saved.counts)
        if self._files.is_read:
            session.count_on(saved.beat.tally)
            session.journey = saved.journey
            session.pipeline.errands.is_paused |= config.service.resume == "paused"
        else:  # another has lived so far
            session.pipeline.mission.outcome, session.pipeline.mission.reason = None, ""
            session.pipeline.errands.is_waiting = False
            past = session.pipeline.past
            past.lent, past.lent_m, past.sought_m = len(past.keyframes), past.travelled, 0.0
            session.pipeline.errands.forget()
            beat = msgspec.structs.replace(saved.beat, tally=session.tally)
            self._saved = replace(saved, beat=beat)

    def _is_vouched(self) -> bool:
        """Whether the base has counted all the time since, so that it cannot have driven."""
        counted = self._saved is not None and self._saved.beat.odometer is not None
        heard = self._feedback is not None and self._feedback.is_unbroken
        return self._goes_on and counted and heard

    def clock(self) -> LoopClock:
        """The robot's clock, which goes on from where it ended; on the running loop."""
        clock = LoopClock()
        if self._saved is not None:
            beat, now = self._saved.beat, clock.now()
            is_same_boot = beat.boot == self._boot and now + beat.ahead >= beat.stamp
            self._same_life = self._goes_on and is_same_boot
            self._ahead = beat.ahead if self._same_life else beat.stamp + _PAUSE_S - now
            clock = LoopClock(self._ahead)
        return clock

    def attach(self, feedback: FeedbackReader) -> None:
        """Let odometry go on from where it ended: the wheels may have turned meanwhile."""
        self._feedback = feedback
        if self._saved is not None and (beat := self._saved.beat).odometer is not None:
            away = LoopClock(self._ahead).now() - beat.stamp
            counting = self._same_life and self._saved.is_current and away < _COUNTING_S
            feedback.recall(beat.odometer, counting=counting)

    # -- keeping -----------------------------------------------------------------------------------

    def on_event(self, event: events.Event) -> None:
        """Note what happened: a map that has changed is kept at once, and so is a wish."""
        self._settled = self._settled or isinstance(event, _SETTLED)
        if isinstance(event, events.Requested) and event.done:
            self._is_asked = True
            self._wish_kept.clear()
            self._urgent.set()
        self._is_retold |= isinstance(event, _RETELLING)
        if isinstance(event, events.WayForgotten):
            self._stay = min(self._stay, event.kept)

    async def keep(self, clock: Clock, off_loop: OffLoop) -> None:
        """Keep the mission until cancelled; wait longer each time while that cannot be.

        What the robot is asked for does not wait.
        """
        pause, due, next_wish = KEEP_EVERY, clock.now(), clock.now()
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(KEEP_EVERY):
                    await self._urgent.wait()
            is_urgent = self._urgent.is_set()
            if clock.now() < due and not is_urgent:
                continue
            if is_urgent:
                await clock.sleep_until(next_wish)  # of a crowd all are kept at once
                next_wish = clock.now() + KEEP_EVERY
            errands = self._session.pipeline.errands
            is_told_to_stand = errands.is_paused and not (errands.is_carried or errands.unfit)
            if is_urgent and is_told_to_stand:
                await off_loop(partial(self._files.note_rest, rests=True))  # until all is written
            self._urgent.clear()
            await off_loop(self.keeping(clock.now()))
            if not self._urgent.is_set():
                self._wish_kept.set()
            pause = KEEP_EVERY if self.trouble is None else min(2.0 * pause, RETRY_WITHIN)
            due = clock.now() + pause

    async def wish_kept(self) -> None:
        """Wait until what was asked for is on the disk, but not long for one that is slow or full.

        Who was told that the robot stands does not expect it to drive after a power cut.
        """
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(KEPT_WITHIN):
                await self._wish_kept.wait()

    def keeping(self, stamp: float) -> Callable[[], None]:
        """A function that writes what is new at a stamp, in a thread or later.

        That is `MOST` keyframes at once, and the others the next time. Call each such function
        before asking for the next.
        """
        pipeline = self._session.pipeline
        if pipeline.errands.unfit:
            if not pipeline.errands.is_map_spoilt:
                return _nothing  # of the end that this makes: it goes on where it was
            return self._files.forget if self._saved is None else self._files.fall_behind
        if pipeline.is_lost:
            return self._keeping_wish()
        if not (pipeline.past.keyframes or self._is_asked):
            return _nothing
        self._note_retold(pipeline.mapper.observations)
        after = bisect_right(self._counts, self._stay, key=lambda count: count.keyframes)
        before = self._counts[after - 1] if after else Count(0, 0)
        count = self._count(before)
        if count == before and not self._settled:
            if stamp < self._beat_at + BEAT_EVERY:
                return _nothing
            # one sign of life takes another's place
            after = bisect_left(self._counts, count, hi=after) + 1
        beat = self._beat(stamp)
        batch = Batch(
            first=before.keyframes,
            growth=growth(pipeline, before.keyframes, count.keyframes),
            rows=rows(self._session.journey, before.rows, count.rows),
            beat=beat,
        )
        is_all = count.keyframes == len(pipeline.past.keyframes)
        due = is_all and (self._settled or stamp - self._snapshot_at >= SNAPSHOT_EVERY)
        snapshot = None
        if due and (self._settled or self._snapshot_of < len(pipeline.past.keyframes)):
            snapshot = packed(Snapshot(memory=remember(pipeline), beat=beat, known=self._known))
            self._settled = False
        self._stay, self._observed = math.inf, list(pipeline.mapper.observations)
        counts, rests = [*self._counts[:after], count], pipeline.errands.is_resting
        write = partial(self._write, packed(batch), counts, snapshot, stamp)
        return partial(write, is_all=is_all, rests=rests)

    def _count(self, before: Count) -> Count:
        """How much the journal shall hold after a batch: no less than it held already."""
        journey, all_there_are = self._session.journey, len(self._session.pipeline.past.keyframes)
        held = self._counts[-1].keyframes if self._counts else 0
        keyframes = max(before.keyframes + MOST, held)
        if keyframes >= all_there_are:
            return Count(all_there_are, len(journey.stamps))
        return Count(keyframes, bisect_left(journey.keyframes, keyframes))

    def _note_retold(self, observations: list[Observation]) -> None:
        """See from where on the journal tells what was not seen after all, or of other vertices."""
        if self._is_retold and self._observed is not None:
            self._stay = min(self._stay, _first_changed(self._observed, observations))
        self._is_retold = False

    def _keeping_wish(self) -> Callable[[], None]:
        """A function that keeps what was asked of a robot that does not know its place.

        What it lives through meanwhile is not kept, and that it found no place neither: when it is
        started again it looks again. The map comes along where it is from elsewhere.
        """
        pipeline, saved = self._session.pipeline, self._saved
        is_gone = pipeline.is_seeking or not self._goes_on
        before = self._files.fall_behind if is_gone else _nothing
        if saved is None or not (self._settled and (self._goes_on or self._is_asked)):
            return before
        self._settled = False
        memory = remember(pipeline)
        if memory.intent.outcome == "failed":
            outcome = saved.memory.intent.outcome if self._files.is_read else None
            memory = replace(memory, intent=replace(memory.intent, outcome=outcome))
        snapshot = packed(Snapshot(memory=memory, beat=saved.beat, known=self._known))
        past, journey = None, self._session.journey
        if not self._files.is_begun:
            way = rows(journey, 0)
            past = packed(Batch(first=0, growth=growth(pipeline), rows=way, beat=saved.beat))
        count = Count(len(pipeline.past.keyframes), len(journey.stamps))
        rests = pipeline.errands.is_resting
        return partial(self._write_wish, past, count, before, snapshot, rests=rests)

    def _write_wish(
        self,
        past: bytes | None,
        count: Count,
        before: Callable[[], None],
        snapshot: bytes,
        *,
        rests: bool,
    ) -> None:
        def write() -> None:
            if past is not None:
                self._files.append(past, sync=True)
                self._counts = [count]
            before()
            self._files.save(snapshot)

        if not self._is_kept(write):
            self._settled = True
            self._files.note_rest(rests=rests)

    def finish(self) -> None:
        """Write all that is new, in parts; call when nothing runs any more."""
        self._settled = True
        heard = -math.inf if self._feedback is None else self._feedback.heard
        stamp = max(heard, self._session.tally.last_stamp)
        for _ in range(0, len(self._session.pipeline.past.keyframes) + 1, MOST):
            self.keeping(stamp)()

    def _write(
        self,
        batch: bytes,
        counts: list[Count],
        snapshot: bytes | None,
        stamp: float,
        *,
        is_all: bool,
        rests: bool,
    ) -> None:
        def write() -> None:
            self._files.append(batch, sync=snapshot is not None, after=len(counts) - 1)
            self._counts, self._beat_at = counts, stamp
            if not is_all:
                self._files.fall_behind()
            if snapshot is not None:
                self._files.save(snapshot)
                self._snapshot_at, self._snapshot_of = stamp, counts[-1].keyframes

        if not self._is_kept(write):
            self._settled = self._settled or snapshot is not None
            if self._counts is not counts:
                self._stay = min(self._stay, counts[-2].keyframes if len(counts) > 1 else 0)
            if not self._files.is_begun:  # somebody has removed the journal
                self._counts = []
            self._files.fall_behind()
            self._files.note_rest(rests=rests)

    def _is_kept(self, write: Callable[[], None]) -> bool:
        """Write, and say so if that cannot be; whether it was written."""
        try:
            write()
        except OSError as error:
            self._complain(error.strerror or str(error))
            return False
        self._complain(None)
        return True

    def _complain(self, trouble: str | None) -> None:
        """Say once that nothing can be written, and once that it can again."""
        path = str(self._session.directory.path)
        if trouble is not None and self.trouble is None:
            log.warning("mission not kept", reason=trouble, path=path)
        elif trouble is None and self.trouble is not None:
            log.info("mission kept again", path=path)
        self.trouble = trouble

    @property
    def _known(self) -> str:
        return "" if self._saved is None else self._saved.known

    def _beat(self, stamp: float) -> Beat:
        return Beat(
            stamp=stamp,
            boot=self._boot,
            ahead=self._ahead,
            tally=self._session.tally,
            odometer=None if self._feedback is None else self._feedback.memory,
        )


def _first_changed(before: list[Observation], now: list[Observation]) -> float:
    """The keyframe of the first observation that is not what it was; infinity if all are."""
    for old, new in zip(before, now, strict=False):
        if old is not new:
            return min(old.keyframe, new.keyframe)
    return before[len(now)].keyframe if len(now) < len(before) else math.inf


def _nothing() -> None:
    """Nothing is new."""
