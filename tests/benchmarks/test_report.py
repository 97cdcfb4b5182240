"""Measurements beside their targets, and the page that shows them."""

import pytest

from benchmarks.report import Measured
from docs.make_benchmarks import _row


@pytest.mark.parametrize(
    ("figure", "cells"),
    [
        (Measured("a", 3.0, "ms", at_most=4.0), ("a", "3 ms", "at most 4", "0.75", "")),
        (Measured("b", 5.0, "ms", at_most=4.0), ("b", "5 ms", "at most 4", "1.25", "**missed**")),
        (Measured("c", 30.0, "Hz", at_least=40.0),
         ("c", "30 Hz", "at least 40", "0.75", "**missed**")),
        (Measured("d", 50.0, "Hz", at_least=40.0), ("d", "50 Hz", "at least 40", "1.25", "")),
        (Measured("e", 50.0, "MB"), ("e", "50 MB", "", "", "")),
    ],
    ids=["below", "above", "too slow", "fast enough", "without a target"],
)  # fmt: skip
def test_a_figure_stands_beside_its_target(figure: Measured, cells: tuple[str, ...]) -> None:
    assert _row(figure) == cells
