"""The packaged configurations of zenoh are such."""

import json
from importlib.resources import files
from pathlib import Path

import pytest

from gvgbot.zenoh_config import session_config

FILES = sorted(path.name for path in (files("gvgbot") / "configs" / "zenoh").iterdir())


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".json5")])
def test_zenoh_reads_the_file(name: str) -> None:
    session_config({}, Path(name))


def test_the_router_keeps_what_robots_publish() -> None:
    config = session_config({}, Path("router.json5"))
    assert json.loads(config.get_json("mode")) == "router"
    storages = json.loads(config.get_json("plugins/storage_manager/storages"))
    assert {storage["key_expr"] for storage in storages.values()} == {
        "gvgbot/*/map",
        "gvgbot/*/state",
    }
