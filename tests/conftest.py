"""Settings of every test: the same examples on every machine, however busy it is."""

import signal
from collections.abc import Iterator

import pytest
import structlog
from hypothesis import settings

settings.register_profile("dev", max_examples=50, derandomize=True, deadline=None, database=None)
settings.register_profile("ci", max_examples=500, derandomize=True, deadline=None, database=None)
settings.load_profile("dev")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--laser-port", help="a real laser's port, for -m hardware")
    parser.addoption("--base-port", help="a real base's port, for -m hardware")


def pytest_configure() -> None:
    """Let programs that are started hear of a stop, though a script has it ignored here."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True)
def _ctrl_c_is_heard() -> Iterator[None]:
    """A command that was interrupted ignores it in the end, and so would programs started later."""
    yield
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _fresh_log() -> Iterator[None]:
    """A command sets up the log for its process; the next test starts from nothing."""
    yield
    structlog.reset_defaults()
