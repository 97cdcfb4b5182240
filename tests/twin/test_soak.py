"""A laser and a base with every fault that they and their links can have, at once and for long."""

import pytest

from gvgbot.drivers.hokuyo.twin import HokuyoTwinConfig, LaserMishapConfig
from gvgbot.drivers.kobuki.mishaps import MishapConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.link_faults import LinkFaultConfig
from tests.twin.device_rig import ENDS_OF_LINK
from tests.twin.soak_rig import DRIFT_PPM, Soak, soak

pytestmark = [pytest.mark.twin, pytest.mark.slow]

DAY = 86_400.0  # s
DAMAGE = {"flipped bit", "lost byte", "inserted byte", "cut message"}


def link_config(per_h: float, damage_per_kb: float, chip_timer_s: float = 0.0) -> LinkFaultConfig:
    """A link with all its faults, a little late and jittery."""
    return LinkFaultConfig(
        latency_s=0.0005,
        jitter_s=0.005,
        chip_timer_s=chip_timer_s,
        flipped_bits_per_kb=damage_per_kb,
        lost_bytes_per_kb=damage_per_kb,
        inserted_bytes_per_kb=damage_per_kb,
        cut_messages_per_k=100.0 * damage_per_kb,
        silences_per_h=per_h,
        unplugs_per_h=per_h,
    )


def laser_config(per_h: float, damage_per_kb: float) -> HokuyoTwinConfig:
    """A URG-04LX on a serial line too slow for all its beams, whose clock wraps after a second."""
    return HokuyoTwinConfig(
        model="URG-04LX",
        range_sigma_m=0.0,
        dropout_fraction=0.0,
        lost_stop_fraction=0.1,
        answers_once_per_turn=True,
        clock_drift_ppm=DRIFT_PPM,
        clock_start_ms=2**24 - 1500,
        serial_baud=115_200,
        mishaps=LaserMishapConfig(
            reboots_per_h=per_h,
            freezes_per_h=per_h,
            stalls_per_h=per_h,
            unstable_per_h=per_h,
            abnormal_per_h=per_h,
            blinds_per_h=per_h,
        ),
        link=link_config(per_h, damage_per_kb),
    )


def base_config(per_h: float, damage_per_kb: float) -> KobukiTwinConfig:
    """A base without a time-out of its own, behind a converter that collects bytes for 16 ms."""
    return KobukiTwinConfig(
        odometry="perfect",
        has_command_timeout=False,
        mishaps=MishapConfig(
            bumps_per_h=per_h,
            cliffs_per_h=per_h,
            wheel_drops_per_h=per_h,
            over_currents_per_h=per_h,
            low_batteries_per_h=per_h,
            slips_per_h=per_h,
            reboots_per_h=per_h,
            short_parts_per_h=per_h,
            unknown_parts_per_h=per_h,
            no_replies_per_h=per_h,
        ),
        link=link_config(per_h, damage_per_kb, chip_timer_s=0.016),
    )


def check(rig: Soak, seconds: float) -> None:
    laser, base = laser_config(1.0, 1.0), base_config(1.0, 1.0)
    assert set(rig.laser.link.counts) == set(rig.base.link.counts) == DAMAGE | ENDS_OF_LINK
    assert set(rig.laser.twin.counts) == set(laser.mishaps.rates)
    assert set(rig.base.twin.mishaps.counts) == set(base.mishaps.rates)
    for name in ("bad_messages", "repeated_scans", "refused_scans", "restarts", "reboots"):
        assert rig.laser.total(name) > 0, name
    assert rig.laser.total("reboots") <= 2 * rig.laser.twin.counts["abnormal"]  # one may be lost
    assert (rig.laser.wrong, rig.jumps) == (0, 0)
    assert rig.laser_recovery.worst < 2.0, rig.laser_recovery
    assert rig.base_recovery.worst < 2.0, rig.base_recovery
    assert rig.scan_stamps.largest < 0.007  # jitter, latency, and a wire's byte, all one way
    assert rig.odometry_stamps.largest < 0.022  # the converter's beat besides
    assert rig.scans > 0.3 * 10.0 * seconds
    assert rig.odometries > 0.5 * 50.0 * seconds


def test_minutes_of_all_faults_at_once_are_survived() -> None:
    check(soak(laser_config(40.0, 0.02), base_config(40.0, 0.02), 150.0, seed=2), 150.0)


@pytest.mark.bench  # half an hour of computing: run it with -m bench
@pytest.mark.timeout(7200)
def test_a_day_of_all_faults_at_once_is_survived() -> None:
    rig = soak(laser_config(2.0, 0.0005), base_config(2.0, 0.001), DAY)
    check(rig, DAY)
    assert rig.base.frames.wraps > 0
    assert rig.scan_stamps.rms < 0.0015
    assert rig.memory[1][0] < 1.01 * rig.memory[0][0]
