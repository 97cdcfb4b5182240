"""Brings a laser to rest whatever state it is in: streaming, asleep, broken or at another rate."""

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import structlog

from gvgbot.drivers.hokuyo.dialogue import ASK_ATTEMPTS, Dialogue
from gvgbot.drivers.hokuyo.scip_messages import ACCEPTED
from gvgbot.errors import DeviceLost, DeviceRefused

BIT_RATES = (19200, 115200, 57600, 38400, 250000, 500000, 750000)  # bit/s, likely ones first
SCIP_1 = "E"  # what a laser that still speaks SCIP 1.1 answers
ABNORMAL = "0L"
DENIED = "10"  # in this state
UPDATING = "0I"  # waits for firmware; a reset ends it
MAX_REFUSALS = 3
REBOOT_TAKES = 1.0  # s from the second RB until the link drops
BETWEEN_REBOOTS = 0.3  # s at most: the second RB must follow within a second

log = structlog.get_logger()


@runtime_checkable
class Tunable(Protocol):
    """A stream whose bit rate can be set."""

    def set_baud(self, baud: int) -> None:
        """Send and receive at this rate (bit/s) from now on."""


async def quiet(dialogue: Dialogue, *, patience: float) -> None:
    """End whatever the laser was doing, and drop all that it had sent.

    `patience` (s) is how long a laser that says nothing may take to boot. Raises DeviceLost, or
    DeviceRefused if it does not come to rest.
    """
    until = dialogue.clock.now() + patience
    received, refusals = dialogue.received, 0
    while True:
        status = await _stopped(dialogue)
        if status == ACCEPTED:
            return
        if status is None and dialogue.clock.now() >= until:
            raise DeviceLost(_no_answer(is_silent=dialogue.received == received))
        if status is not None:
            refusals += 1
            if status == DENIED and refusals > MAX_REFUSALS:
                return  # there is nothing to stop, says newer firmware
            await _cure(dialogue, status, refusals)


def _no_answer(*, is_silent: bool) -> str:
    """What is the matter, and what to do about it."""
    if is_silent:
        return (
            "the laser does not answer: check its power and cable, and that laser.port is its port"
        )
    return (
        "what comes from laser.port is no laser's: check that it is not the base's port, and its "
        "cable"
    )


async def _stopped(dialogue: Dialogue) -> str | None:
    """The status of the answer to a stop; None without one."""
    dialogue.break_off()
    dialogue.send("TM2")
    dialogue.send("QT")
    reply = await dialogue.reply_to("QT")
    return None if reply is None else reply.status


async def _cure(dialogue: Dialogue, status: str, refusals: int) -> None:
    """Do what brings a laser that answers so nearer to rest. Raises DeviceRefused."""
    if refusals > MAX_REFUSALS:
        raise DeviceRefused(f"the laser answers QT with status {status}: switch it off and on")
    if status == SCIP_1:
        dialogue.send("SCIP2.0")
    elif status == UPDATING:
        dialogue.send("RS")
    elif status == ABNORMAL:
        await reboot(dialogue)


async def reboot(dialogue: Dialogue) -> None:
    """Restart the laser, and wait while it goes down. Raises DeviceLost if the link drops."""
    log.warning("laser reboots", reason="abnormal state")
    dialogue.link.reboots += 1
    for _ in range(2):
        dialogue.send("RB")
        await dialogue.reply_to("RB", BETWEEN_REBOOTS)
    await dialogue.clock.sleep_until(dialogue.clock.now() + REBOOT_TAKES)


async def tune(dialogue: Dialogue, wanted: int, *, patience: float) -> int:
    """Bring the laser to rest at whatever bit rate it listens to, and set it to the wanted one.

    Returns the rate (bit/s) at which both sides are then. A stream that cannot change its rate
    counts as being at the wanted one. What it was in the middle of says nothing of the link.
    Raises DeviceLost or DeviceRefused.
    """
    link = dialogue.link
    bad, unanswered = link.bad_messages, link.unanswered
    rate = await _tuned(dialogue, wanted, patience)
    link.bad_messages, link.unanswered = bad, unanswered
    return rate


async def _tuned(dialogue: Dialogue, wanted: int, patience: float) -> int:
    stream = dialogue.stream
    if not isinstance(stream, Tunable):
        await quiet(dialogue, patience=patience)
        return wanted
    found = await _search(dialogue, stream, wanted, patience)
    # On USB a rate means nothing: a laser that was silent for a while is found at any.
    if found == wanted or await _rests_at(dialogue, stream, wanted, 1):
        return wanted
    await _rests_at(dialogue, stream, found, ASK_ATTEMPTS)
    return await _set_rate(dialogue, stream, found, wanted)


async def _search(dialogue: Dialogue, stream: Tunable, wanted: int, patience: float) -> int:
    """The rate at which the laser is at rest now. Raises DeviceLost or DeviceRefused."""
    for baud, tries in _rates(wanted):
        if await _rests_at(dialogue, stream, baud, tries):
            return baud
    stream.set_baud(wanted)
    await quiet(dialogue, patience=patience)
    return wanted


def _rates(wanted: int) -> Iterator[tuple[int, int]]:
    yield wanted, ASK_ATTEMPTS
    yield from ((baud, 1) for baud in BIT_RATES if baud != wanted)


async def _rests_at(dialogue: Dialogue, stream: Tunable, baud: int, tries: int) -> bool:
    """Whether the laser comes to rest at this rate. Raises DeviceRefused."""
    if not _takes(stream, baud):
        return False
    try:
        await quiet(dialogue, patience=tries * dialogue.timeout - dialogue.timeout / 2)
    except DeviceLost:
        return False
    return True


def _takes(stream: Tunable, baud: int) -> bool:
    """Whether the port has this bit rate, which it then is set to."""
    try:
        stream.set_baud(baud)
    except DeviceLost:
        return False
    return True


async def _set_rate(dialogue: Dialogue, stream: Tunable, found: int, wanted: int) -> int:
    """Set both sides to the wanted rate if both know it. Returns the rate that holds then."""
    is_possible = _takes(stream, wanted)  # a laser at a rate that the port lacks is out of reach
    stream.set_baud(found)
    if not (is_possible and await _changes(dialogue, wanted)):
        log.warning("laser keeps its bit rate", baud=found, wanted=wanted)
        return found
    stream.set_baud(wanted)
    await quiet(dialogue, patience=dialogue.patience)  # it changes after its reply
    log.info("laser changed its bit rate", before=found, baud=wanted)
    return wanted


async def _changes(dialogue: Dialogue, baud: int) -> bool:
    """Whether the laser agrees to change its bit rate."""
    command = f"SS{baud:06}"
    dialogue.send(command)
    reply = await dialogue.reply_to(command)
    return reply is not None and reply.status == ACCEPTED
