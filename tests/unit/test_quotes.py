"""README and docs quote the results that are in the repository, and no others."""

import re
from pathlib import Path

import pytest

from docs.make_tables import ROOT, filled, pages

PAGES = list(pages())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_quotes_the_results_as_they_are(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert filled(text) == text, "run make pages"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_quote_has_an_end(page: Path) -> None:
    marks = re.findall(r"^<!-- (from:|end)", page.read_text(encoding="utf-8"), re.M)
    assert marks == ["from:", "end"] * (len(marks) // 2)


def test_a_number_that_somebody_changed_is_set_right() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    wrong = text.replace("explored: no frontier is left; 21", "explored: no frontier is left; 22")
    assert wrong != text
    assert filled(wrong) == text


def test_what_is_around_a_quote_stays() -> None:
    head = "<!-- from: benchmarks/results/worlds.jsonl (last_words ring runs/x) -->"
    around = f"before\n{head}\n<!-- end -->\nafter\n"
    before, quote, after = re.split(f"{re.escape(head)}|<!-- end -->", filled(around))
    assert (before, after) == ("before\n", "\nafter\n")
    assert "picture: runs/x/map.png" in quote
