"""The packaged configurations of zenoh are such."""

import json
from importlib.resources import files
from pathlib import Path

import pytest

from gvgbot.errors import UsageError
from gvgbot.zenoh_config import addresses, session_config

FILES = sorted(path.name for path in (files("gvgbot") / "configs" / "zenoh").iterdir())


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".json5")])
def test_zenoh_reads_the_file(name: str) -> None:
    session_config({}, Path(name))


@pytest.mark.parametrize(
    ("text", "listens"),
    [
        ("{}", ["tcp/127.0.0.1:7447"]),
        ('{listen: {endpoints: ["tls/0.0.0.0:7447"]}}', ["tls/0.0.0.0:7447"]),
        ('{mode: "peer", listen: {endpoints: {peer: ["tcp/[::]:9"]}}}', ["tcp/[::]:9"]),
    ],
)
def test_a_session_listens_where_the_file_says(
    text: str, listens: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "some.json5"
    path.write_text(text)
    settings = {"mode": "peer", "listen/endpoints": ["tcp/127.0.0.1:7447"]}
    assert addresses(session_config(settings, path), "listen") == listens


def test_the_router_keeps_what_robots_publish() -> None:
    config = session_config({}, Path("router.json5"))
    assert json.loads(config.get_json("mode")) == "router"
    storages = json.loads(config.get_json("plugins/storage_manager/storages"))
    assert {storage["key_expr"] for storage in storages.values()} == {
        "gvgbot/*/map",
        "gvgbot/*/state",
    }


@pytest.mark.parametrize(
    ("text", "says"),
    [("# a heading\n", "line 1, column 1"), ("{\n  mode: }\n", "line 2, column 9")],
)
def test_what_is_no_json5_is_one_line_that_says_where(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.json5"
    path.write_text(text)
    with pytest.raises(
        UsageError, match=rf"wrong\.json5 is no configuration of zenoh: {says}"
    ) as refusal:
        session_config({}, path)
    assert "\n" not in str(refusal.value)
