"""Why the page's server cannot listen, in words."""

import errno

import pytest

from gvgbot.web.server import _why


@pytest.mark.parametrize(
    ("error", "named"),
    [
        (OSError(errno.EADDRNOTAVAIL, "error while attempting to bind"), "no such address"),
        (OSError("could not bind on any address out of [('192.0.2.1', 8080)]"), "no such address"),
        (OSError(errno.EADDRINUSE, "error while attempting to bind"), "the port is taken"),
        (OSError(errno.EACCES, "error while attempting to bind"), "only root may have that port"),
        (OSError(errno.ENOBUFS, "No buffer space available"), "No buffer space available"),
    ],
)
def test_a_missing_address_is_told_whichever_python_says_so(error: OSError, named: str) -> None:
    """Of the first two, Python 3.11 raises the one with a number, Python 3.13 the other one."""
    assert named in _why(error)
