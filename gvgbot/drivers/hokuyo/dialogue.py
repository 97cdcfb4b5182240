"""Commands to a laser and the replies to them, over a byte stream."""

import asyncio
import contextlib

from gvgbot.clock import Clock
from gvgbot.drivers.hokuyo.scip import ScipParser, encode_command
from gvgbot.drivers.hokuyo.scip_messages import ACCEPTED, BadReply, Message, Reply
from gvgbot.drivers.hokuyo.statistics import LinkStatistics
from gvgbot.drivers.transport import ByteStream
from gvgbot.errors import DeviceLost, DeviceRefused

ASK_ATTEMPTS = 3  # the first seconds after power-on garble replies
Arrival = tuple[Message, float]
"""A message, and when its first byte arrived (s)."""


class Refusal(DeviceRefused):
    """The laser answered with a status that is no success."""

    def __init__(self, command: str, status: str) -> None:
        super().__init__(f"the laser answers {command} with status {status}")
        self.status = status


class Silence(DeviceLost):
    """The laser did not answer a command; the link itself may well be alive."""

    def __init__(self, command: str, within: float) -> None:
        """`within` so long each time it was asked (s)."""
        remedy = "check its cable, or raise laser.reply_timeout_s if it is that slow"
        super().__init__(f"the laser does not answer {command} within {within:g} s: {remedy}")


class Dialogue:
    """Sends commands and hears messages. Raises DeviceLost whenever the link is gone."""

    def __init__(
        self, stream: ByteStream, clock: Clock, reply_timeout: float, link: LinkStatistics
    ) -> None:
        """`reply_timeout` in s; `link` counts on."""
        self.link = link
        self.clock = clock
        self.stream = stream
        self.timeout = reply_timeout
        self.patience = ASK_ATTEMPTS * reply_timeout
        self.received = 0  # bytes, of a laser or of whatever is there
        self.answered = 0.0  # when the first byte of the last reply arrived, s
        self._parser = ScipParser()
        self._began = 0.0

    def send(self, command: str) -> None:
        """Send a command in one write."""
        self.stream.write(encode_command(command))

    def break_off(self) -> None:
        """Complete, and so discard, a command that an earlier program had cut in half."""
        self.stream.write(b"\n")

    async def ask(self, command: str) -> Reply:
        """The reply to a command. Raises Refusal, or Silence when none comes."""
        for _ in range(ASK_ATTEMPTS):
            self.send(command)
            reply = await self.reply_to(command)
            if reply is None:
                self._parser = ScipParser()  # the rest of a reply that was cut will not come
                continue
            if reply.status != ACCEPTED:
                raise Refusal(command, reply.status)
            return reply
        raise Silence(command, self.timeout)

    async def reply_to(self, command: str, within: float | None = None) -> Reply | None:
        """The next reply that echoes the command; None when none comes `within` s."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self.timeout if within is None else within):
                while True:
                    for message, arrival in await self.receive():
                        if isinstance(message, Reply) and message.echo == command:
                            self.answered = arrival
                            return message
        self.link.unanswered += 1
        return None

    async def receive(self) -> list[Arrival]:
        """The messages that the next bytes complete; there may be none."""
        continues = self._parser.pending > 0
        data = await self.stream.read()
        self.received += len(data)
        now = self.clock.now()
        first_began = self._began if continues else now
        messages = self._parser.feed(data)
        self._began = now if messages else first_began
        self.link.bad_messages += sum(isinstance(message, BadReply) for message in messages)
        return [(message, now if i else first_began) for i, message in enumerate(messages)]
