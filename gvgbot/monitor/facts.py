"""A robot in words: what the lines of the monitor say of a state, of events and of its presence."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from gvgbot.client import Event, Health, LinkHealth, Plan, Presence, State
from gvgbot.topics import STUCK_AFTER
from gvgbot.words import counted, shortened

Tone = Literal["plain", "good", "warning", "bad", "faint"]

_LOW_BATTERY = 0.28  # of a full charge, from where on the robot itself warns
_GAUGE = 8  # characters
_MATE = 30  # characters that another robot and its place take
_QUIET = {"edge_joined"}  # too many of them, and they say little
_TONES: Mapping[str, Tone] = {
    "recovery": "warning",
    "closure_revoked": "warning",
    "loop_closed": "good",
}
_PHASES: Mapping[str, Tone] = {
    "starting": "warning",
    "exploring": "good",
    "errand": "good",
    "waiting": "good",
    "paused": "warning",
    "halted": "bad",
    "finished": "good",
}


@dataclass(frozen=True, slots=True)
class Fact:
    """A line: what it is about, what there is to say, and in which tone."""

    name: str
    text: str
    tone: Tone = "plain"


def facts(state: State, plan: Plan | None, health: Health | None) -> Iterator[Fact]:
    """What there is to know of a robot; the most telling first, for a terminal may be small."""
    yield Fact("phase", state.phase, _tone_of_phase(state))
    if state.outcome is not None:
        yield Fact("outcome", state.outcome.replace("_", " "), _tone_of_phase(state))
    yield from _intention(state, plan)
    yield Fact("frontiers", _frontiers(state))
    yield Fact("battery", *_battery(state))
    yield Fact("guard", *((state.guard, "warning") if state.guard else ("free", "plain")))
    yield from _place(state)
    for mate in state.team:
        place = f"{mate.pose[0]:z.2f} {mate.pose[1]:z.2f} m"
        yield Fact(shortened(mate.name, _MATE - len(place)), place)
    yield Fact("driven", f"{state.distance:.1f} m")
    yield Fact("laser", *_link(state.laser))
    yield Fact("base", *_link(state.base))
    yield Fact("control", *_control(state, health))
    yield Fact("program", *_program(health))
    yield Fact("contacts", *_contacts(state))
    yield Fact("speed", f"{state.twist[0]:z.2f} m/s  {math.degrees(state.twist[1]):+z.0f}°/s")
    yield Fact("vertices", f"{state.vertices}, {counted(state.edges, 'edge')}")


def _tone_of_phase(state: State) -> Tone:
    if state.outcome not in (None, "explored") or _is_searching(state):
        return "warning"
    return _PHASES[state.phase]


def _is_searching(state: State) -> bool:
    """Whether it looks for its place on the map, and says why."""
    return state.is_lost and state.phase in ("exploring", "errand") and state.reason != ""


def _has_reason(state: State) -> bool:
    return _is_searching(state) or (
        state.phase in ("starting", "halted", "finished") and state.reason != ""
    )


def _intention(state: State, plan: Plan | None) -> Iterator[Fact]:
    """Where the robot goes, and why."""
    if state.errand is not None and not _is_searching(state):
        yield Fact("going to", state.errand)
        yield Fact("why", "somebody asked for it")
    elif _has_reason(state):
        yield Fact("why", state.reason)
    elif plan is not None and plan.vertex is not None and plan.bearing is not None:
        yield Fact("going to", f"vertex {plan.vertex}, {_degrees(plan.bearing)}")
        yield Fact("why", plan.reason or "-")
    elif plan is not None and plan.track and state.vertices == 0:
        yield Fact("going to", "end of its first edge")
        yield Fact("why", "no vertex is known")
    else:
        yield Fact("going to", "-", "faint")
        yield Fact("why", "-", "faint")


def _place(state: State) -> Iterator[Fact]:
    """Where the robot is, and how sure it is of that."""
    if state.is_lost:
        yield Fact("pose", "not known", "warning")
        return
    x, y, theta = state.pose
    yield Fact("pose", f"{x:z.2f} {y:z.2f} m  {_degrees(theta)}")
    yield Fact("sigma", _sigma(state))


def _frontiers(state: State) -> str:
    """How many are left; none is of a team that has explored all, whatever its maps lack."""
    is_done = state.outcome == "explored" and state.team and state.frontiers > 0
    return f"{state.frontiers} {'followed by others' if is_done else 'left'}"


def _towards(decision: Event) -> str:
    bearing = decision.details.get("bearing")
    return f", {_degrees(bearing)}" if isinstance(bearing, float) else ""


def _degrees(angle: float) -> str:
    """Whole degrees of an angle, rad; never -0."""
    return f"{round(math.degrees(angle))}°"


def _sigma(state: State) -> str:
    """The standard deviations of the pose: the larger one of the position, and of the heading."""
    heading = math.sqrt(max(0.0, state.covariance[-1]))
    return f"{100 * state.position_sigma:.1f} cm  {math.degrees(heading):.1f}°"


def _contacts(state: State) -> tuple[str, Tone]:
    slips = f", {counted(state.slips, 'slip')}" if state.slips else ""
    return f"{state.contacts}{slips}", "warning" if state.contacts or state.slips else "plain"


def _battery(state: State) -> tuple[str, Tone]:
    if state.battery_fraction is None or state.battery_voltage is None:
        return "unknown", "faint"
    full = round(_GAUGE * min(1.0, max(0.0, state.battery_fraction)))
    gauge = "█" * full + "░" * (_GAUGE - full)
    tone: Tone = "bad" if state.battery_fraction < _LOW_BATTERY else "good"
    return f"{gauge} {state.battery_fraction:.0%} {state.battery_voltage:.1f} V", tone


def _link(link: LinkHealth) -> tuple[str, Tone]:
    if not link.connected:
        return "away" if link.messages else "not there", "bad"
    troubles = {
        f"{link.lost} lost": link.lost,
        f"{link.damaged} damaged": link.damaged,
        counted(link.reconnects, "reconnect"): link.reconnects,
    }
    said = ", ".join(words for words, count in troubles.items() if count)
    return (said, "plain") if said else ("fine", "good")


def _control(state: State, health: Health | None) -> tuple[str, Tone]:
    """Whether the control loop turns, and how often it was late."""
    if state.cycle_age is None:
        return "not begun", "faint"
    if state.cycle_age > STUCK_AFTER:
        return f"no cycle for {state.cycle_age:.0f} s", "bad"
    if health is not None and health.late_cycles:
        return f"running, {health.late_cycles} late", "plain"
    return "running", "good"


def _program(health: Health | None) -> tuple[str, Tone]:
    """What the robot's program costs."""
    if health is None:
        return "-", "faint"
    unsent = f"  {health.unsent} unsent" if health.unsent else ""
    return f"{health.cpu:.0%} cpu  {health.memory / 1e6:.0f} MB{unsent}", "plain"


def told(event: Event, now: float) -> Fact | None:
    """An event as a line at a stamp, s; None for those that only fill the list."""
    if event.kind in _QUIET:
        return None
    return Fact(f"{_age(now - event.stamp):>8}", _words(event), _tone_of(event))


def _tone_of(event: Event) -> Tone:
    if event.kind == "finished":
        return "good" if event.details.get("outcome") == "explored" else "warning"
    return _TONES.get(event.kind, "plain")


def _words(event: Event) -> str:
    get = event.details.get
    match event.kind:
        case "decision":
            return f"go to vertex {get('vertex')}{_towards(event)}: {get('reason')}"
        case "vertex_added":
            return f"found {get('kind')} {get('vertex')} of degree {get('degree')}"
        case "vertex_removed":
            return f"vertex {get('vertex')} is none: {get('reason')}"
        case "vertex_moved":
            return f"vertex {get('vertex')} proves to stand elsewhere"
        case "loop_closed":
            away = get("away_m")
            far = f" after {away:.0f} m" if isinstance(away, float) else ""
            return f"loop closed at vertex {get('vertex')}{far}"
        case "place_doubted":
            return f"vertex {get('vertex')} may be {get('known')}: the next ones tell"
        case "doubt_settled":
            known = get("known")
            return f"vertex {get('vertex')} is {'a new one' if known is None else known}"
        case "closure_revoked":
            return f"closure at vertex {get('vertex')} taken back"
        case "recovery":
            return f"{get('action')}: {get('reason')}"
        case "finished":
            return f"{str(get('outcome')).replace('_', ' ')}: {get('reason')}"
        case "requested":
            refused = "" if get("done") else " refused"
            return f"{get('request')}{refused}: {get('answer')} ({get('origin')})"
        case "errand_ended":
            why = f", {get('reason')}" if get("reason") else ""
            return f"{get('errand')} {get('outcome')}{why}"
        case "round_ended":
            return f"round {get('round')}: {get('reached')} reached, {get('missed')} missed"
        case _:
            said = ", ".join(f"{name} {value}" for name, value in event.details.items())
            return f"{event.kind.replace('_', ' ')}: {said}"


def headline(robot: str, presence: Presence, state: State | None, others: list[str]) -> Fact:
    """The one thing to know first."""
    match presence.word:
        case "absent":
            there = f"there is {', '.join(others)}" if others else "there is none"
            return Fact(robot, f"no robot named {robot} here; {there}", "bad")
        case "gone":
            return Fact(robot, f"robot gone for {duration(presence.for_s)}", "bad")
        case "cut off":
            if state is None:
                return Fact(robot, "connecting to the robot", "faint")
            return Fact(
                robot, f"connection lost for {duration(presence.for_s)}, trying again", "bad"
            )
        case "quiet":
            return Fact(robot, f"quiet for {duration(presence.for_s)}: its program hangs", "bad")
        case "doubled":
            return Fact(
                robot, f"several robots are named {robot}: give one another robot.name", "bad"
            )
        case "alive":
            return _alive(robot, state)


def _alive(robot: str, state: State | None) -> Fact:
    if state is None:
        return Fact(robot, "has not said anything yet", "warning")
    if state.cycle_age is not None and state.cycle_age > STUCK_AFTER and state.base.connected:
        return Fact(robot, "its control loop is stuck", "bad")
    return Fact(robot, _doing(state), _tone_of_phase(state))


def _doing(state: State) -> str:
    """What it does, or why it does nothing."""
    if _has_reason(state):
        return state.reason
    if state.phase == "errand" and state.errand is not None:
        return state.errand
    return state.phase


def _age(seconds: float) -> str:
    """A time span as short as a column is: 12 s, 3 min, 2 h."""
    whole = int(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min" if whole < 3600 else f"{whole // 3600} h"


def duration(seconds: float) -> str:
    """A time span in the words of people: 12 s, 3 min 5 s, 2 h 7 min."""
    whole = int(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
