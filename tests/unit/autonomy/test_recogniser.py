"""How a vertex that was seen before is looked for where it should be."""

import numpy as np
import pytest

from gvgbot.autonomy.recogniser import Recogniser
from gvgbot.autonomy.slam.graph import Vertex
from gvgbot.autonomy.views import View
from gvgbot.geometry import Pose
from tests.unit.autonomy.test_mission import TEE, Robot


def test_a_vertex_can_be_turned_by_what_was_driven_since_it_was_seen_and_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A heading that was lost before that is as wrong for the vertex."""
    sigmas: list[float] = []

    def laid_on(
        self: Recogniser, view: View, vertex: Vertex, prior: Pose, turn_sigma: float
    ) -> tuple[None, float]:
        sigmas.append(turn_sigma)
        return None, 0.0

    lost, since = 0.3, 0.1  # rad
    robot = Robot()
    robot.mapper.move(Pose(), np.diag([0.0, 0.0, lost**2]))
    robot.stand(TEE, 8)
    assert robot.mapper.graph.vertices
    robot.mapper.move(Pose(), np.diag([0.0, 0.0, since**2]))
    for vertex in robot.mapper.graph.vertices.values():
        vertex.seen_at = -100.0  # m, driven since
    monkeypatch.setattr(Recogniser, "_laid_on", laid_on)
    robot.stand(TEE, 8)
    assert since < sigmas[0] < 0.5 * (since + lost)
