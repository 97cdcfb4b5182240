"""What the base shows to people beside it, as its own protocol says it."""

import struct
from pathlib import Path

import pytest

from benchmarks.rigs.run_rig import Daemon
from gvgbot.clock import Clock
from gvgbot.config import load_config
from gvgbot.drivers.kobuki.driver import KobukiBase, KobukiConfig
from gvgbot.hal.messages import Sign
from tests.twin.kobuki_rig import Robot, play

pytestmark = pytest.mark.twin

RED1, GREEN1, RED2, GREEN2 = 0x100, 0x200, 0x400, 0x800  # bits of the output word
POWER = 0xF0
LAMPS = {
    "off": 0,
    "starting": RED1 | GREEN1 | RED2 | GREEN2,
    "busy": GREEN1,
    "searching": GREEN1 | RED2 | GREEN2,
    "standing": RED1 | GREEN1,
    "finished": GREEN1 | GREEN2,
    "trouble": RED1,
}
ERROR, CLEANING_END = 4, 6  # numbers of tunes


def said(data: bytes | bytearray, wanted: int) -> list[bytes]:
    """The sub-payloads of a kind in a stream of whole frames, without number and length."""
    found: list[bytes] = []
    while data:
        body, data = data[3 : 3 + data[2]], data[4 + data[2] :]
        while body:
            if body[0] == wanted:
                found.append(bytes(body[2 : 2 + body[1]]))
            body = body[2 + body[1] :]
    return found


@pytest.mark.parametrize("sign", LAMPS)
def test_each_sign_has_its_lamps_and_leaves_the_power_on(sign: Sign) -> None:
    words: list[int] = []

    async def script(robot: Robot) -> None:
        await robot.clock.sleep_until(1.0)
        robot.base.show("off" if sign == "busy" else "busy")
        robot.base.show(sign)
        await robot.clock.sleep_until(1.5)
        words.append(robot.twin.output)

    play(script)
    assert words == [POWER | LAMPS[sign]]


def test_a_sign_is_sent_once_and_again_to_a_base_that_comes_back() -> None:
    async def script(robot: Robot) -> None:
        for tenth in range(100):
            robot.base.show("trouble")
            if tenth == 50:
                robot.inject("unplug", 1.0)
            await robot.clock.sleep_until(robot.clock.now() + 0.1)

    robot = play(script)
    assert robot.openings > 1
    assert [sound.sequence for sound in robot.twin.played] == [ERROR] * 2  # type: ignore[union-attr]


class Wire:
    """A stream that remembers what is written, on which the base has been heard."""

    def __init__(self) -> None:
        self.written = bytearray()

    async def read(self) -> bytes:
        raise AssertionError("nobody reads")

    def write(self, data: bytes) -> None:
        self.written += data

    def close(self) -> None:
        pass


def test_a_muted_base_shows_its_lamps_alone() -> None:
    class Now:
        def now(self) -> float:
            return 0.0

        async def sleep_until(self, stamp: float) -> None:
            raise AssertionError("nobody sleeps")

    for sounds in (True, False):
        wire = Wire()
        base = KobukiBase(wire, KobukiConfig(sounds=sounds), Now())
        base._feedback.heard = 0.0
        base.show("finished")
        assert said(wire.written, 12) == [struct.pack("<H", POWER | GREEN1 | GREEN2)]
        assert said(wire.written, 4) == ([bytes([CLEANING_END])] if sounds else [])
    assert load_config().base.sounds


def test_a_robot_shows_that_it_starts_and_drives_and_nothing_when_it_has_ended(
    tmp_path: Path,
) -> None:
    daemon = Daemon(tmp_path)

    async def story(clock: Clock) -> None:
        await clock.sleep_until(6.0)
        assert (await daemon.network.ask("pause")).done
        await clock.sleep_until(7.0)

    with daemon.session.directory:
        daemon.run(story)
    words = [struct.unpack("<H", word)[0] for word in said(daemon.cable.written, 12)]
    signs = ("starting", "busy", "standing", "off")
    assert words == [POWER | LAMPS[sign] for sign in signs]
