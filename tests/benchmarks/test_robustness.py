"""The scenarios that the table of robustness runs are tests that there are."""

import ast

import pytest

from benchmarks.figures.e10_robustness import ROOT, SCENARIOS


@pytest.mark.parametrize("test", [test for tests in SCENARIOS.values() for test in tests])
def test_every_scenario_of_the_table_is_a_test(test: str) -> None:
    path, _, name = test.partition("::")
    module = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    assert name in {part.name for part in module.body if isinstance(part, ast.FunctionDef)}
