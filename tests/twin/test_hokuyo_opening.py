"""The driver opens a simulated laser whatever state it finds it in."""

import asyncio
import math
from typing import Any

import pytest
import structlog

from benchmarks.rigs.hokuyo_bench import PERFECT, Bench, Scripted, TiresOfTime, World, on_bench
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.drivers.hokuyo.driver import HokuyoConfig, HokuyoLaser
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.link_faults import FaultyLink, LinkFaultConfig
from gvgbot.drivers.transport import ByteStream, TwinDevice, pipe, serve_twin
from gvgbot.errors import DeviceLost, DeviceRefused
from tests.twin.kobuki_body import IdealBody

pytestmark = pytest.mark.twin


def twin_of(world: World | None = None, **config: Any) -> HokuyoTwin:
    quiet = {"range_sigma_m": 0.0, "dropout_fraction": 0.0}
    settings = HokuyoTwinConfig(**{**quiet, **config})
    return HokuyoTwin(settings, world or World(), seed=21)


async def opens_within(bench: Bench, seconds: float) -> None:
    """Fail unless a scan comes in time, and is of just now."""
    began = bench.clock.now()
    async with asyncio.timeout(seconds):
        (scan,) = await bench.scans(1)
    assert began - 0.1 < scan.stamp < bench.clock.now()
    assert bench.clock.now() - scan.stamp < 0.1


@pytest.mark.parametrize(
    ("config", "seconds"),
    [
        pytest.param({"boot_s": 3.3}, 4.6, id="still boots"),
        pytest.param({"starts_in_scip_1": True}, 0.5, id="SCIP 1.1"),
        pytest.param({"starts_in_scip_1": True, "boot_s": 2.0}, 3.5, id="SCIP 1.1 after booting"),
        pytest.param({"starts_abnormal": True}, 6.0, id="abnormal"),
        pytest.param({"answers_once_per_turn": True}, 0.8, id="answers once per turn"),
        pytest.param(
            {"answers_once_per_turn": True, "model": "URG-04LX"}, 1.0, id="a slow one likewise"
        ),
    ],
)
def test_it_opens_a_laser_that_is(config: dict[str, object], seconds: float) -> None:
    async def scenario(bench: Bench) -> None:
        await opens_within(bench, seconds)

    beams = 682 if "model" in config else 1081
    on_bench(twin_of(World(beams=beams), **config), scenario)


@pytest.mark.parametrize(
    "mute",
    [
        pytest.param((b"TM1\n",), id="TM1"),
        pytest.param((b"TM0\n",), id="TM0"),
        pytest.param((b"TM0\n", b"TM1\n", b"TM2\n"), id="TM altogether"),
    ],
)
def test_a_laser_that_keeps_its_time_to_itself_is_opened(mute: tuple[bytes, ...]) -> None:
    """As some UBG do."""

    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 3.0)
        scans = await bench.scans(20)
        assert [scan.stamp for scan in scans] == pytest.approx(world.stamps[-20:], abs=0.003)

    world = World()
    on_bench(Scripted(dict.fromkeys(mute, b""), twin_of(world)), scenario)


def ends(twin: TwinDevice, error: type[Exception], match: str, **config: Any) -> float:
    """When the driver ends by itself (s), as this error says."""

    async def main() -> float:
        here, there = pipe()
        clock = LoopClock()
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(twin, there, clock))
            with pytest.raises(error, match=match):
                await HokuyoLaser(here, HokuyoConfig(**config), clock).run()
            served.cancel()
        return clock.now()

    return run_in_virtual_time(main())


def test_a_laser_that_goes_dead_while_it_is_asked_for_its_time_is_lost() -> None:
    twin = TiresOfTime(twin_of(), 5, dying=True)
    assert ends(twin, DeviceLost, "does not answer") < 4.0


def test_a_base_at_the_port_of_the_laser_is_told_from_silence() -> None:
    ends(KobukiTwin(KobukiTwinConfig(), IdealBody(), 0), DeviceLost, "not the base's port")


def test_a_laser_that_answers_but_part_of_what_it_is_asked_may_be_slow() -> None:
    said = r"PP within 0\.7 s: .*laser\.reply_timeout_s"
    ends(Scripted({b"PP\n": b""}, twin_of()), DeviceLost, said, reply_timeout_s=0.7)


@pytest.mark.parametrize(
    "reply", [pytest.param(b"", id="none"), pytest.param(b"II\n00P\nMODL:x;x\n\n", id="damaged")]
)
def test_a_laser_that_does_not_tell_its_condition_is_opened(reply: bytes) -> None:
    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 2.0)

    on_bench(Scripted({b"II\n": reply}, twin_of()), scenario)


def test_an_abnormal_laser_is_rebooted_once() -> None:
    async def scenario(bench: Bench) -> None:
        await bench.scans(3)
        assert bench.laser.link.reboots == 1

    on_bench(twin_of(starts_abnormal=True), scenario)


def test_a_laser_that_declines_to_stop_what_it_does_not_do_is_opened() -> None:
    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 1.0)

    on_bench(Scripted({b"QT\n": b"QT\n10Q\n\n"}, twin_of()), scenario)


def test_a_laser_whose_motor_gains_speed_is_asked_again() -> None:
    class SpinsUp(Scripted):
        def answer(self, command: bytes, now: float) -> bytes:
            if command.startswith(b"MD") and now < 3.0:
                return command + b"0Mm\n\n"
            return super().answer(command, now)

    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 3.7)

    on_bench(SpinsUp({}, twin_of()), scenario)


def test_a_laser_whose_motor_stays_slow_is_refused() -> None:
    slow = Scripted({b"MD0000108001300\n": b"MD0000108001300\n0Mm\n\n"}, twin_of())
    assert ends(slow, DeviceRefused, "check its power", opening_patience_s=2.0) < 3.2


def test_a_laser_that_stays_abnormal_is_refused() -> None:
    ends(Scripted({b"QT\n": b"QT\n0Ll\n\n"}, twin_of()), DeviceRefused, "status 0L")


@pytest.mark.parametrize("wanted", ["", "H0000007"])
def test_a_laser_with_the_wanted_serial_number_is_used(wanted: str) -> None:
    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 3.0)

    on_bench(twin_of(serial_number="H0000007"), scenario, HokuyoConfig(serial=wanted))


@pytest.mark.parametrize(
    ("told", "named"), [("H0000007", "the laser H0000007"), ("", "without a serial number")]
)
def test_another_laser_than_the_wanted_one_is_refused(told: str, named: str) -> None:
    """On USB all Hokuyos look alike, and may change places when they are plugged in."""
    said = f"{named}, not H0000002: set laser.port"
    ends(twin_of(serial_number=told), DeviceRefused, said, serial="H0000002")


def test_a_stop_that_was_lost_is_sent_again() -> None:
    """Two of three QT do not stop the stream, and the time cannot be asked while it runs."""

    async def first(link: ByteStream, clock: LoopClock) -> None:
        link.write(b"MD0000108001300\n")
        await clock.sleep_until(clock.now() + 1.0)

    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 2.0)

    on_bench(twin_of(lost_stop_fraction=0.67), scenario, first=first)


@pytest.mark.parametrize("backlog_s", [0.5, 5.0, 60.0])
def test_no_scan_of_a_stale_backlog_is_handed_on(backlog_s: float) -> None:
    world = World()

    async def first(link: ByteStream, clock: LoopClock) -> None:
        link.write(b"MD0000108001300\n")  # the very scans that the driver will ask for
        await clock.sleep_until(clock.now() + backlog_s)

    async def scenario(bench: Bench) -> None:
        opened = bench.clock.now()
        scans = await bench.scans(3)
        assert all(scan.stamp > opened - 0.002 for scan in scans)
        assert scans[-1].stamp == pytest.approx(world.stamps[-1], abs=0.002)

    on_bench(twin_of(world), scenario, first=first)


class HostPort:
    """The host's end of a serial line, at a port that lacks some bit rates."""

    def __init__(self, stream: ByteStream, baud: int, lacks: tuple[int, ...] = ()) -> None:
        self.baud = baud
        self.lacks = lacks
        self.read, self.write, self.close = stream.read, stream.write, stream.close

    def set_baud(self, baud: int) -> None:
        if baud in self.lacks:
            raise DeviceLost(f"no {baud} bit/s here")
        self.baud = baud


class SerialLine:
    """A laser on a serial line: only where both ends keep the same bit rate do bytes make sense."""

    def __init__(self, device: HokuyoTwin, host: HostPort, changes_s: float) -> None:
        """`changes_s` is how long the laser takes to change its rate after having agreed."""
        self.device, self.host = device, host
        self.next_due = device.next_due
        self.baud, self.changes_s = device.baud, changes_s
        self.since = -math.inf  # when the laser agreed to what its rate is now

    def rate(self, now: float) -> int:
        if self.device.baud != self.baud and now >= self.since + self.changes_s:
            self.baud = self.device.baud
        return self.baud

    def carried(self, data: bytes, baud: int) -> bytes:
        if baud == self.host.baud:
            return data
        return bytes((byte * 5 + 0x93) % 256 | 0x80 for byte in data)

    def receive(self, data: bytes, now: float) -> bytes:
        baud = self.rate(now)
        return self.sent(self.device.receive(self.carried(data, baud), now), baud, now)

    def advance(self, now: float) -> bytes:
        baud = self.rate(now)
        return self.sent(self.device.advance(now), baud, now)

    def sent(self, data: bytes, baud: int, now: float) -> bytes:
        if self.device.baud == self.baud:
            self.since = now  # it has not agreed to another one yet
        return self.carried(data, baud)


async def serve_rated(
    device: HokuyoTwin, wanted: int, lacks: tuple[int, ...] = (), changes_s: float = 0.0
) -> tuple[HokuyoLaser, HostPort]:
    """A laser driver that has had three scans over a serial line; the port `lacks` bit rates."""
    here, there = pipe()
    clock = LoopClock()
    line = HostPort(here, wanted, lacks)
    laser = HokuyoLaser(line, HokuyoConfig(baud=wanted, link="serial"), clock)
    async with asyncio.TaskGroup() as tasks:
        served = tasks.create_task(serve_twin(SerialLine(device, line, changes_s), there, clock))
        running = tasks.create_task(laser.run())
        for _ in range(3):
            await laser.next_scan()
        running.cancel()
        served.cancel()
    return laser, line


@pytest.mark.parametrize("changes_s", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("found", [19200, 57600, 115200, 750000])
def test_a_laser_at_another_bit_rate_is_found_and_changed(found: int, changes_s: float) -> None:
    async def main() -> None:
        device = twin_of(World(beams=682), model="URG-04LX", serial_baud=found)
        laser, line = await serve_rated(device, 115200, changes_s=changes_s)
        assert laser.link.bad_messages == laser.link.unanswered == 0  # as of a healthy link
        assert device.baud == line.baud == 115200
        assert laser.link.scans == 3

    run_in_virtual_time(main())


@pytest.mark.parametrize(
    ("lacks", "agreed"),
    [
        pytest.param((250000, 500000), 115200, id="rates that are searched"),
        pytest.param((115200,), 750000, id="the wanted one"),
    ],
)
def test_a_rate_that_the_port_lacks_is_passed_over(lacks: tuple[int, ...], agreed: int) -> None:
    async def main() -> None:
        device = twin_of(World(beams=682), model="URG-04LX", serial_baud=750000)
        laser, line = await serve_rated(device, 115200, lacks)
        assert device.baud == line.baud == agreed
        assert laser.link.scans == 3

    run_in_virtual_time(main())


def test_a_laser_that_takes_nine_tenths_of_a_second_to_answer_is_opened_as_it_is() -> None:
    """At a port whose rate can be set, though that means nothing on USB."""

    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        slow = FaultyLink(twin_of(), LinkFaultConfig(command_latency_s=0.9), seed=22)
        laser = HokuyoLaser(HostPort(here, 115200), HokuyoConfig(), clock)
        async with asyncio.TaskGroup() as tasks:
            served = tasks.create_task(serve_twin(slow, there, clock))
            running = tasks.create_task(laser.run())
            for _ in range(30):
                await laser.next_scan()
            running.cancel()
            served.cancel()
        assert (laser.link.restarts, laser.link.refused_scans) == (0, 0)

    with structlog.testing.capture_logs() as logs:
        run_in_virtual_time(main())
    assert "laser keeps its bit rate" not in [entry["event"] for entry in logs]


@pytest.mark.parametrize("boot_s", [0.0, 0.7, 1.1, 1.5, 2.5])
def test_a_laser_that_was_silent_where_rates_mean_nothing_is_not_at_another_one(
    boot_s: float,
) -> None:
    async def main() -> None:
        here, there = pipe()
        clock = LoopClock()
        port = HostPort(here, 115200)
        laser = HokuyoLaser(port, HokuyoConfig(), clock)
        with structlog.testing.capture_logs() as logs:
            async with asyncio.TaskGroup() as tasks:
                served = tasks.create_task(serve_twin(twin_of(boot_s=boot_s), there, clock))
                running = tasks.create_task(laser.run())
                await laser.next_scan()
                running.cancel()
                served.cancel()
        assert port.baud == 115200
        assert [line for line in logs if "bit rate" in line["event"]] == []

    run_in_virtual_time(main())


class StubbornTwin(HokuyoTwin):
    """A laser that does not change its bit rate."""

    def receive(self, data: bytes, now: float) -> bytes:
        if data.startswith(b"SS"):
            return data + b"03S\n\n"
        return super().receive(data, now)


def test_a_laser_that_keeps_its_bit_rate_is_read_at_it() -> None:
    async def main() -> None:
        config = HokuyoTwinConfig(model="URG-04LX", serial_baud=57600)
        device = StubbornTwin(config, World(beams=682), seed=4)
        laser, line = await serve_rated(device, 115200)
        assert device.baud == line.baud == 57600
        assert laser.mode is not None
        assert laser.mode.adapted is not None  # what fits into 115200 does not into 57600
        assert (laser.mode.request.cluster, laser.mode.request.skip) == (2, 1)

    run_in_virtual_time(main())


def test_a_laser_that_drops_its_link_to_reboot_is_lost_and_opens_again() -> None:
    async def main() -> None:
        clock = LoopClock()
        ends = [pipe(), pipe()]
        wire = [ends[0]]

        def plug(is_plugged: bool) -> None:
            if is_plugged:
                wire.append(ends[1])
            else:
                wire[0][0].close()

        device = HokuyoTwin(HokuyoTwinConfig(starts_abnormal=True), World(), 3, plug)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(serve_twin(device, ends[0][1], clock))
            with pytest.raises(DeviceLost, match="closed"):
                await HokuyoLaser(ends[0][0], HokuyoConfig(), clock).run()
            await clock.sleep_until(device.next_due())
            device.advance(clock.now())
            assert len(wire) == 2
            served = tasks.create_task(serve_twin(device, ends[1][1], clock))
            laser = HokuyoLaser(ends[1][0], HokuyoConfig(), clock)
            running = tasks.create_task(laser.run())
            await laser.next_scan()
            running.cancel()
            served.cancel()

    run_in_virtual_time(main())


def test_the_perfect_twin_needs_no_cure() -> None:
    async def scenario(bench: Bench) -> None:
        await opens_within(bench, 0.3)
        link = bench.laser.link
        assert (link.reboots, link.restarts, link.unanswered) == (0, 0, 0)

    on_bench(HokuyoTwin(PERFECT, World(), seed=6), scenario)


def test_a_laser_that_measures_only_once_it_is_switched_on_is_switched_on() -> None:
    """Real ones switch themselves on when they are asked for scans."""
    ask = b"MD0000108001300\n"

    class Switched(Scripted):
        def answer(self, command: bytes, now: float) -> bytes:
            if command in (b"BM\n", b"QT\n"):
                refusal = ask + b"10Q\n\n"
                self.replies = {} if command == b"BM\n" else {ask: refusal}
            return super().answer(command, now)

    async def scenario(bench: Bench) -> None:
        await bench.scans(3)

    on_bench(Switched({}, twin_of()), scenario)
