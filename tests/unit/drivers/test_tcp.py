"""Addresses of devices on Ethernet, good and bad."""

import asyncio
import contextlib
import socket
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.tcp import (
    CONNECT_TIMEOUT,
    SCHEME,
    TcpStream,
    open_tcp,
    parse_address,
    written_address,
)
from gvgbot.drivers.tcp_port import TcpPort
from gvgbot.errors import DeviceLost
from gvgbot.links import Links

NOWHERE = "tcp://192.0.2.1:10940"  # RFC 5737: an address that is nobody's


@pytest.mark.parametrize(
    ("port", "host", "number"),
    [
        ("tcp://192.168.0.10:10940", "192.168.0.10", 10940),
        ("tcp://laser.local:80", "laser.local", 80),
        ("tcp://laser.local.:65535", "laser.local.", 65535),
        ("tcp://[fe80::1]:10940", "fe80::1", 10940),
    ],
)
def test_an_address_names_host_and_number(port: str, host: str, number: int) -> None:
    assert parse_address(port) == (host, number)
    assert written_address(host, number) == port


@pytest.mark.parametrize(
    "port",
    [
        "tcp://",
        "tcp://host",
        "tcp://host:",
        "/dev/x",
        "tcp://:1",
        "tcp://192.168.0..10:10940",
        f"tcp://{'a' * 70}:10940",
        "tcp://host:65536",
        f"tcp://host:{'9' * 5000}",
    ],
)
def test_what_is_no_address_says_how_one_looks(port: str) -> None:
    with pytest.raises(DeviceLost, match="10940"):
        parse_address(port)


def test_a_host_that_nobody_knows_is_said_to_be_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)

    async def main() -> None:
        with pytest.raises(
            DeviceLost, match="tcp://lasr:10940 is not found: Name or service not known"
        ):
            await TcpStream("tcp://lasr:10940").read()

    asyncio.run(main())


async def hang(*_: object) -> None:
    """Connect to what says nothing at all."""
    await asyncio.get_running_loop().create_future()


async def impatient_read(stream: TcpStream, patience: float = 0.0) -> bytes:
    """What a reader gets who waits no longer than that (s)."""
    async with asyncio.timeout(patience):
        return await stream.read()


async def insistent_read(stream: TcpStream, patience: float) -> bytes:
    """What a reader gets who comes back for as long as it takes."""
    while True:
        with contextlib.suppress(TimeoutError):
            return await impatient_read(stream, patience)


def test_a_slow_connection_is_made_though_every_reader_is_impatient() -> None:
    async def main() -> None:
        loop, is_through, attempts = asyncio.get_running_loop(), asyncio.Event(), []
        connect = loop.sock_connect

        async def slow(sock: socket.socket, address: tuple[str, int]) -> None:
            attempts.append(address)
            await is_through.wait()
            await connect(sock, address)

        loop.sock_connect = slow  # type: ignore[assignment, method-assign]  # in its place
        port = TcpPort("tcp://127.0.0.1:0")
        assert port.path is not None
        stream = TcpStream(port.path)
        stream.write(b"hello")
        for _ in range(3):
            with pytest.raises(TimeoutError):
                await impatient_read(stream)
        is_through.set()
        assert await port.read() == b"hello"
        port.write(b"hi")
        assert await stream.read() == b"hi"
        assert len(attempts) == 1
        stream.close()
        port.close()

    asyncio.run(main())


@pytest.mark.parametrize("patience", [0.1, 0.4, 10.0])
def test_silence_is_told_after_the_time_for_connecting_whoever_waits(patience: float) -> None:
    async def main() -> float:
        loop = asyncio.get_running_loop()
        loop.sock_connect = hang  # type: ignore[assignment, method-assign]  # in its place
        stream = TcpStream(NOWHERE)
        with pytest.raises(DeviceLost, match=f"{NOWHERE} does not answer: check address, cable"):
            await insistent_read(stream, patience)
        return loop.time()

    assert run_in_virtual_time(main()) == pytest.approx(CONNECT_TIMEOUT)


@pytest.mark.parametrize("device", ["laser", "base"])
def test_a_device_that_is_not_on_the_network_is_told_with_its_key(device: str) -> None:
    config = load_config(None, ["twin.enabled=false", f"{device}.port={NOWHERE}"])

    async def main() -> None:
        asyncio.get_running_loop().sock_connect = hang  # type: ignore[assignment, method-assign]
        links = Links(config, LoopClock(), None)
        with pytest.raises(DeviceLost, match=f"does not answer: .*, or set {device}.port"):
            await {"laser": links.open_laser, "base": links.open_base}[device]()

    run_in_virtual_time(main())


def test_closing_ends_the_connecting_and_tells_who_waits_for_it() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        loop.sock_connect = hang  # type: ignore[assignment, method-assign]  # in its place
        stream = TcpStream(NOWHERE)
        loop.call_later(1.0, stream.close)
        with pytest.raises(DeviceLost, match="closed"):
            await stream.read()
        assert loop.time() == 1.0
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_in_virtual_time(main())


def test_who_no_longer_waits_for_an_open_connection_leaves_nothing_behind() -> None:
    async def main() -> None:
        asyncio.get_running_loop().sock_connect = hang  # type: ignore[assignment, method-assign]
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(1.0):
                await open_tcp(NOWHERE)
        await asyncio.sleep(0)
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_in_virtual_time(main())


def a_name_has(hosts: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every name be that of hosts with these addresses."""
    kind = socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP, ""

    def all_of_them(*_: object, **__: object) -> list[object]:
        return [(*kind, (host, 0)) for host in hosts]

    monkeypatch.setattr(socket, "getaddrinfo", all_of_them)


def test_a_name_whose_addresses_all_refuse_is_said_to_refuse(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    a_name_has(("127.0.0.1", "127.0.0.2"), monkeypatch)

    async def main() -> None:
        with socket.socket() as deaf:  # bound, so that nobody else can listen there
            deaf.bind(("0.0.0.0", 0))
            number = deaf.getsockname()[1]
            with pytest.raises(DeviceLost, match="refuses the connection: check address"):
                await TcpStream(f"{SCHEME}laser.local:{number}").read()

    asyncio.run(main())


def test_of_several_addresses_of_a_name_the_one_that_answers_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    a_name_has(("127.0.0.2", "127.0.0.1"), monkeypatch)

    async def main() -> None:
        port = TcpPort("tcp://127.0.0.1:0")
        assert port.path is not None
        number = parse_address(port.path)[1]
        stream = await open_tcp(f"{SCHEME}laser.local:{number}")
        stream.write(b"hello")
        assert await port.read() == b"hello"
        stream.close()
        port.close()

    asyncio.run(main())


def test_a_silent_name_server_holds_up_nothing_but_its_device(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Threads of the event loop are there for others, and its end waits for none."""
    answers = threading.Event()

    def silent(*_: object, **__: object) -> None:
        answers.wait(30.0)
        raise socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution")

    monkeypatch.setattr(socket, "getaddrinfo", silent)

    async def main() -> None:
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
        stream = TcpStream(f"{SCHEME}laser.local:10940")
        with pytest.raises(TimeoutError):
            await impatient_read(stream, 0.1)
        async with asyncio.timeout(20.0):
            await asyncio.to_thread(str)
        stream.close()

    asyncio.run(main())
    assert not answers.is_set()
    answers.set()
