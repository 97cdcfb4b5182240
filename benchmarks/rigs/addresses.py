"""Addresses on this machine that nobody listens on, and routers at them."""

import json
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import zenoh

PORTS = range(20_000, 32_000)  # below those that connections get of the system, meanwhile


def free_endpoint() -> str:
    """One that others, who choose one at the same time, hardly choose as well."""
    while True:
        port = secrets.choice(PORTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return f"tcp/127.0.0.1:{port}"


@contextmanager
def router(endpoint: str) -> Iterator[zenoh.Session]:
    with zenoh.open(_config({"mode": "router", "listen/endpoints": [endpoint]})) as session:
        yield session


@contextmanager
def plain_session(endpoint: str, *, patience_s: float = 0.0) -> Iterator[zenoh.Session]:
    """A program on the network that knows nothing of us; it waits until somebody is there."""
    timeout_ms = round(1e3 * patience_s)
    settings = {"connect/endpoints": [endpoint], "connect/timeout_ms": timeout_ms}
    with zenoh.open(_config({"mode": "client", **settings})) as session:
        yield session


def _config(settings: dict[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in {**settings, "scouting/multicast/enabled": False}.items():
        config.insert_json5(key, json.dumps(value))
    return config
