"""A client that others wrote, hokuyolx, on the simulated laser: it reads what is there."""

import asyncio
from collections.abc import Callable

import numpy as np
import pytest
from hokuyolx import HokuyoLX
from hokuyolx.exceptions import HokuyoStatusException

from gvgbot.clock import LoopClock
from gvgbot.drivers.hokuyo.models import ModelName
from gvgbot.drivers.hokuyo.twin import HokuyoTwin, HokuyoTwinConfig
from gvgbot.drivers.tcp import parse_address
from gvgbot.drivers.tcp_port import TcpPort
from gvgbot.drivers.transport import serve_twin
from gvgbot.geometry import Array

pytestmark = pytest.mark.slow
STEPS = 1081
STANDBY, TIME, SINGLE, ASLEEP = 0, 2, 3, 5  # its codes for the state of a laser


def room(stamp: float, steps: int = STEPS) -> Array:
    """A square room of 4 m, seen from its middle."""
    bearings = np.radians(np.linspace(-135.0, 135.0, STEPS))
    return np.asarray(2.0 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings))))


TRUTH_MM = room(0.0) * 1000.0
NEAR = 0.5 + 1e-6  # mm


def with_client(use: Callable[[HokuyoLX], None], model: ModelName = "UST-10LX") -> None:
    """Let a client loose on a perfect laser, on its own side of a TCP connection."""
    config = HokuyoTwinConfig(
        model=model, range_sigma_m=0.0, dropout_fraction=0.0, clock_start_ms=5_000_000
    )
    twin = HokuyoTwin(config, room, seed=3)

    def work(address: tuple[str, int]) -> None:
        client = HokuyoLX(addr=address, tsync=False, activate=False, convert_time=False)
        try:
            use(client)
        finally:
            client.close()

    async def main() -> None:
        port = TcpPort("tcp://127.0.0.1:0")
        assert port.path is not None
        async with asyncio.TaskGroup() as tasks:
            clock = LoopClock(ahead=-asyncio.get_running_loop().time())  # begins at 0
            served = tasks.create_task(serve_twin(twin, port, clock))
            try:
                await asyncio.to_thread(work, parse_address(port.path))
            finally:
                served.cancel()
                port.close()

    asyncio.run(main())


def _condition(client: HokuyoLX) -> dict[str, str | int]:
    """What it says of itself; the client cannot read a time whose code has a colon in it."""
    for _ in range(1000):
        try:
            return dict(client.sensor_state())
        except ValueError:
            continue
    raise AssertionError("no answer could be read")


@pytest.mark.parametrize(("model", "reach"), [("UST-10LX", 30_000), ("UST-20LX", 60_000)])
def test_it_learns_which_laser_it_has(model: ModelName, reach: int) -> None:
    def use(client: HokuyoLX) -> None:
        assert client.model.startswith(model)
        assert (client.dmin, client.dmax, client.ares) == (20, reach, 1440)
        assert (client.amin, client.amax, client.aforw) == (0, 1080, 540)
        assert client.scan_freq == 40
        assert client.version()["PROD"] == model
        assert _condition(client)["LASR"] == "OFF"

    with_client(use, model)


def test_it_measures_the_room_once() -> None:
    def use(client: HokuyoLX) -> None:
        client.activate()
        _, ranges = client.get_dist()
        assert np.abs(ranges - TRUTH_MM).max() <= NEAR
        _, both = client.get_intens(start=100, end=500)
        assert np.abs(both[:, 0] - TRUTH_MM[100:501]).max() <= NEAR
        assert both[:, 1].min() > 0
        _, nearest = client.get_dist(grouping=4)
        groups = np.append(TRUTH_MM, 3 * [np.inf]).reshape(-1, 4)
        assert np.abs(nearest - groups.min(axis=1)).max() <= NEAR
        _, polar = client.get_filtered_dist(dmax=2500)
        assert len(polar) == np.count_nonzero(np.rint(TRUTH_MM) <= 2500)
        assert np.degrees(polar[0, 0]) == pytest.approx(-135.0 + np.argmax(TRUTH_MM <= 2500) / 4)

    with_client(use)


@pytest.mark.parametrize(("skips", "step"), [(1, 50), (3, 100)])  # it cannot read two at once
def test_it_measures_the_room_again_and_again(skips: int, step: int) -> None:
    def use(client: HokuyoLX) -> None:
        seen = list(client.iter_dist(scans=8, skips=skips))
        assert [to_come for _, _, to_come in seen] == [7, 6, 5, 4, 3, 2, 1, 0]
        assert set(np.diff([stamp for _, stamp, _ in seen])) <= {step, step + 1}  # drift
        assert all(np.abs(ranges - TRUTH_MM).max() <= NEAR for ranges, _, _ in seen)
        for both, _, _ in client.iter_intens(scans=2):
            assert np.abs(both[:, 0] - TRUTH_MM).max() <= NEAR
        assert client.laser_state()[0] == STANDBY

    with_client(use)


def test_it_walks_through_all_states() -> None:
    def use(client: HokuyoLX) -> None:
        states = [client.laser_state()[0]]
        for change in (client.activate, client.standby, client.sleep, client.activate):
            change()
            states.append(client.laser_state()[0])
        assert states == [STANDBY, SINGLE, STANDBY, ASLEEP, SINGLE]
        assert client.activate()[0] == 2  # already lit
        client.standby()
        with pytest.raises(HokuyoStatusException):
            client.get_dist()  # with the laser off

    with_client(use)


def test_it_reads_the_clock_and_sets_it_back() -> None:
    def use(client: HokuyoLX) -> None:
        assert client.tsync_exit()[0] == "03"  # it was not in that state
        assert [client.tsync_enter()[0] for _ in range(2)] == ["00", "02"]
        assert client.laser_state()[0] == TIME
        with pytest.raises(HokuyoStatusException):
            client.activate()
        times = [client.tsync_get() for _ in range(1000)]
        assert times == sorted(times)
        assert times[0] >= 5_000_000
        assert client.tsync_exit()[0] == "00"
        client.time_sync(N=3, dt=0.001)
        client.reset()
        assert client.tsync_get() < 5_000_000
        client.reboot()

    with_client(use)
