"""What every built-in world promises, by morphology and topology of its bitmap."""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.world import World, check_start, save_world
from gvgbot.errors import WorldError
from gvgbot.worlds import NAMES, builtin, open_world

DRAWN = ("jittered", "rooms", "cave", "floor_plan")
LOOPS = {
    "office": 3,
    "grid": 16,
    "jittered": 16,
    "rooms": 2,
    "cave": 6,
    "comb": 0,
    "spiral": 0,
    "ring": 1,
    "hall": 4,
}
SAMPLES = [*NAMES, *(f"{name}:{seed}" for name in DRAWN for seed in (1, 2))]
every_world = pytest.mark.parametrize("name", SAMPLES)


def shrunk(free: Mask, width: float) -> Mask:
    """Where the centre of a disc of this diameter (m) can be, cells of 5 cm."""
    reach = width / 2 / 0.05
    k = int(reach)
    disc = np.hypot(*np.mgrid[-k : k + 1, -k : k + 1]) <= reach
    return np.asarray(ndimage.binary_erosion(free, disc))


def topology(free: Mask) -> tuple[int, int]:
    """Separate spaces, and loops around islands of wall."""
    return ndimage.label(free)[1], ndimage.label(~free, np.ones((3, 3)))[1] - 1


@every_world
def test_free_space_is_in_one_piece_with_the_promised_loops(name: str) -> None:
    world, _ = builtin(name)
    pieces, loops = topology(~world.occupied)
    assert (pieces, loops) == (1, LOOPS.get(name.partition(":")[0], loops))


@every_world
def test_a_passage_is_wide_or_there_is_none(name: str) -> None:
    world, _ = builtin(name)
    free = ~world.occupied
    whole = topology(free)
    for width in (0.3, 0.6, 0.8):
        assert topology(shrunk(free, width)) == whole


@every_world
def test_the_outer_wall_is_closed_and_no_wall_is_thin(name: str) -> None:
    world, _ = builtin(name)
    walls = np.pad(world.occupied, 2, constant_values=True)
    assert np.array_equal(ndimage.binary_opening(walls, np.ones((2, 2), dtype=np.bool_)), walls)
    inner = np.pad(world.occupied[2:-2, 2:-2], 2, constant_values=True)
    assert np.array_equal(inner, world.occupied)


@every_world
def test_the_robot_fits_at_the_start(name: str) -> None:
    world, start = builtin(name)
    check_start(world, start, 0.25)


@every_world
def test_the_same_seed_draws_the_same_world(name: str) -> None:
    (first, here), (second, there) = builtin(name), builtin(name)
    assert np.array_equal(first.occupied, second.occupied)
    assert here == there
    assert {type(value) for value in (here.x, here.y, here.theta)} == {float}  # fit for any encoder
    assert (first.name, first.resolution_m) == (name.partition(":")[0], 0.05)


@pytest.mark.parametrize("name", DRAWN)
def test_another_seed_draws_another_world(name: str) -> None:
    worlds = [builtin(f"{name}:{seed}")[0] for seed in range(3)]
    for a, b in ((0, 1), (1, 2), (0, 2)):
        assert not np.array_equal(worlds[a].occupied, worlds[b].occupied)


def test_the_office_is_of_the_size_of_a_floor() -> None:
    world, _ = builtin("office")
    rows, columns = np.nonzero(~world.occupied)
    assert 30.0 < np.ptp(columns) * 0.05 < 40.0
    assert 18.0 < np.ptp(rows) * 0.05 < 25.0


def test_a_name_opens_a_built_in_world_and_a_path_a_file(tmp_path: Path) -> None:
    world, start = open_world("rooms")
    assert start == builtin("rooms")[1]
    loaded, nowhere = open_world(str(save_world(world, tmp_path)))
    assert isinstance(loaded, World)
    assert np.array_equal(loaded.occupied, world.occupied)
    assert nowhere is None


def test_an_unknown_name_is_answered_with_the_names() -> None:
    with pytest.raises(WorldError, match="castle") as refusal:
        builtin("castle")
    with pytest.raises(WorldError, match="castle") as other_refusal:
        open_world("castle")
    for answer in (str(refusal.value), str(other_refusal.value)):
        assert all(name in answer for name in NAMES)


def test_an_absent_world_file_is_named() -> None:
    with pytest.raises(WorldError, match=r"absent\.yaml: no such file"):
        open_world("absent.yaml")
