"""What tests of whole programs are given."""

import pytest

from benchmarks.rigs.addresses import free_endpoint


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()
