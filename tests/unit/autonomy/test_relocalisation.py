"""Where on a known map a robot is: told by walls that differ, and never by walls that do not."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.small_worlds import one_ring
from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.known_walls import KnownWalls
from gvgbot.autonomy.relocalisation import Look, Opinion, Relocaliser
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Pose, wrap_angle
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import LASER_270, Rectangle, carved, sweep

pytestmark = pytest.mark.slow

SQUARE: list[Rectangle] = [
    *((-1.0, -1.0, 11.0, 1.0), (-1.0, 9.0, 11.0, 11.0)),
    *((-1.0, -1.0, 1.0, 11.0), (9.0, -1.0, 11.0, 11.0)),
]
CORNERS = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
ALIKE = carved(SQUARE)  # turned by a quarter about its middle, it is the same
WITH_BRANCH = carved([*SQUARE, (2.0, 9.0, 4.0, 15.0)])
HALL = carved([(0.0, 0.0, 60.0, 40.0)])
STEP_M = 0.5
WORK = 200  # steps of the relocaliser between two looks; more than it needs


def along(corners: Iterable[tuple[float, float]]) -> list[Pose]:
    """Poses along straight lines, looking ahead."""
    poses = []
    for (xa, ya), (xb, yb) in pairwise(corners):
        for share in np.arange(0.0, 1.0, STEP_M / math.hypot(xb - xa, yb - ya)):
            x, y = xa + share * (xb - xa), ya + share * (yb - ya)
            poses.append(Pose(float(x), float(y), math.atan2(yb - ya, xb - xa)))
    return poses


def gathered(scans: list[tuple[Pose, Scan]]) -> KnownWalls:
    """What scans show, all of it in one go."""
    found = []

    def work() -> Iterator[None]:
        found.append((yield from KnownWalls.gather(scans)))

    for _ in work():
        pass
    return found[0]


def test_who_stands_far_from_all_the_walls_that_are_known_has_still_seen_the_floor() -> None:
    here = Pose(27.0, 20.0, math.pi)  # of the hall it sees the western wall only, 27 m away
    known = gathered([(here, sweep(HALL, here, field_of_view=math.pi / 3))])
    assert len(known.points) > 0
    assert known.points[:, 0] == pytest.approx(0.0, abs=0.05)
    assert known.is_seen(np.array([[20.0, 20.0]])).all()
    assert not known.is_seen(np.array([[27.0, 30.0], [200.0, 20.0]])).any()


def test_a_long_past_is_gathered_in_many_goes_none_of_which_holds_a_robot_up() -> None:
    here = Pose(5.0, 0.0)
    scans = [(here, sweep(ALIKE, here))] * 300
    assert len(list(KnownWalls.gather(scans))) >= 20


def opinions(
    world: World,
    path: list[Pose],
    tour: list[tuple[float, float]] | None = None,
    *,
    is_whole: bool = True,
) -> list[Opinion]:
    """What is thought after each pose of a path (world frame, which is that of the map).

    The map is of scans taken on a tour: round the corridors.
    """
    rng = np.random.default_rng(3)
    tour = tour or [*CORNERS, CORNERS[0]]
    known = [(pose, sweep(world, pose)) for pose in along(tour)[::2]]
    relocaliser = Relocaliser(known, ScanMatchingConfig(), seen_at=known[-1][0], is_whole=is_whole)
    local_map, formed = LocalMap(LocalMapConfig(half_width_m=10.0)), []
    for number, pose in enumerate(path):
        view = LASER_270 if number else math.tau  # it turns before it drives
        scan = sweep(world, pose, field_of_view=view, sigma=0.01, rng=rng)
        local_base = path[0].to(pose)
        local_map.insert(scan, local_base, number * STEP_M)
        look = Look.around(local_base, local_map)
        formed.append([relocaliser.step(look) for _ in range(WORK)][-1])
    return formed


@pytest.mark.parametrize(
    ("tour", "path"),
    [
        ([(1.5, 3.0), (1.5, 1.5), (3.4, 1.5)], [(6.0, 4.4), (6.0, 6.5), (1.5, 6.5), (1.5, 4.0)]),
        ([(1.5, 3.0), (1.5, 1.5), (3.4, 1.5)], [(3.5, 6.5), (6.0, 6.5), (6.0, 1.5), (5.0, 1.5)]),
        ([(1.5, 3.0), (1.5, 6.5), (3.5, 6.5)], [(6.0, 4.0), (6.0, 1.5), (1.5, 1.5)]),
    ],
)
def test_off_the_map_a_corner_of_corridors_with_other_widths_makes_nobody_sure(
    tour: list[tuple[float, float]], path: list[tuple[float, float]]
) -> None:
    formed = opinions(one_ring().world, along(path), tour, is_whole=False)
    assert formed[-1].looks >= 5
    assert not any(opinion.is_sure for opinion in formed)


def test_who_stays_on_half_a_map_is_sure_of_the_right_place_in_the_end() -> None:
    tour = [(1.5, 3.0), (1.5, 1.5), (3.4, 1.5)]
    path = along([*tour, (1.5, 1.5), (1.5, 3.0), (1.5, 1.5), (3.4, 1.5)])
    formed = opinions(one_ring().world, path, tour, is_whole=False)
    first = next(i for i, opinion in enumerate(formed) if opinion.is_sure)
    found = formed[first].map_local
    assert found is not None
    assert found.compose(path[0].to(path[first])).distance(path[first]) < 0.1


@pytest.mark.parametrize("turned", [0.0, -1.9, 1.9])
def test_who_wakes_where_it_was_is_sure_of_that_on_half_a_map_as_well(turned: float) -> None:
    """However it has turned meanwhile: a base goes on for two seconds after its last command."""
    tour = [(1.5, 5.5), (1.5, 1.5), (4.0, 1.5)]
    path = along([(3.5, 1.5), (6.0, 1.5), (6.0, 6.5)])  # and drives on from there
    path[0] = replace(path[0], theta=turned)
    formed = opinions(one_ring().world, path, tour, is_whole=False)
    sure = [i for i, opinion in enumerate(formed) if opinion.is_sure]
    assert sure
    found = formed[sure[0]].map_local
    assert found is not None
    assert found.compose(path[0].to(path[sure[0]])).distance(path[sure[0]]) < 0.1


def test_walls_that_are_all_alike_leave_every_place_possible_however_long_it_drives() -> None:
    path = along([(5.0, 0.3), *CORNERS[1:], *CORNERS[:2]])
    formed = opinions(ALIKE, path)
    assert formed[-1].looks > 20
    assert not any(opinion.is_sure for opinion in formed)
    assert {opinion.possible for opinion in formed[-40:]} == {4}
    assert formed[-1].is_hopeless


def test_it_is_sure_when_it_has_seen_the_branch_and_not_before() -> None:
    path = along([(1.2, 0.5), *CORNERS[1:], (1.0, 10.0)])
    formed = opinions(WITH_BRANCH, path)
    for pose, opinion in zip(path, formed, strict=True):
        assert not opinion.is_hopeless
        if pose.y < 2.0 and pose.x < 8.0:  # out of sight of the branch and of its mouth
            assert not opinion.is_sure
        if opinion.is_sure:
            assert opinion.map_local is not None
            found = opinion.map_local.compose(path[0].to(pose))
            assert found.distance(pose) < 0.1
            assert abs(wrap_angle(found.theta - pose.theta)) < 0.03
    assert formed[-1].is_sure


def test_who_sees_no_wall_thinks_nothing_until_it_has_driven_to_one() -> None:
    known = [(pose, sweep(ALIKE, pose)) for pose in along([*CORNERS, CORNERS[0]])[::2]]
    relocaliser = Relocaliser(known, ScanMatchingConfig(), seen_at=Pose(), is_whole=True)
    local_map = LocalMap(LocalMapConfig(half_width_m=10.0))
    opinion = [relocaliser.step(Look.around(Pose(), local_map)) for _ in range(WORK)][-1]
    assert opinion.map_local is None
    assert opinion.possible == 0
    local_map.insert(sweep(ALIKE, Pose(5.0, 0.0)), Pose(2.0), 2.0)
    look = Look.around(Pose(2.0), local_map)
    assert [relocaliser.step(look) for _ in range(WORK)][-1].possible > 0


def test_it_is_not_wrong_where_more_places_look_alike_than_it_can_follow() -> None:
    """Along five corridors of 40 m most places are alike; two have a branch near the end."""
    corridors: list[Rectangle] = [(-1.0, 10.0 * k - 1.0, 41.0, 10.0 * k + 1.0) for k in range(5)]
    branches: list[Rectangle] = [(37.0, 10.0, 38.2, 12.6), (37.0, 20.0, 38.2, 25.0)]
    world = carved([*corridors, *branches, (-1.0, -1.0, 1.0, 41.0)])
    tour = [
        end for k in range(5) for end in ((0.0, 10.0 * k), (40.0, 10.0 * k), (0.0, 10.0 * k + 0.1))
    ]
    path = along(
        [(27.3, 20.1), (39.5, 20.0), (37.6, 20.1), (37.6, 24.0), (37.6, 20.1), (33.0, 20.0)]
    )
    formed = opinions(world, path, tour)
    for pose, opinion in zip(path, formed, strict=True):
        if opinion.is_sure:
            assert opinion.map_local is not None
            assert opinion.map_local.compose(path[0].to(pose)).distance(pose) < 0.2
    assert formed[-1].is_sure
