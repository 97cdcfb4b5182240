"""Robots of a team hear each other over the network, and a robot alone goes on."""

import asyncio

import pytest

from gvgbot.telemetry import Telemetry
from gvgbot.topics import TelemetryConfig
from tests.process.addresses import free_endpoint


@pytest.mark.slow
def test_what_one_robot_tells_its_team_is_heard_by_the_other() -> None:
    async def exchanged() -> bytes:
        heard = asyncio.Queue[bytes]()
        endpoint = free_endpoint()
        near = TelemetryConfig(listen=(endpoint,))
        far = TelemetryConfig(listen=(free_endpoint(),), connect=(endpoint,))
        with Telemetry(near, "one") as one, Telemetry(far, "two") as two:
            async with asyncio.timeout(15), asyncio.TaskGroup() as tasks:
                listening = tasks.create_task(two.hear_team(heard.put_nowait))
                while heard.empty():  # until they have found each other
                    one.tell_team("team", b"\x00 what one has seen \xff")
                    await asyncio.sleep(0.05)
                listening.cancel()
        return heard.get_nowait()

    assert asyncio.run(exchanged()) == b"\x00 what one has seen \xff"
