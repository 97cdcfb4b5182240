"""The simulated base near its dock: what the receivers see, and what the charger says."""

import math
from typing import Any

import numpy as np
import pytest

from gvgbot.drivers.kobuki.commands import (
    BaseControl,
    Command,
    GetGain,
    GpOutput,
    Melody,
    SetGain,
    Sound,
    SoundSequence,
    encode_commands,
)
from gvgbot.drivers.kobuki.dock import Dock
from gvgbot.drivers.kobuki.frames import Frame, FrameParser
from gvgbot.drivers.kobuki.payloads import ControllerInfo, CoreSensors, DockIr, decode_feedback
from gvgbot.drivers.kobuki.twin import KobukiTwin, KobukiTwinConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose
from tests.twin.kobuki_body import IdealBody

NEAR_LEFT, NEAR_CENTRE, NEAR_RIGHT = 0x01, 0x02, 0x04
FAR_CENTRE, FAR_LEFT, FAR_RIGHT = 0x08, 0x10, 0x20
DOCK = Pose(3.0, -1.0, 2.0)  # anywhere


def nothing_in_the_way(bearing: float) -> float:
    return math.inf


def seen(x: float, y: float, turned: float = 0.0) -> DockIr:
    """What a base sees at a place in front of the dock, turned so far (rad) away from it."""
    base = Pose(x, y, math.atan2(-y, -x) + turned)
    return Dock(DOCK).shines_on(DOCK.compose(base), nothing_in_the_way)


@pytest.mark.parametrize(
    ("x", "y", "beams"),
    [
        (3.0, 0.0, FAR_CENTRE),
        (3.0, 0.9, FAR_LEFT),
        (3.0, -0.9, FAR_RIGHT),
        (0.5, 0.0, NEAR_CENTRE),
        (0.5, 0.3, NEAR_LEFT),
        (0.5, -0.3, NEAR_RIGHT),
        (0.9, 0.0, NEAR_CENTRE | FAR_CENTRE),  # near and far overlap,
        (3.0, 3.0 * math.tan(math.radians(8.5)), FAR_CENTRE | FAR_LEFT),  # as the sectors do
        (5.5, 0.0, 0),  # too far,
        (3.0, 1.1, 0),  # too far aside,
        (-1.0, 0.0, 0),  # behind it
    ],
)
def test_each_place_before_the_dock_has_its_beams(x: float, y: float, beams: int) -> None:
    assert seen(x, y) == DockIr(0, beams, 0)


@pytest.mark.parametrize(
    ("turned_deg", "receivers"),
    [(0, "c"), (-60, "l"), (60, "r"), (-30, "lc"), (30, "cr"), (120, ""), (180, "")],
)
def test_the_receiver_on_the_docks_side_sees_it(turned_deg: int, receivers: str) -> None:
    view = seen(2.0, 0.0, math.radians(turned_deg))
    assert [bool(bits) for bits in (view.left, view.centre, view.right)] == [
        name in receivers for name in "lcr"
    ]


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_who_turns_the_docks_beam_of_one_side_to_the_other_drives_to_its_middle(side: int) -> None:
    """The makers' way to dock: from the left, turn left till the right receiver sees it, go."""
    base = Pose(2.0, side * 0.8, math.atan2(-side * 0.8, -2.0) + side * math.radians(75))
    view = Dock(DOCK).shines_on(DOCK.compose(base), nothing_in_the_way)
    assert view == (DockIr(FAR_LEFT, 0, 0) if side == 1 else DockIr(0, 0, FAR_RIGHT))
    for _ in range(100):
        base = base.compose(Pose(0.01, 0.0, 0.0))
        view = Dock(DOCK).shines_on(DOCK.compose(base), nothing_in_the_way)
        if (view.left | view.centre | view.right) & FAR_CENTRE:
            return
    pytest.fail("the middle was not reached within a metre")


class Rig:
    """A base in a hall of 10 m with a wall at x = 5 m, and a dock at (2, 2) that faces east."""

    def __init__(self, at: Pose, **config: Any) -> None:
        occupied = np.zeros((100, 100), bool)
        occupied[:, 50] = True
        world = World(occupied, 0.1)
        self.body = IdealBody()
        self.body.pose = at
        settings = KobukiTwinConfig(odometry="perfect", dock=(2.0, 2.0, 0.0), **config)
        self.twin = KobukiTwin(
            settings,
            self.body,
            seed=1,
            look=lambda bearing: float(world.cast(self.body.pose, np.array([bearing]), 9.0)[0]),
        )

    def tell(self, *commands: Command) -> None:
        self.twin.receive(encode_commands(commands), self.body.now)

    def frame(self) -> tuple[CoreSensors, DockIr, list[ControllerInfo]]:
        (frame,) = FrameParser().feed(self.twin.advance(self.twin.next_due()))
        assert isinstance(frame, Frame)
        core, dock, *rest = decode_feedback(frame.payload)
        assert isinstance(core, CoreSensors)
        assert isinstance(dock, DockIr)
        return core, dock, [part for part in rest if isinstance(part, ControllerInfo)]

    def cores(self, seconds: float) -> list[CoreSensors]:
        return [self.frame()[0] for _ in range(round(50 * seconds))]


def test_walls_hide_the_dock() -> None:
    _, before, _ = Rig(Pose(4.5, 2.0, math.pi)).frame()
    _, behind, _ = Rig(Pose(5.5, 2.0, math.pi)).frame()
    assert (before.centre, behind.centre) == (FAR_CENTRE, 0)


def test_a_base_that_stands_on_the_dock_charges_until_it_is_full() -> None:
    rig = Rig(Pose(2.2, 2.0, math.pi), battery_v=16.61, battery_charge_v_per_h=10.0)
    cores = rig.cores(60.0)
    full = [core.charger for core in cores].index(2)
    assert {core.charger for core in cores[:full]} == {6}
    assert {core.charger for core in cores[full:]} == {2}
    assert full / 50 == pytest.approx((16.7 - 16.61) / 10.0 * 3600.0, abs=0.1)
    assert cores[-1].battery_dv == 167


@pytest.mark.parametrize(
    ("at", "charger"),
    [
        (Pose(2.2, 2.0, math.pi), 6),
        (Pose(2.4, 2.0, math.pi), 0),  # not there yet
        (Pose(2.2, 2.0, math.pi + 0.5), 0),  # askew
        (Pose(2.2, 2.0, 0.0), 0),  # backwards
        (Pose(1.8, 2.0, 0.0), 0),  # behind it
    ],
    ids=str,
)
def test_it_charges_only_where_the_contacts_meet(at: Pose, charger: int) -> None:
    assert Rig(at).frame()[0].charger == charger


def test_driving_off_ends_the_charging_and_the_battery_goes_down() -> None:
    rig = Rig(Pose(2.2, 2.0, math.pi), battery_v=16.0, battery_drain_v_per_h=10.0)
    assert rig.frame()[0].charger == 6
    rig.tell(BaseControl(-200, 0))
    cores = rig.cores(40.0)
    assert cores[-1].charger == 0
    assert cores[-1].battery_dv == 159


def test_the_adapter_charges_wherever_it_is() -> None:
    rig = Rig(Pose(8.0, 8.0, 0.0), has_adapter=True)
    assert rig.frame()[0].charger == 22
    rig.twin.plug_adapter(False)
    assert rig.frame()[0].charger == 0
    assert Rig(Pose(), has_adapter=True, battery_v=16.8).frame()[0].charger == 18


def test_what_the_host_lights_and_plays_can_be_looked_up() -> None:
    rig = Rig(Pose())
    rig.tell(GpOutput(0x02F1), Sound(826, 200))  # outputs, power, a green LED; an A
    rig.tell(SoundSequence(Melody.RECHARGE))
    assert rig.twin.output == 0x02F1
    assert list(rig.twin.played) == [Sound(826, 200), SoundSequence(2)]


@pytest.mark.parametrize(("firmware", "answers"), [("1.2.0", 1), ("1.1.4", 0)])
def test_gains_came_with_firmware_1_2(firmware: str, answers: int) -> None:
    rig = Rig(Pose(), firmware_version=firmware)
    rig.tell(SetGain(1, 1, 2, 3), GetGain())
    assert rig.frame()[2] == answers * [ControllerInfo(1, 1, 2, 3)]
