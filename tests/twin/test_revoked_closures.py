"""A robot one of whose closures is taken back while it explores maps the building all the same."""

import json
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.score_run import score_run
from gvgbot.autonomy.events import Event
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.unsettled import Unsettled
from tests.twin.test_explore import explore, four_blocks

pytestmark = [pytest.mark.slow, pytest.mark.twin]

AFTER = 20  # keyframes at least, a closure is taken back


def test_what_was_found_since_is_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    close, revoke, views = Unsettled.note_closure, Unsettled.revoke, Counter[str]()

    def close_revocably(self: Unsettled, vertex: Vertex, *, is_surprising: bool) -> None:
        close(self, vertex, is_surprising=True)

    def revoke_at_times(self: Unsettled, stamp: float) -> list[Event]:
        views["since"] += 1
        if self._revocable is not None and views["since"] >= AFTER and not views["bad"]:
            views["bad"] = 1
            self._revocable.is_contradicted = True
        return revoke(self, stamp)

    monkeypatch.setattr(Unsettled, "note_closure", close_revocably)
    monkeypatch.setattr(Unsettled, "revoke", revoke_at_times)
    run = explore(four_blocks(), tmp_path, "--seed", "1")
    assert run.status == 0
    happened = Counter(
        json.loads(line)["event"] for line in (run.path / "events.jsonl").read_text().splitlines()
    )
    assert happened["closure_revoked"] == 1
    score = score_run(run.path)
    assert score["recall"] == score["precision"] == score["edge_recall"] == 1.0
