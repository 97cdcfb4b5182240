"""Scan requests as text: which lengths there are, and which steps."""

import pytest

from gvgbot.drivers.hokuyo.scip_messages import ScanRequest, parse_request


@pytest.mark.parametrize(
    ("echo", "request_"),
    [
        (b"GD0044072501", ScanRequest("GD", 44, 725, 1)),
        (b"MD0044072501205", ScanRequest("MD", 44, 725, 1, 2, 5)),
        (b"MD0044004401000", ScanRequest("MD", 44, 44, 1)),
    ],
    ids=["single", "stream", "one step"],
)
def test_a_request_is_what_its_text_says(echo: bytes, request_: ScanRequest) -> None:
    assert parse_request(echo) == request_
    assert request_.text().encode() == echo


@pytest.mark.parametrize(
    "echo",
    [b"GD0044072501205", b"MD0044072501", b"MD0725004401000", b"XD0044072501", b""],
    ids=["single with a count", "stream without one", "backwards", "unknown", "nothing"],
)
def test_anything_else_is_none(echo: bytes) -> None:
    assert parse_request(echo) is None
