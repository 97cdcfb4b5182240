"""Asks a laser for its time, in the mode in which it does nothing else, before the scans."""

import structlog

from gvgbot.drivers.hokuyo import clock_sync
from gvgbot.drivers.hokuyo.clock_sync import Synchronisation, TimeSample
from gvgbot.drivers.hokuyo.dialogue import Dialogue, Refusal, Silence
from gvgbot.drivers.hokuyo.opening import DENIED, quiet
from gvgbot.drivers.hokuyo.scip import decode_time
from gvgbot.drivers.hokuyo.scip_codec import DamagedError

SAMPLES = 12  # of the laser's clock
CONVERTER_BEAT = 0.016  # s; a serial converter's usual latency timer
GOLDEN = 0.618034  # its multiples spread evenly over a beat
ALREADY_ON = "02"  # what a laser says to TM0 when its reply to an earlier one was lost
LOST_STOPS = 3  # in a row; a stop that comes as a scan begins can be lost

log = structlog.get_logger()


async def synchronise(dialogue: Dialogue) -> Synchronisation | None:
    """How the clocks stand to each other; None if the laser, which is at rest, does not tell.

    Raises DeviceLost or DeviceRefused if it does not come to rest again.
    """
    samples: list[TimeSample] = []
    try:
        await _sample(dialogue, samples)
    except (Refusal, DamagedError) as error:
        log.info("laser does not tell its time", reason=str(error))
    except Silence as silence:
        log.info("laser does not tell its time", reason=str(silence))
        samples.clear()  # in the silence it may have rebooted, which resets its clock
    await _leave(dialogue)
    return clock_sync.synchronise(samples)


async def _sample(dialogue: Dialogue, samples: list[TimeSample]) -> None:
    """Raises Refusal, DamagedError or Silence; the samples until then count."""
    await _enter(dialogue)
    while len(samples) < SAMPLES:
        unanswered = dialogue.link.unanswered
        sample = await _time_sample(dialogue)
        if dialogue.link.unanswered > unanswered:
            return  # what answers now may answer an earlier question
        samples.append(sample)
        await _pause(dialogue, len(samples))


async def _enter(dialogue: Dialogue) -> None:
    """Raises Refusal if the laser cannot, Silence if it does not answer."""
    for _ in range(LOST_STOPS):
        try:
            await dialogue.ask("TM0")
        except Refusal as refusal:
            if refusal.status == ALREADY_ON:
                return
            if refusal.status != DENIED:  # as long as the laser measures
                raise
            await quiet(dialogue, patience=dialogue.patience)
        else:
            return
    raise Refusal("TM0", DENIED)


async def _leave(dialogue: Dialogue) -> None:
    """A laser that does not answer that has to come to rest. Raises DeviceLost if it cannot."""
    dialogue.send("TM2")
    if await dialogue.reply_to("TM2") is None:
        await quiet(dialogue, patience=dialogue.patience)


async def _time_sample(dialogue: Dialogue) -> TimeSample:
    """Raises Refusal, DamagedError or Silence."""
    sent = dialogue.clock.now()
    reply = await dialogue.ask("TM1")
    return TimeSample(sent, decode_time(reply), dialogue.answered)


async def _pause(dialogue: Dialogue, number: int) -> None:
    """Wait a while that is never the same: converters hand out bytes on a beat of their own."""
    clock = dialogue.clock
    await clock.sleep_until(clock.now() + CONVERTER_BEAT * (number * GOLDEN % 1.0))
