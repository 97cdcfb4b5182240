"""What goes wrong with a laser and its link, and how the driver comes through it."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.hokuyo.twin_config import LaserMishap, LaserMishapConfig
from gvgbot.drivers.link_faults import LinkFault, LinkFaultConfig
from tests.twin.hokuyo_rig import LaserRig, on_rig

pytestmark = pytest.mark.twin


@pytest.mark.parametrize(
    ("mishap", "duration", "within"),
    [
        pytest.param("frozen", 3.0, 2.0, id="frozen"),
        pytest.param("stalled", 3.0, 2.0, id="stalled"),
        pytest.param("unstable", 3.0, 2.0, id="unstable"),
        pytest.param("blind", 3.0, 2.0, id="blind"),
        pytest.param("reboot", 0.0, 3.5, id="reboot"),  # 1.5 s of it is the reboot itself
        pytest.param("abnormal", 0.0, 6.0, id="abnormal"),  # needs a reboot to end
    ],
)
def test_scans_go_on_after_a_mishap(mishap: LaserMishap, duration: float, within: float) -> None:
    async def scenario(rig: LaserRig) -> None:
        await rig.good_scan(2.0)
        rig.twin.inject(mishap, duration)
        await rig.clock.sleep_until(rig.clock.now() + duration + 0.2)
        await rig.good_scan(within)
        assert rig.wrong == 0
        assert rig.twin.counts[mishap] == 1

    on_rig(scenario)


@pytest.mark.parametrize("fault", ["silence", "unplug"])
@pytest.mark.parametrize("duration", [0.3, 2.0, 20.0])
def test_scans_go_on_within_two_seconds_of_a_links_return(
    fault: LinkFault, duration: float
) -> None:
    async def scenario(rig: LaserRig) -> None:
        await rig.good_scan(2.0)
        rig.link.inject(fault, duration)
        await rig.clock.sleep_until(rig.clock.now() + duration + 0.1)
        await rig.good_scan(2.0)
        assert rig.wrong == 0

    on_rig(scenario)


def test_a_pulled_cable_is_noticed_at_once_and_silence_within_two_seconds() -> None:
    lost: dict[str, float] = {}

    async def scenario(rig: LaserRig, fault: LinkFault = "unplug") -> None:
        await rig.good_scan(2.0)
        began = rig.clock.now()
        rig.link.inject(fault, 30.0)
        while not rig.total("restarts") and rig.laser.away is None:
            await rig.clock.sleep_until(rig.clock.now() + 0.01)
        lost[fault] = rig.clock.now() - began

    on_rig(scenario)
    on_rig(lambda rig: scenario(rig, "silence"))
    assert lost["unplug"] < 0.15  # one scan's time: faults begin when the twin is next due
    assert 0.2 < lost["silence"] < 0.6


def test_every_loss_is_counted_and_no_damaged_scan_is_handed_on() -> None:
    link = LinkFaultConfig(
        flipped_bits_per_kb=0.02,
        lost_bytes_per_kb=0.01,
        inserted_bytes_per_kb=0.01,
        cut_messages_per_k=10.0,
    )

    async def scenario(rig: LaserRig) -> None:
        await rig.clock.sleep_until(120.0)
        assert rig.wrong == 0
        assert rig.total("bad_messages") > 20
        assert len(rig.arrivals) > 0.8 * rig.world.count
        assert min(rig.link.counts[name] for name in rig.link.counts) > 5

    on_rig(scenario, link=link)


@pytest.mark.parametrize("sync", [True, False])
def test_a_reboot_to_the_same_time_of_its_clock_is_no_trap(*, sync: bool) -> None:
    """A clock that began again stands a little further than at the last scan before."""

    async def scenario(rig: LaserRig) -> None:
        for uptime in (2.0, 0.8, 0.9, 1.0, 1.1, 1.2):
            await rig.clock.sleep_until(rig.clock.now() + uptime + 1.5)
            rig.twin.inject("reboot")
        await rig.clock.sleep_until(rig.clock.now() + 10.0)
        assert np.abs(rig.errors).max() < 0.010

    on_rig(scenario, config=HokuyoConfig(synchronise=sync))


@pytest.mark.parametrize("sync", [True, False])
def test_a_stream_that_begins_with_an_old_scan_stamps_none_too_late(*, sync: bool) -> None:
    """The laser freezes while nobody listens, and then sends what it measured long ago."""

    async def scenario(rig: LaserRig) -> None:
        await rig.good_scan(2.0)
        rig.link.inject("unplug", 3.0)
        await rig.clock.sleep_until(rig.clock.now() + 2.8)
        rig.twin.inject("frozen", 1.0)
        await rig.clock.sleep_until(rig.clock.now() + 5.0)
        assert rig.total("repeated_scans") > 0
        assert np.abs(rig.errors).max() < 0.002

    on_rig(scenario, config=HokuyoConfig(synchronise=sync))


def test_a_chip_that_collects_bytes_costs_little_of_the_stamps() -> None:
    async def scenario(rig: LaserRig) -> None:
        await rig.clock.sleep_until(90.0)
        assert np.sqrt(np.mean(np.square(rig.errors[300:]))) < 0.0025

    on_rig(scenario, link=LinkFaultConfig(chip_timer_s=0.016))


def test_the_same_seed_gives_the_same_faults() -> None:
    link = LinkFaultConfig(flipped_bits_per_kb=0.1, silences_per_h=200.0, jitter_s=0.01)
    mishaps = LaserMishapConfig(freezes_per_h=200.0, reboots_per_h=100.0)

    async def scenario(rig: LaserRig) -> None:
        await rig.clock.sleep_until(60.0)

    first, second = (on_rig(scenario, link=link, mishaps=mishaps, seed=9) for _ in range(2))
    other = on_rig(scenario, link=link, mishaps=mishaps, seed=10)
    assert first.arrivals == second.arrivals
    assert first.arrivals != other.arrivals


EVERYTHING = LinkFaultConfig(
    latency_s=0.0005,
    jitter_s=0.005,
    flipped_bits_per_kb=0.003,
    lost_bytes_per_kb=0.002,
    inserted_bytes_per_kb=0.002,
    cut_messages_per_k=2.0,
    silences_per_h=20.0,
    unplugs_per_h=20.0,
)
EVERY_MISHAP = LaserMishapConfig(
    reboots_per_h=15.0,
    freezes_per_h=15.0,
    stalls_per_h=15.0,
    unstable_per_h=15.0,
    abnormal_per_h=15.0,
    blinds_per_h=15.0,
)


def soak(hours: float, link: LinkFaultConfig, mishaps: LaserMishapConfig) -> LaserRig:
    """All faults at once, with a clock that wraps in the first minutes."""

    async def scenario(rig: LaserRig) -> None:
        await rig.clock.sleep_until(3600.0 * hours)

    return on_rig(
        scenario,
        link=link,
        mishaps=mishaps,
        seed=5,
        clock_start_ms=2**24 - 200_000,
        answers_once_per_turn=True,
        lost_stop_fraction=0.1,
    )


def check_soak(rig: LaserRig, hours: float) -> None:
    assert rig.wrong == 0
    assert len(rig.arrivals) > 0.5 * 10.0 * 3600.0 * hours
    faults = rig.link.counts + rig.twin.counts
    assert min(faults[name] for name in EVERY_MISHAP.rates) > 0
    assert min(faults[name] for name in ("silence", "unplug", "flipped bit", "lost byte")) > 0
    assert np.diff(rig.arrivals).max() < 15.0  # several faults may follow each other
    assert np.abs(rig.errors).max() < 0.007  # late by jitter and latency at most
    for name in ("bad_messages", "repeated_scans", "refused_scans", "restarts", "reboots"):
        assert rig.total(name) > 0, name


def test_minutes_of_all_faults_at_once_hand_on_no_wrong_scan() -> None:
    link = replace(EVERYTHING, silences_per_h=80.0, unplugs_per_h=80.0)
    often = {f.name: 4 * getattr(EVERY_MISHAP, f.name) for f in fields(EVERY_MISHAP)}
    mishaps = replace(EVERY_MISHAP, **often | {"duration_s": 1.0})
    check_soak(soak(0.15, link, mishaps), 0.15)


@pytest.mark.bench  # minutes of computing: run it with -m bench
@pytest.mark.timeout(1200)
def test_a_day_of_all_faults_at_once_hands_on_no_wrong_scan() -> None:
    check_soak(soak(24.0, EVERYTHING, EVERY_MISHAP), 24.0)
