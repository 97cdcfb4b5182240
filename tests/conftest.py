"""Settings of every test: the same examples on every machine, however busy it is."""

import pytest
from hypothesis import settings

settings.register_profile("dev", max_examples=50, derandomize=True, deadline=None, database=None)
settings.register_profile("ci", max_examples=500, derandomize=True, deadline=None, database=None)
settings.load_profile("dev")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--laser-port", help="a real laser's port, for -m hardware")
    parser.addoption("--base-port", help="a real base's port, for -m hardware")
