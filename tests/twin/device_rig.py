"""What all rigs share: a twin behind a bad link on a cable, and a script played while they work."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Protocol, TypeVar

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.cable import Cable
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.transport import ByteStream, TwinDevice, serve_twin

ENDS_OF_LINK = {"silence", "unplug"}
Work = list[Coroutine[Any, Any, None]]


class Wire:
    """A device behind a bad link, on a cable that the link's faults can pull."""

    def __init__(self, device: TwinDevice, faults: LinkFaultConfig, seed: int) -> None:
        self.cable = Cable()
        self.link = FaultyLink(device, faults, seed, self.cable.plug)

    def opened(self) -> ByteStream:
        """The host's end as a port is when it is opened: it kept nothing while nobody listened."""
        if not self.link.is_on("unplug"):
            self.cable.plug(False)
            self.cable.plug(True)
        return self.cable.host

    async def serve(self, clock: LoopClock) -> None:
        await serve_twin(self.link, self.cable.device, clock)


class Rig(Protocol):
    """Something that works in the background for as long as a script wants it."""

    def work(self) -> Work: ...


R = TypeVar("R", bound=Rig)


def play(make: Callable[[], R], script: Callable[[R], Awaitable[None]]) -> R:
    """Run the script while the rig is at work, in virtual time, and leave no task behind."""

    async def main() -> R:
        rig = make()
        async with asyncio.TaskGroup() as tasks:
            work = [tasks.create_task(each) for each in rig.work()]
            await script(rig)
            for task in work:
                task.cancel()
        assert asyncio.all_tasks() == {asyncio.current_task()}
        return rig

    rig: R = run_in_virtual_time(main())
    return rig
