"""What all our zenoh sessions have in common, and what zenoh's errors mean."""

import json
import re
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import msgspec
import zenoh

from gvgbot.errors import UsageError

_COMMON: Mapping[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast/open_timeout": 2000,  # ms; closing waits for it if the other end is frozen
    # silent ones keep others out, and 1,024 are all the files that a service may have open
    "transport/unicast/accept_pending": 300,
    "connect/retry": {
        "period_init_ms": 100,
        "period_max_ms": 1000,
        "period_increase_factor": 2,
    },
}


def session_config(settings: Mapping[str, object], file: Path | None = None) -> zenoh.Config:
    """A configuration: addresses are told, not found by shouting, and tried again when lost.

    What a file (JSON5) sets stands, and the settings fill the rest, as also what it sets to zenoh's
    default; a name without a folder means the file in the working directory, or else the packaged
    one. Raises UsageError for a file that cannot be used.
    """
    plain = zenoh.Config()
    config = zenoh.Config() if file is None else _read(file)
    for key, value in {**_COMMON, **settings}.items():
        if config.get_json(key) == plain.get_json(key):
            config.insert_json5(key, msgspec.json.encode(value).decode())
    return config


def addresses(config: zenoh.Config, what: Literal["listen", "connect"]) -> list[str]:
    """Where a session of a configuration listens, or connects to."""
    found = json.loads(config.get_json(f"{what}/endpoints"))
    if isinstance(found, dict):  # for each mode its own
        found = found.get(json.loads(config.get_json("mode")))
    return found or []


def opened(config: zenoh.Config, file: Path | None = None) -> zenoh.Session:
    """A session; `file` is the one that the configuration was read from.

    Raises UsageError for a key or certificate that cannot be read, zenoh.ZError if the session
    cannot be opened.
    """
    for name, path in _files(config):
        try:
            Path(path).open("rb").close()
        except OSError as error:
            raise UsageError(
                f"cannot read {path}: {error.strerror}; put it there, or change "
                f"{name} in {file or 'the configuration of zenoh'}"
            ) from error
    return zenoh.open(config)


def has_listener(publisher: zenoh.Publisher) -> bool:
    """Whether anybody listens to a publisher just now."""
    status: Any = publisher.matching_status  # no bool, whatever zenoh's types say
    return bool(status.matching)


def _files(config: zenoh.Config) -> Iterator[tuple[str, str]]:
    """The files that a session of a configuration needs, after what names them."""
    tls = json.loads(config.get_json("transport/link/tls"))
    listens = json.loads(config.get_json("mode")) != "client" and _has_tls(config, "listen")
    connects = _has_tls(config, "connect")
    needed = {
        "root_ca_certificate": connects or (listens and tls["enable_mtls"]),
        "listen_private_key": listens,
        "listen_certificate": listens,
        "connect_private_key": connects and tls["enable_mtls"],
        "connect_certificate": connects and tls["enable_mtls"],
    }
    yield from ((name, tls[name]) for name, is_needed in needed.items() if is_needed and tls[name])
    passwords = json.loads(config.get_json("transport/auth/usrpwd/dictionary_file"))
    if passwords:
        yield "dictionary_file", passwords


def _has_tls(config: zenoh.Config, what: Literal["listen", "connect"]) -> bool:
    """Whether an address needs the files that are named for all of its kind, and not its own."""
    return any(
        address.startswith(("tls/", "quic/")) and "#" not in address
        for address in addresses(config, what)
    )


def _read(file: Path) -> zenoh.Config:
    inside = Path(str(files("gvgbot") / "configs" / "zenoh")) / file.name
    if file.name == str(file) and not file.exists() and inside.exists():
        file = inside
    try:
        return zenoh.Config.from_json5(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        what = getattr(error, "strerror", None) or "it is no text"
        raise UsageError(f"cannot read {file}: {what}") from error
    except zenoh.ZError as error:
        raise UsageError(f"{file} is no configuration of zenoh: {reason(error)}") from error


def reason(error: zenoh.ZError) -> str:
    """What the library says is wrong, without the places in its own source."""
    if "already in use" in str(error):
        return "the address is already in use, perhaps by another gvgbot"
    if at := re.search(r"--> (\d+):(\d+)[\s\S]*= (.*)", str(error)):  # what the JSON5 parser says
        return f"line {at[1]}, column {at[2]}: {at[3]}"
    found = re.search(r"\[([^\]]*)\]", str(error))
    return re.sub(r" at /\S+", "", found.group(1) if found else str(error)).strip(". ")
