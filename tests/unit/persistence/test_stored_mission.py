"""A mission that was stored in version 1 can be read for ever.

`tests/data/mission_v1` was left by a robot that had driven from a dead end to the ring of
`tests.replay.test_pipeline.LOLLIPOP`, some 5 m, and was killed after 14 s.
"""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.memory import growth, recall
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import load_config
from gvgbot.geometry import Pose
from gvgbot.persistence.mission_files import JOURNAL, MissionFiles
from gvgbot.persistence.mission_state import Batch, Saved, rows
from gvgbot.persistence.records import packed

MISSION = Path(__file__).parents[2] / "data" / "mission_v1"
START = Pose(-3.5, -0.1, 0.2)  # world_map
ENDPOINT = (-5.0, 0.0)  # as far from the end of a corridor 2 m wide as from its sides
MEETPOINT = (0.0, 0.25)  # as far from the corners (-1, 1) and (1, 1) as from the wall at y = -1


def read(path: Path) -> Saved:
    found = MissionFiles(path).read()
    assert found is not None
    return found


@pytest.fixture
def saved() -> Saved:
    return read(MISSION)


def test_a_mission_of_version_1_is_read_whole(saved: Saved) -> None:
    assert len(saved.past) > 20
    assert saved.past[0].step is None
    assert all(grown.step is not None for grown in saved.past[1:])
    assert 13.0 < saved.beat.stamp < 14.5
    assert saved.beat.odometer is not None
    assert len(saved.journey.stamps) == pytest.approx(10 * saved.beat.stamp, rel=0.1)
    scans = [grown.keyframe.scan for grown in saved.past if grown.keyframe.scan is not None]
    assert {len(scan.unpacked().ranges) for scan in scans} == {1081}


def recalled(saved: Saved) -> Pipeline:
    config = load_config()
    pipeline = Pipeline(config.autonomy, config.exploration, config.robot.radius_m)
    recall(pipeline, saved.memory, saved.past)
    return pipeline


def test_a_mind_that_recalls_it_has_the_map_of_that_place(saved: Saved) -> None:
    pipeline = recalled(saved)
    vertices = pipeline.mapper.graph.vertices.values()
    assert {vertex.kind for vertex in vertices} == {"meetpoint", "endpoint"}
    assert len(pipeline.mapper.graph.edges) == 1
    assert len(pipeline.mapper.graph.frontiers()) == 2
    estimate = smoothed(pipeline)
    for vertex in vertices:
        place = START.compose(estimate.vertices[vertex.id])
        wanted = MEETPOINT if vertex.kind == "meetpoint" else ENDPOINT
        assert math.dist((place.x, place.y), wanted) < 0.1
    walls = START.transform(pipeline.tracker.maps.near.points())
    stem = walls[(walls[:, 0] > -5.5) & (walls[:, 0] < -1.5)]
    assert len(stem) > 50
    assert np.abs(np.abs(stem[:, 1]) - 1.0).max() < 0.1


@pytest.mark.parametrize("kept", [0, 100_000])
def test_what_is_written_after_a_journal_was_cut_follows_the_old_snapshot(
    saved: Saved, tmp_path: Path, kept: int
) -> None:
    """As when the disk has no room for a new snapshot before the robot ends once more."""
    shutil.copytree(MISSION, tmp_path, dirs_exist_ok=True)
    journal = (tmp_path / JOURNAL).read_bytes()
    (tmp_path / JOURNAL).write_bytes(journal[:kept])
    files = MissionFiles(tmp_path)
    cut = files.read()
    assert cut is not None
    first, younger = len(cut.past), saved.past[saved.memory.keyframes :]
    grown = growth(recalled(cut), first) + younger
    no_rows = rows(saved.journey, len(saved.journey.stamps))
    batch = Batch(first=first, growth=grown, rows=no_rows, beat=saved.beat)
    files.append(packed(batch), sync=True)
    pipeline, whole = recalled(read(tmp_path)), recalled(saved)
    assert len(pipeline.past.keyframes) == first + 1 + len(younger)
    assert pipeline.mapper.belief.map_base == whole.mapper.belief.map_base
    assert pipeline.past.travelled == whole.past.travelled
