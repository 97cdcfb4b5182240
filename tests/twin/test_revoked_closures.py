"""A robot whose closures are taken back while it explores maps the building all the same."""

import json
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.score_run import score_run
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.unsettled import Unsettled
from gvgbot.cli import main

pytestmark = [pytest.mark.slow, pytest.mark.twin, pytest.mark.timeout(120)]

EVERY, AT_MOST = 40, 2  # keyframes at least between closures that are taken back, and how many are


def test_what_was_found_since_is_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    close, revoke, views = Unsettled.note_closure, Unsettled.revoke, Counter[str]()

    def close_revocably(self: Unsettled, vertex: Vertex, *, is_surprising: bool) -> None:
        close(self, vertex, is_surprising=True)

    def revoke_at_times(self: Unsettled, stamp: float) -> list[Event]:
        views["since"] += 1
        if self._revocable is not None and views["since"] >= EVERY and views["bad"] < AT_MOST:
            views["bad"], views["since"] = views["bad"] + 1, 0
            self._revocable.is_contradicted = True
        return revoke(self, stamp)

    monkeypatch.setattr(Unsettled, "note_closure", close_revocably)
    monkeypatch.setattr(Unsettled, "revoke", revoke_at_times)
    out = tmp_path / "run"
    assert main(["explore", "--world", "slopes", "--seed", "1", "--out", str(out)]) == 0
    happened = Counter(
        json.loads(line)["event"] for line in (out / "events.jsonl").read_text().splitlines()
    )
    assert happened["closure_revoked"] == AT_MOST
    score = score_run(out)
    assert score["recall"] == score["precision"] == score["edge_recall"] == 1.0
