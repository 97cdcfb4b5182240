from dataclasses import replace

import pytest

from gvgbot.autonomy.defects import Defects
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.geometry import STANDSTILL, Pose
from tests.unit.autonomy.sights import LASER_270, carved, sweep

ROOM = carved([(-3.0, -1.5, 2.0, 2.5)])


@pytest.mark.parametrize(
    ("moves", "tells", "laser", "key"),
    [
        (Pose(0.15), Pose(0.3), Pose(), None),  # wheels may spin for a while
        (Pose(theta=0.2), Pose(theta=0.3), Pose(), "base.wheel_base_m"),
        (Pose(theta=0.3), Pose(theta=0.3), Pose(0.25), "laser.x_m: 0.0"),
        (Pose(0.15), Pose(0.15), Pose(), None),
        (Pose(theta=0.3), Pose(theta=0.3), Pose(), None),
    ],
)
def test_what_walls_tell_against_wheels_and_mount_is_said_with_what_to_set(
    moves: Pose, tells: Pose, laser: Pose, key: str | None
) -> None:
    defects, said = Defects(ScanMatchingConfig()), None
    world_base, odom_base = Pose(-1.5, 0.3, 0.1), Pose()
    for _ in range(9):
        scan = replace(sweep(ROOM, world_base, field_of_view=LASER_270), base_laser=laser)
        said = said or defects.note_scan(scan, odom_base, STANDSTILL)
        world_base, odom_base = world_base.compose(moves), odom_base.compose(tells)
    assert (said is None) == (key is None)
    assert (key or "") in (said or "")
