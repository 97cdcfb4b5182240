"""Whatever is asked for, in whatever order: nothing fails, and the guard has the last word."""

import json
import math
import re
import tempfile
from pathlib import Path

import msgspec
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from benchmarks.rigs.run_rig import STOP, Daemon, base_commands
from gvgbot.clock import Clock
from gvgbot.geometry import Pose
from gvgbot.requests import JSON, MESSAGEPACK, REQUESTS, Answer, Asked
from gvgbot.steering import SETTABLE

pytestmark = [pytest.mark.twin, pytest.mark.slow]

RUNS, REQUESTS_A_RUN = 2, 200  # ten a second
BRAKING_S = 2.0
STILL_M = 0.005
DRIVING = ("resume", "home", "goto", "patrol", "coverage", "explore", "relocalise")
LIFTED_AT, NO_LASER_AT = 60, 120  # requests before somebody lifts the robot, or pulls a cable
LASTS_S, REACTION_S = 2.5, 1.0
LEFT_OUT = re.compile(r" \((\d+) requests? before this one w(?:as|ere) not written down\)")

numbers = st.one_of(st.integers(-3, 12), st.floats(-20.0, 20.0), st.just(math.inf))
fitting = st.one_of(
    st.tuples(st.sampled_from([r for r in REQUESTS if r not in ("goto", "set")]), st.just({})),
    st.tuples(st.just("goto"), st.fixed_dictionaries({"vertex": st.integers(-1, 8)})),
    st.tuples(
        st.just("patrol"),
        st.fixed_dictionaries({"vertices": st.lists(st.integers(-1, 8), max_size=5)}),
    ),
    st.tuples(st.just("goto"), st.fixed_dictionaries({"x": numbers, "y": numbers})),
    st.tuples(
        st.just("set"),
        st.fixed_dictionaries(
            {
                "key": st.sampled_from([*SETTABLE, "robot.radius_m", "twin", ""]),
                "value": st.one_of(numbers, st.booleans(), st.sampled_from(["ears", "fast"])),
            }
        ),
    ),
).map(lambda pair: Asked(pair[0], msgspec.msgpack.encode(pair[1]), MESSAGEPACK, "fitting"))
wrong = st.builds(
    Asked,
    st.one_of(st.sampled_from(REQUESTS), st.text(max_size=10)),
    st.binary(max_size=40),
    st.sampled_from([MESSAGEPACK, JSON, ""]),
    st.just("wrong"),
)
requests = st.lists(
    st.one_of(fitting, fitting, fitting, wrong), min_size=REQUESTS_A_RUN, max_size=REQUESTS_A_RUN
)


class Dangers:
    """Lifts the robot for a while, and later pulls the laser's cable: nothing may move it then."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._since = -math.inf
        self._written = 0  # bytes to the base, before the last check

    def come(self, count: int, now: float) -> None:
        """Let what is due after so many requests happen."""
        if count not in (LIFTED_AT, NO_LASER_AT):
            return
        self._since, simulation = now, self._daemon.session.simulation
        assert simulation is not None
        if count == LIFTED_AT:
            simulation.base_twin._device.inject("wheel drop", LASTS_S)  # type: ignore[attr-defined]
        else:
            simulation.laser_twin.inject("unplug", LASTS_S)

    def check(self, asked: Asked, answer: Answer, now: float) -> None:
        written = bytes(self._daemon.cable.written[self._written :])
        self._written += len(written)
        if REACTION_S < now - self._since < LASTS_S:
            assert self._daemon.robot.contact is not None
            assert self._daemon.robot.contact.wheel_drop or self._daemon.robot.away is not None
            assert set(base_commands(written)) == {STOP}
            assert not (answer.done and asked.name in DRIVING)


def assert_written_down(told: list[dict[str, object]], answers: list[Answer]) -> None:
    """All in their order, but for refusals and repetitions that are left out and counted."""
    at = 0
    for line in told:
        left_out = LEFT_OUT.search(str(line["answer"]))
        at += 0 if left_out is None else int(left_out[1])
        text = LEFT_OUT.sub("", str(line["answer"]))
        assert (answers[at].done, answers[at].text) == (line["done"], text)
        at += 1
    assert at <= len(answers)
    assert not any(
        answer.done for answer in answers[at:] if answer.text not in answers[at - 1].text
    )


@given(requests=requests)
@settings(
    max_examples=RUNS,
    deadline=None,
    phases=[Phase.explicit, Phase.generate],  # a failure is rare, and shrinking would take hours
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
def test_hundreds_of_random_requests_do_no_harm(requests: list[Asked]) -> None:
    with tempfile.TemporaryDirectory() as out:
        daemon, answers = Daemon(Path(out)), list[Answer]()
        met = Dangers(daemon)
        limit_mm = 1000 * daemon.config.robot.limits.max_speed_mps

        async def story(clock: Clock) -> None:
            errands = daemon.session.pipeline.errands
            paused_at: float | None = None
            stood: Pose | None = None
            await clock.sleep_until(3.0)
            for asked in requests:
                met.come(len(answers), clock.now())
                answers.append(await daemon.network._handle(asked))
                met.check(asked, answers[-1], clock.now())
                if not errands.is_paused:
                    paused_at = stood = None
                elif paused_at is None:
                    paused_at = clock.now()
                elif clock.now() > paused_at + BRAKING_S:
                    stood = stood or daemon.place
                    assert stood.distance(daemon.place) < STILL_M
                await clock.sleep_until(clock.now() + 0.1)

        with daemon.session.directory:
            daemon.run(story)
        assert len(answers) == REQUESTS_A_RUN
        assert all(answer.text for answer in answers)
        lines = (Path(out) / "events.jsonl").read_text().split("\n")
        told = [json.loads(line) for line in lines if '"requested"' in line]
        assert_written_down(told, answers)
        assert daemon.session.simulation is not None
        assert daemon.session.simulation.body.contacts == 0
        commands = base_commands(bytes(daemon.cable.written))
        assert max(abs(speed) for speed, _ in commands) <= limit_mm
        assert commands[-1] == STOP
