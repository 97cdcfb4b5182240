"""Messages that are well-formed and wrong, as of another program: refused before they are used."""

import zlib
from collections.abc import Mapping

import msgspec
import pytest

from gvgbot.client.newest import decoded
from gvgbot.errors import GvgbotError
from gvgbot.tiles import Grid, Tile
from gvgbot.topics import GRID, MAP, PLAN, SCAN, STATE, TRAJECTORY, Topic
from tests.unit.test_telemetry import EXAMPLE

STATE_FIELDS = msgspec.to_builtins(EXAMPLE)
EDGE = {"start": 1, "end": 2, "length": 1.0, "points": bytes(16)}
MAP_FIELDS = {"stamp": 1.0, "vertices": [], "edges": [EDGE]}
WAY = {"stamp": 1.0, "stamps": bytes(16), "poses": bytes(24)}
PLAN_FIELDS = {
    "stamp": 1.0,
    "vertex": 7,
    "bearing": None,
    "reason": "ear",
    "track": bytes(8),
    "route": bytes(8),
}
GRID_FIELDS = {
    "stamp": 1.0,
    "began": 1.0,
    "number": 1,
    "resolution": 0.05,
    "side": 4,
    "tiles": [],
}
SCAN_FIELDS = {
    "stamp": 1.0,
    "time_increment": 0.0,
    "angle_min": 0.0,
    "angle_increment": 0.1,
    "range_max": 5.6,
    "base_laser": [0.0, 0.0, 0.0],
    "map_base": None,
    "ranges": bytes(4),
}
WHOLE = [
    (STATE, STATE_FIELDS),
    (MAP, MAP_FIELDS),
    (TRAJECTORY, WAY),
    (PLAN, PLAN_FIELDS),
    (GRID, GRID_FIELDS),
    (SCAN, SCAN_FIELDS),
]


def read(topic: Topic, fields: Mapping[str, object]) -> object:
    return decoded(topic, topic.payload, topic.encoding, msgspec.msgpack.encode(fields))


@pytest.mark.parametrize(("topic", "fields"), WHOLE)
def test_whole_samples_are_read(topic: Topic, fields: Mapping[str, object]) -> None:
    assert isinstance(read(topic, fields), topic.payload)


@pytest.mark.parametrize(
    ("topic", "fields"),
    [
        (STATE, {**STATE_FIELDS, "covariance": []}),
        (STATE, {**STATE_FIELDS, "covariance": [1.0] * 10}),
        (MAP, {**MAP_FIELDS, "edges": [{**EDGE, "points": bytes(5)}]}),
        (TRAJECTORY, {**WAY, "poses": bytes(23)}),
        (TRAJECTORY, {**WAY, "stamps": bytes(15)}),
        (TRAJECTORY, {**WAY, "stamps": bytes(24)}),
        (PLAN, {**PLAN_FIELDS, "track": bytes(3)}),
        (PLAN, {**PLAN_FIELDS, "route": bytes(12)}),
        (GRID, {**GRID_FIELDS, "side": 0}),
        (GRID, {**GRID_FIELDS, "side": 10**6}),
        (SCAN, {**SCAN_FIELDS, "ranges": bytes(3)}),
    ],
)
def test_parts_of_values_are_refused_in_words(topic: Topic, fields: Mapping[str, object]) -> None:
    with pytest.raises(GvgbotError, match=f"a damaged sample of {topic.name}: "):
        read(topic, fields)


@pytest.mark.parametrize(
    ("columns", "cells"),
    [
        pytest.param((0,), b"no zlib", id="no-zlib"),
        pytest.param((0,), zlib.compress(bytes(15)), id="too-few"),
        pytest.param((0,), zlib.compress(bytes(10**7)), id="too-many"),
        pytest.param((0, 10**9), zlib.compress(bytes(16)), id="too-far-apart"),
    ],
)
def test_damaged_tiles_are_a_value_error(columns: tuple[int, ...], cells: bytes) -> None:
    tiles = tuple(Tile(column=column, row=column, cells=cells) for column in columns)
    grid = Grid(stamp=1.0, began=1.0, number=1, resolution=0.05, side=4, tiles=tiles)
    with pytest.raises(ValueError, match=r"damaged tile|no building's"):
        grid.raster()
