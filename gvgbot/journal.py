"""What is worth a line in the log: changes of state, each once, and nothing per cycle."""

from dataclasses import dataclass

import structlog

from gvgbot.autonomy import events
from gvgbot.hal.guard import NEEDS_SOMEBODY
from gvgbot.hal.messages import EMPTY_BATTERY, LOW_BATTERY, Battery
from gvgbot.topics import State
from gvgbot.words import counted

PASSING_S = 1.0  # an obstacle that holds the robot for less is part of driving
LASTING_S = 10.0  # what is felt for so long is not got rid of by backing off
REMEDIES = {
    "bumper": "free the robot; if nothing touches it, its bumper is jammed: tap it",
    "cliff": "move the robot from the edge; if there is floor below it, clean its cliff sensors",
}
SAGGING_S = 10.0  # a voltage that is low for less may be that of a motor that starts
CHARGED = 0.35  # of a full charge: a battery with more is low no longer

log = structlog.get_logger()


def log_event(event: events.Event) -> None:
    """A line for what people want to know; the rest is in the list of events."""
    match event:
        case events.VertexAdded():
            log.info(
                "vertex added",
                vertex=event.vertex,
                kind=event.kind,
                x=round(event.x, 2),
                y=round(event.y, 2),
            )
        case events.LoopClosed():
            away = {} if event.away_m is None else {"away_m": round(event.away_m, 1)}
            log.info("loop closed", vertex=event.vertex, **away)
        case events.Recovery():
            log.info("recovery", action=event.action, reason=event.reason)
        case events.Finished():
            say = log.error if event.outcome == "failed" else log.info
            say("finished", outcome=event.outcome, reason=event.reason)
        case events.Requested():
            log.info(
                "requested",
                request=event.request,
                origin=event.origin,
                done=event.done,
                answer=event.answer,
            )
        case events.ErrandEnded():
            log.info(
                "errand ended", errand=event.errand, outcome=event.outcome, reason=event.reason
            )
        case events.RoundEnded():
            log.info("round ended", round=event.round, reached=event.reached, missed=event.missed)
        case _:
            pass


@dataclass(slots=True)
class GuardJournal:
    """Says when the guard holds the robot, and when it lets go again.

    `needs_somebody` while something is felt for so long that the robot does not get away by itself.
    """

    needs_somebody: bool = False
    _reason: str | None = None
    _since: float = 0.0  # stamp
    _said: str | None = None

    def note(self, reason: str | None, stamp: float) -> None:
        """Take note of what the guard did in the control cycle at a stamp, s."""
        if reason == "obstacle near":  # it slows the robot down, it does not hold it
            reason = None
        if reason != self._reason:
            self._reason, self._since = reason, stamp
        self._call_somebody(stamp)
        if reason == self._said or (
            reason in (None, "obstacle") and stamp - self._since < PASSING_S
        ):
            return
        if reason is None:
            log.info("guard released", was=self._said)
        else:
            log.warning("guard stopped", reason=reason)
        self._said = reason

    def _call_somebody(self, stamp: float) -> None:
        """Say once what to do about what is felt and does not go away."""
        remedy = REMEDIES.get(self._reason or "")
        before = self.needs_somebody
        self.needs_somebody = remedy is not None and stamp - self._since > LASTING_S
        if self.needs_somebody and not before:
            log.warning("robot is stuck", reason=self._reason, remedy=remedy)


@dataclass(slots=True)
class BatteryJournal:
    """Says once that the battery is low, and once that it is empty, until it is charged again."""

    calls_home: bool = False  # it was told of, and not charged since; whoever heeds it resets it
    _said: float = 1.0  # the charge below which it was said
    _since: float | None = None  # stamp; since when it is lower than what was said last

    def note(self, battery: Battery | None, stamp: float) -> None:
        """Take note of the state of the battery at a stamp, s."""
        if battery is None:
            return
        self.calls_home &= not battery.charging
        if battery.charging or battery.fraction > CHARGED:
            self._said = 1.0
        level = EMPTY_BATTERY if battery.fraction < EMPTY_BATTERY else LOW_BATTERY
        if battery.charging or not battery.fraction < level < self._said:
            self._since = None
            return
        self._since = stamp if self._since is None else self._since
        if stamp - self._since < SAGGING_S:
            return
        self._said, self.calls_home = level, True
        what = "battery empty" if level == EMPTY_BATTERY else "battery low"
        log.warning(what, volts=round(battery.voltage, 1), remedy="charge it")


def status_line(state: State, *, needs_somebody: bool = False) -> str:
    """The state in a few words, for the service manager."""
    if state.phase == "starting":
        return f"starting: {state.reason}" if state.reason else "starting"
    vertices = counted(state.vertices, "vertex", "vertices")
    graph = f"{vertices}, {counted(state.frontiers, 'frontier')}"
    what = state.outcome if state.phase == "finished" else state.errand or state.phase
    needs_somebody |= state.guard in NEEDS_SOMEBODY
    is_held = state.phase != "halted" and needs_somebody
    why = state.guard if is_held else state.reason
    return f"{what}: {why}; {graph}" if why else f"{what}: {graph}"
