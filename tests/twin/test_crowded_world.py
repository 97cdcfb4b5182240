"""People and glass in the simulation: what the driver of its laser gets, in virtual time."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from gvgbot.cli import main
from gvgbot.clock import LoopClock, run_in_virtual_time
from gvgbot.config import load_config
from gvgbot.drivers.hokuyo.driver import HokuyoLaser
from gvgbot.drivers.world import save_world
from gvgbot.errors import WorldError
from gvgbot.geometry import Array
from gvgbot.simulation import Simulation, open_place
from gvgbot.worlds.canvas import Canvas

pytestmark = pytest.mark.twin
SCANS = 60


def ranges_of(*overrides: str) -> Array:
    """What a laser sees from a robot that stands: (scans, beams), m."""
    config = load_config(None, [f"twin.{one}" for one in overrides])

    async def listen() -> list[Array]:
        clock = LoopClock()
        simulation = Simulation(config, open_place(config), clock)
        laser = HokuyoLaser(simulation.laser, config.laser, clock)
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(simulation.run()), tasks.create_task(laser.run())]
            seen = [(await laser.next_scan()).ranges for _ in range(SCANS)]
            for task in serving:
                task.cancel()
        return seen

    return np.array(run_in_virtual_time(listen()))


def test_people_hide_what_is_behind_them_and_nothing_else() -> None:
    empty, peopled = ranges_of("world=crowd:1", "people=0"), ranges_of("world=crowd:1", "people=30")
    both = np.isfinite(empty) & np.isfinite(peopled)
    assert (peopled[both] <= empty[both]).all()
    changed = (peopled != empty) & both
    assert 0.001 < changed.mean() < 0.5
    assert len(np.unique(np.nonzero(changed)[1])) > 1.5 * changed.sum(axis=1).mean()  # they move


def test_equal_seeds_have_equal_people_and_equal_glass() -> None:
    overrides = ("world=glass:2", "people=8")
    first, second = ranges_of(*overrides, "seed=1"), ranges_of(*overrides, "seed=1")
    assert np.array_equal(first, second, equal_nan=True)
    assert not np.array_equal(first, ranges_of(*overrides, "seed=2"), equal_nan=True)


def test_the_world_says_how_many_people_there_are_unless_the_configuration_does() -> None:
    for overrides, has_people in (
        (["twin.world=crowd:2"], True),
        (["twin.world=crowd:2", "twin.people=0"], False),
        (["twin.world=office"], False),
        (["twin.world=office", "twin.people=1"], True),
    ):
        assert (open_place(load_config(None, overrides)).walkways is not None) == has_people


def test_people_without_room_are_refused(tmp_path: Path) -> None:
    canvas = Canvas(3.0, 3.0)
    canvas.carve(1.0, 1.0, 1.5, 2.0)
    path = save_world(canvas.world("closet"), tmp_path)
    overrides = [f"twin.world={path}", "twin.start=[1.25, 1.5, 0]", "twin.people=1"]
    with pytest.raises(WorldError, match="no room for people"):
        open_place(load_config(None, overrides))


@pytest.mark.parametrize("value", ["-1", "101", "many", "1.5"])
def test_a_wrong_number_of_people_is_one_clear_line(
    value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explore", "--set", f"twin.people={value}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"twin.people={value}" in line
    assert "from 0 to 100" in line
