"""What all our zenoh sessions have in common, and what zenoh's errors mean."""

import re
from collections.abc import Mapping

import msgspec
import zenoh

_COMMON: Mapping[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast/open_timeout": 2000,  # ms; closing waits for it if the other end is frozen
    "connect/retry": {
        "period_init_ms": 100,
        "period_max_ms": 1000,
        "period_increase_factor": 2,
    },
}


def session_config(settings: Mapping[str, object]) -> zenoh.Config:
    """A configuration: addresses are told, not found by shouting, and tried again when lost."""
    config = zenoh.Config()
    for key, value in {**_COMMON, **settings}.items():
        config.insert_json5(key, msgspec.json.encode(value).decode())
    return config


def reason(error: zenoh.ZError) -> str:
    """What the library says is wrong, without the places in its own source."""
    if "already in use" in str(error):
        return "the address is already in use, perhaps by another gvgbot"
    found = re.search(r"\[([^\]]*)\]", str(error))
    return re.sub(r" at /\S+", "", found.group(1) if found else str(error)).strip(". ")
