"""World files: what map_server's rules say of a pixel, and what is said of a user's mistake."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import structlog
import yaml
from PIL import Image

from gvgbot.drivers.world import World, load_map, load_world, save_world
from gvgbot.errors import WorldError

ENTRIES: dict[str, Any] = {
    "image": "plan.png",
    "resolution": 0.05,
    "origin": [-1.5, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write(directory: Path, pixels: Any, **changes: Any) -> Path:
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(directory / "plan.png")
    path = directory / "plan.yaml"
    path.write_text(yaml.safe_dump(ENTRIES | changes))
    return path


def test_a_pixel_is_a_wall_where_its_occupancy_exceeds_the_threshold(tmp_path: Path) -> None:
    # (255 - grey) / 255 > 0.65 holds up to a grey of 89.25; unknown is saved as 205
    world = load_world(write(tmp_path, [[0, 89, 90, 205, 254, 255]]))
    assert world.occupied.tolist() == [[True, True, False, False, False, False]]


def test_what_a_map_does_not_know_is_wall_if_that_is_wanted(tmp_path: Path) -> None:
    # unknown is what lies between 0.196, a grey of 205.02, and 0.65, one of 89.25
    path = write(tmp_path, [[0, 89, 90, 205, 206, 255]])
    world = load_world(path, unknown_is_wall=True)
    assert world.occupied.tolist() == [[True, True, True, True, False, False]]


def test_negate_makes_bright_pixels_walls(tmp_path: Path) -> None:
    # grey / 255 > 0.65 holds from 165.75 on
    world = load_world(write(tmp_path, [[0, 165, 166, 255]], negate=1))
    assert world.occupied.tolist() == [[False, False, True, True]]


def test_the_threshold_itself_is_no_wall(tmp_path: Path) -> None:
    # (255 - 204) / 255 = 0.2
    world = load_world(write(tmp_path, [[204, 203]], occupied_thresh=0.2, free_thresh=0.1))
    assert world.occupied.tolist() == [[False, True]]


def test_colours_count_by_their_plain_mean(tmp_path: Path) -> None:
    # one full channel gives a mean of 85, which is a wall; two give 170, which is not
    pixels = [[[0, 255, 0], [0, 0, 255], [255, 255, 0]]]
    assert load_world(write(tmp_path, pixels)).occupied.tolist() == [[True, True, False]]


@pytest.mark.parametrize("pixels", [[0, 205, 254], [205, 205, 254], [0, 205, 205], [205] * 3])
def test_the_unknown_that_map_saver_wrote_is_not_free_whatever_it_wrote_beside_it(
    tmp_path: Path, pixels: list[int]
) -> None:
    # 205 is an occupancy of 0.196; a free_thresh of 0.25 was the default of Nav2
    path = write(tmp_path, [pixels], free_thresh=0.25, mode="trinary")
    with structlog.testing.capture_logs() as logs:
        world, known = load_map(path)
    assert world.occupied.tolist() == [[grey == 0 for grey in pixels]]
    assert known.tolist() == [[grey != 205 for grey in pixels]]
    (warning,) = logs
    assert warning["event"] == "grey 205 is unknown, not free"
    assert (warning["path"], warning["free_thresh"]) == (str(path), 0.25)


@pytest.mark.parametrize(
    ("pixels", "changes", "known"),
    [
        ([0, 205, 254, 206], {"free_thresh": 0.25}, [True, True, True, True]),  # painted otherwise
        ([0, 205, 254], {"free_thresh": 0.25, "mode": "scale"}, [True, True, True]),
        ([0, 205, 254], {"free_thresh": 0.25, "negate": 1}, [True, True, True]),
        ([0, 205, 254], {}, [True, False, True]),
        ([0, 254], {"free_thresh": 0.25}, [True, True]),
    ],
)
def test_other_maps_mean_what_they_say(
    tmp_path: Path, pixels: list[int], changes: dict[str, Any], known: list[bool]
) -> None:
    path = write(tmp_path, [pixels], **changes)
    with structlog.testing.capture_logs() as logs:
        assert load_map(path)[1].tolist() == [known]
    assert not logs


CLEAR = [[[255, 255, 255, 0], [255, 255, 255, 255], [0, 0, 0, 0], [0, 0, 0, 255], [0, 0, 0, 254]]]


def test_transparency_counts_as_a_colour_in_trinary_mode(tmp_path: Path) -> None:
    # the means are 191.25, 255, 0, 63.75 and 63.5: a quarter is unknown, three quarters are a wall
    world, known = load_map(write(tmp_path, CLEAR))
    assert world.occupied.tolist() == [[False, False, True, True, True]]
    assert known.tolist() == [[False, True, True, True, True]]


def test_what_is_not_opaque_is_unknown_in_scale_mode(tmp_path: Path) -> None:
    world, known = load_map(write(tmp_path, CLEAR, mode="scale"))
    assert world.occupied.tolist() == [[False, False, False, True, False]]
    assert known.tolist() == [[False, True, False, True, False]]


def transparent_grey() -> Image.Image:
    """Free, and what is transparent."""
    return Image.fromarray(np.array([[[254, 255], [254, 0]]], dtype=np.uint8), "LA")


def transparent_palette() -> Image.Image:
    picture = Image.new("P", (2, 1))
    picture.putpalette([254, 254, 254, 253, 253, 253])
    picture.putpixel((1, 0), 1)
    picture.info["transparency"] = 1
    return picture


def transparent_shade() -> Image.Image:
    picture = Image.fromarray(np.array([[254, 253]], dtype=np.uint8))
    picture.info["transparency"] = 253
    return picture


@pytest.mark.parametrize("mode", ["trinary", "scale"])
@pytest.mark.parametrize("made", [transparent_grey, transparent_palette, transparent_shade])
def test_every_form_of_transparent_png_is_read(
    tmp_path: Path, made: Callable[[], Image.Image], mode: str
) -> None:
    path = write(tmp_path, [[0]], mode=mode)
    made().save(tmp_path / "plan.png")
    world, known = load_map(path)
    assert world.occupied.tolist() == [[False, False]]
    assert known.tolist() == [[True, False]]


def test_the_last_image_row_is_the_lowest_and_lies_at_the_origin(tmp_path: Path) -> None:
    world = load_world(write(tmp_path, [[255, 255], [255, 255], [0, 255]]))
    assert world.occupied.tolist() == [[True, False], [False, False], [False, False]]
    assert (world.resolution_m, world.origin, world.name) == (0.05, (-1.5, 2.0), "plan")
    assert world.extent == pytest.approx((-1.5, 2.0, -1.4, 2.15))


@pytest.mark.parametrize(
    "content",
    [
        b"P5\n# by hand\n3 2\n255\n" + bytes([0, 255, 255, 255, 255, 0]),
        b"P2\n3 2\n255\n0 255 255\n255 255 0\n",
        b"P5\n3 2\n65535\n" + b"\x50\0" + b"\xff\xff" * 4 + b"\0\0",
    ],
    ids=["binary", "plain", "sixteen bits"],
)
def test_every_form_of_pgm_is_read(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "plan.pgm").write_bytes(content)
    world = load_world(write(tmp_path, [[0]], image="plan.pgm"))
    assert world.occupied.tolist() == [[False, False, True], [True, False, False]]


def test_an_image_may_lie_anywhere(tmp_path: Path) -> None:
    elsewhere = tmp_path / "maps"
    elsewhere.mkdir()
    path = write(elsewhere, [[0, 255]], image=str(elsewhere / "plan.png"))
    moved = path.rename(tmp_path / "here.yaml")
    assert load_world(moved).occupied.tolist() == [[True, False]]


def test_a_saved_world_is_loaded_as_it_was(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    world = World(rng.random((17, 29)) < 0.5, 0.0374813, (-3.25, 0.1), "attic")
    loaded = load_world(save_world(world, tmp_path / "new" / "folder"))
    assert np.array_equal(loaded.occupied, world.occupied)
    assert (loaded.resolution_m, loaded.origin, loaded.name) == (0.0374813, (-3.25, 0.1), "attic")


def test_a_saved_world_is_what_map_server_reads(tmp_path: Path) -> None:
    path = save_world(World(np.array([[True, False], [False, False]]), 0.05), tmp_path)
    entries = yaml.safe_load(path.read_text())
    assert set(entries) == set(ENTRIES)
    assert entries["origin"] == [0.0, 0.0, 0.0]
    grey = np.asarray(Image.open(tmp_path / entries["image"]))
    assert grey.dtype == np.uint8
    assert grey.tolist() == [[254, 254], [0, 254]]


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("resolution", None, "number"),
        ("resolution", "5 cm", "number"),
        ("resolution", True, "number"),
        ("resolution", float("nan"), "number"),
        pytest.param("resolution", 10**400, "number", id="a number beyond floats"),
        ("resolution", 0, "from 0.0001 to 10"),
        ("resolution", -0.05, "from 0.0001 to 10"),
        ("resolution", 1e300, "from 0.0001 to 10"),
        ("origin", [0.0, 0.0], "three numbers"),
        ("origin", [0.0, 0.0, "north"], "three numbers"),
        ("origin", 0.0, "three numbers"),
        ("origin", [0.0, 0.0, 0.5], "yaw must be 0"),
        ("origin", [0.0, -1e300, 0.0], "must be within"),
        ("negate", "no", "0 or 1"),
        ("negate", [], "0 or 1"),
        ("occupied_thresh", 65, "from 0 to 1"),
        ("occupied_thresh", "high", "number"),
        ("free_thresh", -0.1, "from 0 to 1"),
        ("image", 7, "file name"),
        ("image", "absent.png", "no such file"),
        ("image", ".", "cannot read"),
        ("image", "plan.yaml", "not an image"),
        ("mode", "raw", "trinary"),
    ],
)
def test_a_bad_value_is_named_with_its_file_and_key(
    tmp_path: Path, key: str, value: object, complaint: str
) -> None:
    path = write(tmp_path, [[0, 255]], **{key: value})
    with pytest.raises(WorldError, match=complaint) as refusal:
        load_world(path)
    assert str(refusal.value).startswith(f"{path}: key {key}: ")
    assert "\n" not in str(refusal.value)


def test_an_image_too_large_to_be_opened_shall_be_made_smaller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, [[0, 255, 255]])
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1)
    with pytest.raises(WorldError, match="million pixels: make it smaller"):
        load_world(path)


def test_powers_of_ten_without_a_point_are_numbers_as_they_are_for_ros(tmp_path: Path) -> None:
    path = write(tmp_path, [[0, 255]])
    path.write_text("image: plan.png\nresolution: 5e-2\norigin: [-1e-05, 2E0, 0e0]\n")
    world = load_world(path)
    assert (world.resolution_m, world.origin) == (0.05, (-1e-05, 2.0))


@pytest.mark.parametrize("key", ["image", "resolution", "origin"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    path = write(tmp_path, [[0, 255]])
    path.write_text(yaml.safe_dump({k: v for k, v in ENTRIES.items() if k != key}))
    with pytest.raises(WorldError, match=f"{re.escape(str(path))}: key {key}: missing"):
        load_world(path)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"image: [plan.png\nresolution: 1", "not valid YAML"),
        (b"- image\n- resolution\n", "key: value"),
        (b"", "key: value"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "cannot be read as text"),
        (b"image: a\n\x00", "not valid YAML"),
        (b"image: a\nresolution: 2001-99-99\n", "not valid YAML"),
        (b"image: " + b"[" * 1000, "not valid YAML"),
        (b"resolution: 0.05\nresolution: 0.1\n", "line 2, column 1: the key resolution is given"),
    ],
)
def test_a_file_that_is_no_world_is_named(tmp_path: Path, content: bytes, complaint: str) -> None:
    path = tmp_path / "world.yaml"
    path.write_bytes(content)
    with pytest.raises(WorldError, match=complaint) as refusal:
        load_world(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="no such file"):
        load_world(tmp_path / "absent.yaml")
    with pytest.raises(WorldError, match="cannot read the file: Is a directory"):
        load_world(tmp_path)


def test_of_a_run_its_map_is_proposed(tmp_path: Path) -> None:
    (tmp_path / "map.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    with pytest.raises(WorldError, match="not a map_server file; a world is such a YAML file"):
        load_world(tmp_path / "map.geojson")
    (tmp_path / "map.yaml").touch()
    for path in (tmp_path, tmp_path / "map.geojson"):
        with pytest.raises(WorldError, match=f"; give {tmp_path / 'map.yaml'}$"):
            load_world(path)


def test_a_truncated_image_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, np.random.default_rng(1).integers(0, 255, (60, 60)))
    image = tmp_path / "plan.png"
    image.write_bytes(image.read_bytes()[:900])
    with pytest.raises(WorldError, match="key image: cannot read"):
        load_world(path)


def test_an_image_that_would_fill_the_memory_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = write(tmp_path, CLEAR)
    Image.new("1", (8000, 8000), 1).save(tmp_path / "plan.png")
    with pytest.raises(WorldError, match="64000000 pixels, and 60 million at most"):
        load_world(path)
