"""Registration finds an offset that is known, and only in directions that the walls constrain."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from gvgbot.autonomy.slam.scan_matching import (
    Registration,
    ScanMatchingConfig,
    Sides,
    register,
)
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose, wrap_angle
from gvgbot.worlds import builtin
from tests.unit.autonomy.sights import carved, line, looked, sweep

CORNER = carved([(-3.0, -1.0, 1.0, 1.0), (-1.0, -5.0, 1.0, 1.0)])  # an L of two corridors
CORRIDOR = carved([(-9.0, -1.0, 9.0, 1.0)])
Q = np.diag([0.1**2, 0.1**2, 0.05**2])
CONFIG = ScanMatchingConfig()


def hits(world: World, world_laser: Pose, rng: np.random.Generator | None = None) -> Array:
    """Points (N, 2) that a scan hits within six metres, laser frame."""
    scan = sweep(world, world_laser, sigma=0.01, rng=rng)
    near = scan.ranges < 6.0
    r, b = scan.ranges[near], scan.bearings[near]
    return np.stack([r * np.cos(b), r * np.sin(b)], axis=1)[::3]


def matched(
    world: World,
    truth: Pose,
    offset: Pose,
    *,
    rng: np.random.Generator | None = None,
    prior_covariance: Array = Q,
) -> Registration:
    """What registration makes of a prior that is wrong by an offset."""
    walls = looked(world, [truth.compose(Pose(-0.2, 0.0, 0.05))]).points()
    prior = truth.compose(offset)
    points = hits(world, truth, rng)
    found = register(points, cKDTree(walls), prior, prior_covariance, CONFIG)
    assert found is not None
    return found


offsets = st.builds(
    Pose, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(math.radians(-3), math.radians(3))
)


@settings(max_examples=25)
@given(offsets)
def test_a_known_offset_is_found_in_a_bend(offset: Pose) -> None:
    truth = Pose(0.1, -0.2, 0.4)
    found = matched(CORNER, truth, offset)
    assert truth.distance(found.pose) < 0.01
    assert math.degrees(abs(wrap_angle(found.pose.theta - truth.theta))) < 0.2
    assert found.inliers > 0.9
    assert found.rms < 0.02


@pytest.mark.parametrize("together", [1, 10])
def test_how_far_neighbours_err_together_is_told(together: int) -> None:
    """A mean over n points that err alike is as wrong as one of them: n times the variance."""
    rng, sigma, scatters = np.random.default_rng(5), 0.01, []
    along = np.arange(-4.0, 4.0, 0.02)
    walls = np.stack([np.tile(along, 2), np.repeat([-1.5, 1.5], len(along))], axis=1)
    for _ in range(40):
        points = walls.copy()
        points[:, 1] += rng.normal(0.0, sigma, len(walls) // together).repeat(together)
        found = register(points, cKDTree(walls), Pose(), Q, CONFIG)
        assert found is not None
        scatters.append(found.scatter)
    assert np.mean(scatters) == pytest.approx(together * sigma**2, rel=0.1)


def test_a_prior_that_leads_to_where_another_one_has_led_tells_nothing_more() -> None:
    walls, points = looked(CORNER, [Pose()]).points(), hits(CORNER, Pose())

    def led(prior: Pose, found: Pose | None) -> Registration | None:
        return register(points, cKDTree(walls), prior, Q, CONFIG, found=found)

    first = led(Pose(0.1, 0.0, 0.0), None)
    assert first is not None
    for beside in (Pose(), Pose(0.03, 0.02, 0.01)):  # no place so near is clearly better
        assert led(Pose(0.0, 0.1, 0.02), first.pose.compose(beside)) is None
    for beside in (Pose(2.0, 0.0, 0.0), Pose(0.08, 0.0, 0.0)):
        other = led(Pose(0.0, 0.1, 0.02), first.pose.compose(beside))
        assert other is not None
        assert first.pose.distance(other.pose) < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_a_known_offset_is_found_in_an_office_with_a_noisy_laser(seed: int) -> None:
    world, truth = builtin("office")
    rng = np.random.default_rng(seed)
    offset = Pose(*rng.uniform((-0.1, -0.1, -0.05), (0.1, 0.1, 0.05)))
    at_the_corner = Pose(truth.x, 4.3, truth.theta + 0.3)
    found = matched(world, at_the_corner, offset, rng=rng)
    assert at_the_corner.distance(found.pose) < 0.015
    assert math.degrees(abs(wrap_angle(found.pose.theta - at_the_corner.theta))) < 0.2


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_along_a_bare_corridor_the_prior_is_all_there_is(heading: float) -> None:
    truth = Pose(0.0, 0.2, heading)
    offset = truth.to(Pose(0.08, 0.26, heading + 0.02))  # eight along, six across
    found = matched(CORRIDOR, truth, offset)
    assert found.pose.y == pytest.approx(0.2, abs=0.01)
    assert found.pose.theta == pytest.approx(heading, abs=0.004)
    assert found.pose.x == pytest.approx(0.08, abs=0.01)
    prior = truth.compose(offset)
    c, s = math.cos(prior.theta), math.sin(prior.theta)
    along, across = np.array([c, -s, 0.0]), np.array([s, c, 0.0])  # in the prior's frame
    assert along @ found.covariance @ along == pytest.approx(0.1**2, rel=0.1)
    assert across @ found.covariance @ across < 0.1 * 0.1**2


@settings(max_examples=25)
@given(offsets, st.integers(0, 2**32 - 1))
def test_registration_only_adds_knowledge(offset: Pose, seed: int) -> None:
    """The covariance stays positive, and in no direction grows beyond the prior's."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.1, (3, 3))
    prior_covariance = root @ root.T + 1e-4 * np.eye(3)
    found = matched(CORNER, Pose(), offset, rng=rng, prior_covariance=prior_covariance)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    assert np.linalg.eigvalsh(prior_covariance - found.covariance).min() > -1e-9


@pytest.mark.parametrize("sigma", [0.002, 0.005, 0.01])
def test_prior_and_walls_are_weighed_by_their_certainty(sigma: float) -> None:
    """Across a corridor, all else held: the share k = 1 - P/Q of the offset is taken back."""
    offset = 0.01
    prior_covariance = np.diag([1e-12, sigma**2, 1e-12])
    found = matched(CORRIDOR, Pose(), Pose(0.0, offset, 0.0), prior_covariance=prior_covariance)
    exact = matched(CORRIDOR, Pose(), Pose(0.0, offset, 0.0))  # where the walls alone put it
    gain = 1.0 - float(found.covariance[1, 1]) / sigma**2
    assert 0.05 < gain < 0.98
    assert found.pose.y == pytest.approx(offset + gain * (exact.pose.y - offset), abs=3e-4)


def test_a_certain_prior_is_not_moved() -> None:
    truth, offset = Pose(), Pose(0.03, -0.02, 0.01)
    found = matched(CORNER, truth, offset, prior_covariance=1e-10 * np.eye(3))
    assert found.pose.distance(offset) < 1e-3


def test_the_frame_of_the_walls_does_not_matter() -> None:
    """Walls and prior moved together give the pose moved with them and the same covariance."""
    offset, frame = Pose(0.06, -0.05, 0.03), Pose(4.0, -7.0, 2.0)
    walls, points = looked(CORNER, [Pose()]).points(), hits(CORNER, Pose())
    here = register(points, cKDTree(walls), offset, Q, CONFIG)
    walls = frame.transform(walls)
    there = register(points, cKDTree(walls), frame.compose(offset), Q, CONFIG)
    assert here is not None
    assert there is not None
    assert frame.compose(here.pose).distance(there.pose) < 1e-4
    assert np.allclose(here.covariance, there.covariance, rtol=1e-3)


def test_points_far_from_all_walls_are_no_match() -> None:
    walls = looked(CORNER, [Pose()]).points()
    points = hits(CORNER, Pose())
    assert register(points, cKDTree(walls), Pose(40.0, 0.0, 0.0), Q, CONFIG) is None


def test_what_has_changed_pulls_the_less_the_farther_it_is_off() -> None:
    """From two sigmas on by their square over the distance: half as far off, it pulls twice.

    A third of a wall is where none was. It pulls as much as all that is there as before holds.
    """
    wide, aside = np.linspace(-3.0, 3.0, 600), np.linspace(-1.0, 1.0, 200)
    ahead = np.stack([np.full(600, 4.0), wide], axis=1)
    sides = np.concatenate([np.stack([aside, np.full(200, y)], axis=1) for y in (-3.0, 3.0)])
    moved, knee = 0.12, 2.0 * CONFIG.pair_sigma_m
    seen = ahead + np.where(np.arange(600) % 3 == 0, moved, 0.0)[:, None] * [1.0, 0.0]
    points, walls = np.concatenate([seen, sides]), cKDTree(np.concatenate([ahead, sides]))
    found = register(points, walls, Pose(), np.diag([1.0, 1.0, 1.0]), CONFIG)
    assert found is not None
    back = (moved - math.sqrt(moved**2 - 2.0 * knee**2)) / 2.0  # 2 back = knee^2 / (moved - back)
    assert found.pose.x == pytest.approx(-back, abs=1e-3)


def test_too_few_points_are_no_match() -> None:
    walls = looked(CORNER, [Pose()]).points()
    points = hits(CORNER, Pose())[: CONFIG.min_pairs - 1]
    assert register(points, cKDTree(walls), Pose(), Q, CONFIG) is None


def test_points_are_laid_onto_the_face_that_was_seen_from_their_side() -> None:
    """Above a thin wall, of which the map has the lower face: only the end wall is the same."""
    along, up = np.arange(-3.0, 3.0, 0.03), np.arange(-2.0, 2.0, 0.03)
    end = np.stack([np.full_like(up, 3.0), up], axis=1)
    walls = np.concatenate([np.stack([along, np.zeros_like(along)], axis=1), end])
    sights = np.repeat([[0.0, -1.0], [-1.0, 0.0]], [len(along), len(up)], axis=0)
    upper = np.stack([along[along < 2.5], np.full((along < 2.5).sum(), 0.1)], axis=1)
    points = np.concatenate([upper, end[up > 0.3]])
    sides = Sides(sights, np.array([0.0, 1.0]) - points)
    prior, tree = Pose(0.05, 0.0, 0.0), cKDTree(walls)
    own = register(points, tree, prior, Q, CONFIG, sides=sides)
    either = register(points, tree, prior, Q, CONFIG)
    assert own is not None
    assert either is not None
    assert own.pose.x == pytest.approx(0.0, abs=0.01)
    assert own.pose.y == pytest.approx(0.0, abs=1e-3)
    assert own.covariance[1, 1] > 0.5 * Q[1, 1]
    assert either.pose.y == pytest.approx(-0.1, abs=0.02)


def test_who_comes_through_a_door_is_not_drawn_back_to_the_other_face_of_the_wall() -> None:
    """The new face is seen from nearly its own plane: from which side, walls' noise would say."""
    world = carved([(-6.0, -3.0, 0.0, 3.0), (0.3, -3.0, 7.0, 3.0), (-0.1, -0.5, 0.4, 0.5)])
    view, sigma, truth = math.radians(240.0), 0.01, Pose(0.55)
    way, noise = line(-3.2, 0.0, 0.0, 0.0, 0.0, 12), np.diag([0.03**2, 0.01**2, 0.01**2])
    off = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        room = looked(world, way, sigma=sigma, rng=rng, field_of_view=view)
        points = sweep(world, truth, field_of_view=view, sigma=sigma, rng=rng, reach=5.6).ends
        walls, sides = room.points(), Sides(room.sights(), -points)
        found = register(points, cKDTree(walls), truth, noise, CONFIG, room.hits(), sides)
        assert found is not None
        off.append(found.pose.x - truth.x)
    assert math.sqrt(np.mean(np.square(off))) < 0.04


def test_round_columns_do_not_push_the_robot_back() -> None:
    """Points lie on the circles; a line through five of the map's is up to 25 mm inside them."""

    def on_columns(step: float, side: float) -> Array:
        """Points (N, 2), so far apart, m, to either side of where columns face the robot, rad."""
        turns = math.pi + np.arange(-side, side, step / 0.4)
        rim = 0.4 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        return np.concatenate([rim + at for at in ((2.0, -1.5), (2.5, 0.0), (2.0, 1.5))])

    walls, points = on_columns(0.1, 1.8), on_columns(0.023, 1.2)
    found = register(points, cKDTree(walls), Pose(), 100.0 * Q, CONFIG)
    assert found is not None
    assert found.pose.distance(Pose()) < 0.002
