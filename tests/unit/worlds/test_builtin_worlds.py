"""What every built-in world promises, by morphology and topology of its bitmap."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from gvgbot.drivers.ray_casting import Mask
from gvgbot.drivers.start import check_start
from gvgbot.drivers.world import World, save_world
from gvgbot.errors import WorldError
from gvgbot.geometry import Array
from gvgbot.worlds import _MAKERS, NAMES, builtin, open_world

DRAWN = (
    *("jittered", "rooms", "cave", "floor_plan", "narrow", "doors", "clutter", "slopes"),
    *("open_hall", "glass", "crowd", "large_plan"),
)
TIGHT = ("doors", "clutter")  # with gaps that a robot does not fit through
RESOLUTIONS = {"doors": 0.025, "clutter": 0.02, "cave": 0.025, "slopes": 0.025}  # m, or 0.05
KOBUKI = 0.354  # m across
SEEDS = range(3)
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
    "slopes": 2,
}
SAMPLES = [*NAMES, *(f"{name}:{seed}" for name in DRAWN for seed in (1, 2))]
drawn = cache(builtin)  # nobody can change a world
every_world = pytest.mark.parametrize("name", SAMPLES)


def kind(name: str) -> str:
    return name.partition(":")[0]


def depth(world: World) -> Array:
    """From every free cell to the nearest wall, centre to centre, m."""
    cells: Array = ndimage.distance_transform_edt(~world.occupied)
    return cells * world.resolution_m


def shrunk(world: World, width: float) -> Mask:
    """Where the centre of a disc of this diameter (m) can be."""
    return np.asarray(depth(world) > width / 2)


def topology(free: Mask) -> tuple[int, int]:
    """Separate spaces, and loops around islands of wall."""
    return ndimage.label(free)[1], ndimage.label(~free, np.ones((3, 3)))[1] - 1


@every_world
def test_free_space_is_in_one_piece_with_the_promised_loops(name: str) -> None:
    world, _ = drawn(name)
    pieces, loops = topology(~world.occupied)
    assert (pieces, loops) == (1, LOOPS.get(kind(name), loops))


@pytest.mark.parametrize("name", [name for name in SAMPLES if kind(name) not in TIGHT])
def test_a_passage_is_wide_or_there_is_none(name: str) -> None:
    world, _ = drawn(name)
    whole = topology(~world.occupied)
    for width in (0.3, 0.6, 0.8):
        assert topology(shrunk(world, width)) == whole


@every_world
def test_the_outer_wall_is_closed_and_no_wall_is_thin(name: str) -> None:
    world, _ = drawn(name)
    walls = np.pad(world.occupied, 2, constant_values=True)
    assert np.array_equal(ndimage.binary_opening(walls, np.ones((2, 2), dtype=np.bool_)), walls)
    inner = np.pad(world.occupied[2:-2, 2:-2], 2, constant_values=True)
    assert np.array_equal(inner, world.occupied)


@every_world
def test_the_robot_fits_at_the_start(name: str) -> None:
    world, start = drawn(name)
    check_start(world, start, 0.25)


@every_world
def test_the_same_seed_draws_the_same_world(name: str) -> None:
    (first, here), (second, there) = drawn(name), builtin(name)
    assert np.array_equal(first.occupied, second.occupied)
    assert here == there
    assert {type(value) for value in (here.x, here.y, here.theta)} == {float}  # fit for any encoder
    assert (first.name, first.resolution_m) == (kind(name), RESOLUTIONS.get(kind(name), 0.05))


@pytest.mark.parametrize("name", DRAWN)
def test_another_seed_draws_another_world(name: str) -> None:
    worlds = [drawn(f"{name}:{seed}")[0] for seed in range(3)]
    for a, b in ((0, 1), (1, 2), (0, 2)):
        assert not np.array_equal(worlds[a].occupied, worlds[b].occupied)


@pytest.mark.parametrize("seed", SEEDS)
def test_narrow_corridors_are_a_metre_wide(seed: int) -> None:
    world, start = drawn(f"narrow:{seed}")
    row, column = int(start.y / 0.05), int(start.x / 0.05)
    assert 0.5 <= depth(world)[row, column] <= 0.57  # half, and at most a cell's diagonal


def test_some_doors_are_narrower_than_the_robot_and_some_are_not() -> None:
    rooms_shut, rooms_open = 0, 0
    for seed in SEEDS:
        world, _ = drawn(f"doors:{seed}")
        assert topology(~world.occupied)[0] == 1
        rooms_shut += topology(shrunk(world, KOBUKI))[0] - 1
        rooms_open += topology(shrunk(world, 1.0))[0] - topology(shrunk(world, KOBUKI))[0]
    assert rooms_shut > 0
    assert rooms_open > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_furnished_room_has_thin_legs_that_the_robot_fits_between_or_not(seed: int) -> None:
    world, _ = drawn(f"clutter:{seed}")
    boxes = ndimage.find_objects(ndimage.label(world.occupied, np.ones((3, 3)))[0])
    sides = np.array([(part.stop - part.start) * 0.02 for box in boxes for part in box])
    legs = sides[sides < 0.2]  # of two legs that touch, not more
    assert len(legs) > 100
    assert np.isin(np.rint(legs * 100), (4, 6)).mean() > 0.9
    islands, islands_to_a_robot = (
        topology(free)[1] for free in (~world.occupied, shrunk(world, KOBUKI))
    )
    assert 5 < islands_to_a_robot < islands - 10


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_on_slopes_follow_no_axis(seed: int) -> None:
    assert share_along_axes(drawn(f"slopes:{seed}")[0]) < 0.25
    assert share_along_axes(drawn(f"floor_plan:{seed}")[0]) > 0.8


@pytest.mark.parametrize("seed", SEEDS)
def test_in_the_middle_of_the_open_hall_a_short_laser_sees_nothing(seed: int) -> None:
    world, _ = drawn(f"open_hall:{seed}")
    assert depth(world).max() > 5.6
    assert topology(~world.occupied)[1] >= 6  # round the pillars


@every_world
def test_glass_is_wall_and_stands_only_in_the_world_of_that_name(name: str) -> None:
    world, _ = drawn(name)
    assert (world.glass is not None) == (kind(name) == "glass")
    if world.glass is not None:
        assert np.array_equal(world.glass & world.occupied, world.glass)
        assert 0.02 < world.glass.sum() / world.occupied.sum() < 0.3
        assert topology(~world.without_glass.occupied)[1] > topology(~world.occupied)[1]


@every_world
def test_only_the_crowd_has_people_of_its_own(name: str) -> None:
    assert (drawn(name)[0].people > 0) == (kind(name) == "crowd")


def share_along_axes(world: World) -> float:
    """The share of the walls' length whose smoothed normal is within 5 degrees of an axis."""
    smooth = ndimage.gaussian_filter((~world.occupied).astype(np.float64), 4.0)
    across, along = np.gradient(smooth)
    strength = np.hypot(across, along)
    turned = np.abs((np.rad2deg(np.arctan2(across, along)) + 45.0) % 90.0 - 45.0)
    edge = strength > 0.6 * strength.max()
    return float((turned[edge] < 5.0).mean())


def test_the_office_is_of_the_size_of_a_floor() -> None:
    world, _ = drawn("office")
    rows, columns = np.nonzero(~world.occupied)
    assert 30.0 < np.ptp(columns) * 0.05 < 40.0
    assert 18.0 < np.ptp(rows) * 0.05 < 25.0


def test_the_large_plan_covers_60_by_60_metres() -> None:
    world, _ = drawn("large_plan")
    free = np.argwhere(~world.occupied)
    assert np.ptp(free, axis=0) * 0.05 == pytest.approx([60.0, 60.0], abs=1.1)  # but outer walls


def test_a_name_opens_a_built_in_world_and_a_path_a_file(tmp_path: Path) -> None:
    world, start = open_world("rooms")
    assert start == drawn("rooms")[1]
    loaded, nowhere = open_world(str(save_world(world, tmp_path)))
    assert isinstance(loaded, World)
    assert np.array_equal(loaded.occupied, world.occupied)
    assert nowhere is None


def is_drawn(name: str) -> bool:
    """Whether any of three seeds makes another world than none, by its maker alone."""
    plain = drawn(name)[0].occupied
    others = (_MAKERS[name](seed)[0].occupied for seed in (1, 2, 3))
    return any(not np.array_equal(plain, other) for other in others)


@pytest.mark.parametrize("name", NAMES)
def test_only_a_world_that_is_drawn_takes_a_seed(name: str) -> None:
    if is_drawn(name):
        builtin(f"{name}:3")
    else:
        with pytest.raises(WorldError, match=f"{name} is always the same and takes no seed"):
            open_world(f"{name}:3")


def test_an_unknown_name_is_answered_with_the_names() -> None:
    with pytest.raises(WorldError, match="castle") as refusal:
        builtin("castle")
    with pytest.raises(WorldError, match="castle") as other_refusal:
        open_world("castle")
    with pytest.raises(WorldError, match="unknown world ''") as no_name_refusal:
        open_world("")
    for answer in map(str, (refusal.value, other_refusal.value, no_name_refusal.value)):
        assert all(name in answer for name in NAMES)


def test_an_absent_world_file_is_named() -> None:
    with pytest.raises(WorldError, match=r"absent\.yaml: no such file"):
        open_world("absent.yaml")
