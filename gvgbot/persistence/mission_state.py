"""What the files of a mission say, version 1, and how it is taken from and given to a session.

The journal is a record `Header`, then one `Batch` about every second. The snapshot is a record
`Header`, then one `Snapshot`. `docs/operations.md` describes both.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from gvgbot.autonomy.memory import Growth, Memory
from gvgbot.drivers.kobuki.feedback import FeedbackMemory
from gvgbot.geometry import Array
from gvgbot.report import Journey
from gvgbot.session import Tally

VERSION = 1
_BOOT = Path("/proc/sys/kernel/random/boot_id")


class Header(msgspec.Struct, frozen=True):
    """What a file is."""

    content: Literal["gvgbot journal", "gvgbot snapshot"]
    version: int


class Beat(msgspec.Struct, frozen=True, kw_only=True):
    """A moment of the robot's life."""

    stamp: float  # s, the robot's clock
    boot: str  # of the computer: its clock starts anew with each
    ahead: float  # s, the robot's clock minus the computer's
    tally: Tally
    odometer: FeedbackMemory | None  # what the base counted last, None before it was heard


class Rows(msgspec.Struct, frozen=True, kw_only=True):
    """A part of the journey, N rows."""

    stamps: Array  # (N,) s
    keyframes: list[int]  # the last one before each row
    odom_base: Array  # (N, 3)
    map_base: Array  # (N, 3)
    world_base: Array  # (N, 3), or (0, 3) where nobody knows it


class Batch(msgspec.Struct, frozen=True, kw_only=True):
    """What is new since the batch before."""

    first: int  # number of the first keyframe in it
    growth: list[Growth]
    rows: Rows
    beat: Beat


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """All that does not only grow."""

    memory: Memory
    beat: Beat
    known: str = ""  # path of the run whose map it began with


class Count(NamedTuple):
    """How much a journal holds up to the end of a batch."""

    keyframes: int
    rows: int


@dataclass(frozen=True, slots=True, eq=False)
class Saved:
    """A mission as it was found: `past` and `journey` as far as the journal can be read."""

    memory: Memory
    past: list[Growth]
    journey: Journey
    beat: Beat  # the newest
    counts: list[Count]  # after each batch
    is_current: bool  # nothing was lived through since that could not be kept
    known: str = ""  # path of the run whose map it began with


def boot_id() -> str:
    """Which start of the computer this is; empty where it does not say."""
    try:
        return _BOOT.read_text("ascii").strip()
    except OSError:
        return ""


def rows(journey: Journey, start: int, end: int | None = None) -> Rows:
    """The rows of a journey from one on, up to the one before `end`."""
    return Rows(
        stamps=np.array(journey.stamps[start:end], np.float64),
        keyframes=journey.keyframes[start:end].tolist(),
        odom_base=journey.odom_base.rows(start, end),
        map_base=journey.map_base.rows(start, end),
        world_base=journey.world_base.rows(start, end),
    )


def journey_of(batches: list[Rows], keyframes: int) -> Journey:
    """The journey that rows make, as far as there are so many keyframes to hang it on."""
    journey = Journey()
    for part in batches:
        n = next((i for i, k in enumerate(part.keyframes) if k >= keyframes), len(part.keyframes))
        journey.stamps.extend(part.stamps[:n].tolist())
        journey.keyframes.extend(part.keyframes[:n])
        journey.odom_base.extend(part.odom_base[:n])
        journey.map_base.extend(part.map_base[:n])
        journey.world_base.extend(part.world_base[:n])
    if len(journey.world_base) != len(journey.stamps):
        journey.world_base.cut(0)
    return journey
