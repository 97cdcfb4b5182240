"""The device's end of a TCP connection, with plain sockets as its clients."""

import asyncio
import re
import socket

import pytest

from gvgbot.drivers.tcp import parse_address
from gvgbot.drivers.tcp_port import TcpPort
from gvgbot.errors import UsageError

ANY_PORT = "tcp://127.0.0.1:0"
ANY_PORT_6 = "tcp://[::1]:0"


def has_ipv6() -> bool:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


needs_ipv6 = pytest.mark.skipif(not has_ipv6(), reason="this machine has no IPv6")


class Client:
    """A program that has opened the port."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    @classmethod
    async def of(cls, port: TcpPort) -> "Client":
        assert port.path is not None
        return cls(*await asyncio.open_connection(*parse_address(port.path)))

    async def leave(self) -> None:
        self.writer.close()
        await self.writer.wait_closed()


async def until_served(port: TcpPort, client: Client) -> None:
    """The port has taken this client as its own."""
    client.writer.write(b"?")
    assert await port.read() == b"?"


@pytest.mark.parametrize("address", [ANY_PORT, pytest.param(ANY_PORT_6, marks=needs_ipv6)])
def test_clients_come_and_go(address: str) -> None:
    async def main() -> None:
        port = TcpPort(address)
        for word in (b"one", b"two"):
            client = await Client.of(port)
            client.writer.write(word)
            assert await port.read() == word
            port.write(word + b"!")
            assert await client.reader.readexactly(4) == word + b"!"
            await client.leave()
            await lonely(port)
        port.close()

    asyncio.run(main())


async def lonely(port: TcpPort) -> None:
    """The port has noticed that nobody is there: what it sends is dropped."""
    before = port.dropped
    while port.dropped == before:
        port.write(b".")
        await asyncio.sleep(0.001)


def test_a_second_client_is_hung_up_on_and_the_first_stays() -> None:
    async def main() -> None:
        port = TcpPort(ANY_PORT)
        first = await Client.of(port)
        await until_served(port, first)
        second = await Client.of(port)
        assert await second.reader.read() == b""
        await until_served(port, first)
        await second.leave()
        await first.leave()
        port.close()

    asyncio.run(main())


def test_unplugging_ends_the_connection_and_the_address_stays() -> None:
    async def main() -> None:
        port = TcpPort(ANY_PORT)
        address = port.path
        assert address is not None
        client = await Client.of(port)
        await until_served(port, client)
        port.plug(False)
        unplugged = port.path
        assert unplugged is None
        assert await client.reader.read() == b""
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection(*parse_address(address))
        port.plug(True)
        assert port.path == address
        again = await Client.of(port)
        await until_served(port, again)
        await again.leave()
        await client.leave()
        port.close()

    asyncio.run(main())


def test_who_does_not_read_loses_whole_messages_only() -> None:
    async def main() -> None:
        port = TcpPort(ANY_PORT)
        client = await Client.of(port)
        await until_served(port, client)
        size, count = 100_000, 0
        while not port.dropped:
            port.write(bytes([count % 256]) * size)
            count += 1
            await asyncio.sleep(0)
        for number in range(count - 1):
            assert await client.reader.readexactly(size) == bytes([number % 256]) * size
        port.write(b"next")
        assert await client.reader.readexactly(4) == b"next"
        await client.leave()
        port.close()

    asyncio.run(main())


@needs_ipv6
def test_an_address_of_ipv6_is_told_as_it_is_written() -> None:
    async def main() -> None:
        port = TcpPort(ANY_PORT_6)
        address = port.path
        assert address is not None
        assert re.fullmatch(r"tcp://\[::1\]:\d+", address)
        with pytest.raises(UsageError, match=f"{re.escape(address)}: [^()]*in use"):
            TcpPort(address)
        port.close()

    asyncio.run(main())


def test_an_address_that_cannot_be_had_is_told_to_the_user() -> None:
    async def main() -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            number = taken.getsockname()[1]
            with pytest.raises(UsageError, match=f":{number}: [^()]*in use: choose another"):
                TcpPort(f"tcp://127.0.0.1:{number}")
        with pytest.raises(UsageError, match="write tcp://host:10940"):
            TcpPort("tcp://nowhere")

    asyncio.run(main())
