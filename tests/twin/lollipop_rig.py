"""A dead end of 4 m that leads to a ring of corridors, 16 m around: one meetpoint, one endpoint."""

from gvgbot.geometry import Pose
from tests.unit.autonomy.sights import carved

LOLLIPOP = carved(
    [
        (-4.5, -0.7, 0.0, 0.7),
        (-0.7, -0.7, 4.7, 0.7),
        (-0.7, 3.3, 4.7, 4.7),
        (-0.7, -0.7, 0.7, 4.7),
        (3.3, -0.7, 4.7, 4.7),
    ]
)
START = Pose(-2.5, -0.1, 0.2)
IN_RING = Pose(4.0, 2.0, -1.2)
STICK_END = Pose(-3.7, 0.2, 3.1)
