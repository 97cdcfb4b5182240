"""A robot that is put into a building of which it has a map that somebody else has made."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.rigs.lives_rig import Lives, explored
from gvgbot.config import Config, TwinConfig
from gvgbot.drivers.kobuki.twin import KobukiTwinConfig
from gvgbot.drivers.world import save_world
from gvgbot.geometry import Pose, wrap_angle
from gvgbot.map_import import import_map
from gvgbot.maps.map_server import UNSEEN
from gvgbot.session import Session
from gvgbot.simulation import Place
from gvgbot.worlds.canvas import Canvas

pytestmark = [pytest.mark.twin, pytest.mark.slow]

FAR = (9.5, 5.5)  # the end of the long arm
START = Pose(2.6, 2.1, 0.4)


def place() -> Place:
    """Two crossings, and no two arms of one length."""
    canvas = Canvas(12.0, 9.0)
    canvas.carve_path([(1.5, 2.0), (10.0, 2.0)], 1.4)
    canvas.carve_path([(4.0, 2.0), (4.0, 7.5)], 1.4)
    canvas.carve_path([(4.0, 5.5), FAR], 1.4)
    return Place(canvas.world("flat"), START)


def test_it_finds_its_place_and_drives_where_it_is_asked_to(tmp_path: Path) -> None:
    config = Config(twin=TwinConfig(base=KobukiTwinConfig(odometry="kobuki")))
    import_map(save_world(place().world, tmp_path), tmp_path / "known", config)
    ended: list[float] = []

    def sent_away(session: Session) -> bool:
        """The map's frame is the world's: where it is asked to go can be told beforehand."""
        pipeline, here = session.pipeline, lives.world.body.pose
        if not explored(session) or pipeline.is_lost:
            return False
        if not ended:
            ended.append(pipeline.map_base.distance(here))
            ended.append(abs(wrap_angle(pipeline.map_base.theta - here.theta)))
            pipeline.errands.goto_point(*FAR, pipeline.past.keyframes[-1].stamp)
        return pipeline.errands.errand is None

    lives = Lives(config, place(), tmp_path / "run", known=tmp_path / "known", over=sent_away)
    last = lives.run([])
    assert last.pipeline.mission.outcome == "explored"
    assert ended[0] < 0.15
    assert ended[1] < 0.05
    assert math.dist((lives.world.body.pose.x, lives.world.body.pose.y), FAR) < 0.3
    assert lives.world.body.contacts == 0
    estimate = np.loadtxt(tmp_path / "run" / "estimate.tum")
    seen_s = np.asarray(Image.open(tmp_path / "run" / "seen.png"))
    known = np.asarray(Image.open(tmp_path / "run" / "map.pgm")) != UNSEEN
    assert seen_s[known].min() == 0
    assert 0 < seen_s[known].max() <= estimate[-1, 0] - estimate[0, 0]  # a film shows all of it
