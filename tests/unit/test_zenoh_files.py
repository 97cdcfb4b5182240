"""The packaged configurations of zenoh are such."""

import json
from importlib.resources import files
from pathlib import Path

import pytest

from gvgbot.errors import UsageError
from gvgbot.zenoh_config import addresses, opened, session_config

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


def with_keys(directory: Path, missing: str) -> Path:
    """A file that names a key and a certificate for every use; all but one of them are there."""
    names = [
        "root_ca_certificate",
        "listen_private_key",
        "listen_certificate",
        "connect_private_key",
        "connect_certificate",
    ]
    for name in names:
        if name != missing:
            (directory / name).write_text("")
    tls = {name: str(directory / name) for name in names} | {"enable_mtls": True}
    path = directory / "keys.json5"
    path.write_text(json.dumps({"transport": {"link": {"tls": tls}}}))
    return path


@pytest.mark.parametrize(
    ("mode", "what", "missing"),
    [
        ("client", "connect", "connect_private_key"),
        ("client", "connect", "connect_certificate"),
        ("client", "connect", "root_ca_certificate"),
        ("peer", "connect", "connect_private_key"),
        ("peer", "listen", "listen_private_key"),
        ("router", "listen", "listen_certificate"),
        ("peer", "listen", "root_ca_certificate"),
    ],
)
def test_a_key_that_is_not_there_is_named_with_what_names_it(
    mode: str, what: str, missing: str, tmp_path: Path
) -> None:
    ends: dict[str, list[str]] = {"listen": [], "connect": [], what: ["tls/localhost:9"]}
    path = with_keys(tmp_path, missing)
    settings = {"mode": mode, **{f"{end}/endpoints": at for end, at in ends.items()}}
    with pytest.raises(UsageError) as refusal:
        opened(session_config(settings, path), path)
    assert str(refusal.value) == (
        f"cannot read {tmp_path / missing}: No such file or directory; "
        f"put it there, or change {missing} in {path}"
    )


def test_passwords_that_are_not_there_are_named(tmp_path: Path) -> None:
    path, passwords = tmp_path / "words.json5", tmp_path / "passwords.txt"
    auth = {"usrpwd": {"dictionary_file": str(passwords)}}
    path.write_text(json.dumps({"mode": "client", "transport": {"auth": auth}}))
    with pytest.raises(UsageError, match=rf"cannot read {passwords}: .* dictionary_file in {path}"):
        opened(session_config({}, path), path)


def test_a_key_that_nobody_needs_may_be_missing(tmp_path: Path) -> None:
    path = with_keys(tmp_path, "connect_private_key")
    settings = {"mode": "peer", "listen/endpoints": [], "connect/endpoints": []}
    with opened(session_config(settings, path), path):
        pass
