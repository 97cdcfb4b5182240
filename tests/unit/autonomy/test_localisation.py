"""Localisation against walls that are known exactly."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from gvgbot.autonomy.gvg.local_map import LocalMapConfig
from gvgbot.autonomy.localisation import LocalMaps
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.slam.trail import Laid, move
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan
from tests.unit.autonomy.sights import LASER_270, carved, sweep

BEARINGS = np.radians(np.linspace(-135.0, 135.0, 1081))


def noise_of(along: float, sideways: float, turn: float) -> Array:
    """The parts (4, 3, 3) of the noise of a motion with these sigmas, m, m, rad."""
    rows = np.diag(np.square([along, sideways, turn]))
    return np.array([*(np.diag(row) for row in rows), np.zeros((3, 3))])


LOOSE = noise_of(0.05, 0.05, 0.02)


def maps(matching: ScanMatchingConfig | None = None) -> LocalMaps:
    return LocalMaps(
        LocalMapConfig(half_width_m=10.0),
        LocalMapConfig(half_width_m=20.0, cell_m=0.25, bridge_gap_m=0.0),
        matching or ScanMatchingConfig(),
    )


def room(rng: np.random.Generator, x: float, sigma: float = 0.01) -> Scan:
    """A room of 16 by 3 m, seen from x on its middle line, with so many metres of noise."""
    c, s = np.cos(BEARINGS), np.sin(BEARINGS)
    with np.errstate(divide="ignore"):
        to_end = np.where(c > 0, 8.0 - x, 8.0 + x) / np.abs(c)
        to_side = 1.5 / np.abs(s)
    ranges: Array = np.minimum(to_end, to_side) + rng.normal(0.0, sigma, len(BEARINGS))
    return Scan(0.0, ranges, float(BEARINGS[0]), math.radians(0.25), 0.1, 30.0)


def test_noise_does_not_turn_the_scan() -> None:
    """Whichever way the beams sweep, the heading found is right on average."""
    rng, errors = np.random.default_rng(1), []
    for _ in range(40):
        local = maps()
        for x in np.arange(-2.0, 0.0, 0.25):
            local.insert(room(rng, x), Pose(x, 0.0, 0.0), x + 2.0)
        found, *_ = local.match(
            room(rng, 0.0), Pose(-0.25, 0.0, 0.0), Pose(0.25, 0.0, 0.0), 1.0, LOOSE
        )
        errors.append(found.theta)
    standard_error = np.std(errors) / math.sqrt(len(errors))
    assert standard_error < 5e-5
    assert abs(np.mean(errors)) < 3 * standard_error


@pytest.mark.parametrize("search_rad", [0.0, 0.4])
def test_wheels_that_spin_are_found_out_whether_the_heading_is_searched_or_not(
    search_rad: float,
) -> None:
    rng, local = np.random.default_rng(2), maps(ScanMatchingConfig(search_rad=search_rad))
    for x in np.arange(-2.0, 0.0, 0.25):
        local.insert(room(rng, x), Pose(x, 0.0), x + 2.0)
    found, noise = Pose(-0.25), noise_of(0.005, 0.01, 0.01)
    for _ in range(4):
        found, *_ = local.match(room(rng, -0.25), found, Pose(0.15), 0.5, noise)
    assert found.x == pytest.approx(-0.25, abs=0.02)


def test_what_is_done_while_there_is_time_changes_no_match() -> None:
    found = []
    for has_time in (False, True):
        rng, local = np.random.default_rng(4), maps()
        for x in np.arange(-2.0, 0.0, 0.25):
            local.insert(room(rng, x), Pose(x, 0.0, 0.0), x + 2.0)
            if has_time:
                local.catch_up()
        assert len(local.far.points()) > 100
        found.append(local.match(room(rng, 0.0), Pose(-0.25, 0.0), Pose(0.25, 0.0), 1.0, LOOSE))
    assert found[0][0] == found[1][0]
    assert np.array_equal(found[0][1], found[1][1])


def test_without_walls_the_covariance_is_the_prior_s() -> None:
    nothing = Scan(0.0, np.full(1081, math.inf), float(BEARINGS[0]), math.radians(0.25), 0.1, 30.0)
    pose, covariance, laid = maps().match(nothing, Pose(1.0, 2.0, 3.0), Pose(), 1.0, LOOSE)
    assert pose == Pose(1.0, 2.0, 3.0)
    drift = np.diag([0.0, 0.0, 0.0005**2])  # of a gyro in a second, before it is known
    np.testing.assert_allclose(covariance, LOOSE.sum(axis=0) + drift, rtol=1e-9, atol=1e-15)
    assert laid is not None
    np.testing.assert_allclose(laid.noise, LOOSE.sum(axis=0))
    assert len(laid.gains) == 0


def test_wheels_that_slipped_in_a_turn_are_found_out_by_a_search() -> None:
    """They say half a radian to the left, and the walls nothing at all."""
    rng, found = np.random.default_rng(2), []
    for search_rad in (0.0, 0.6):
        local = maps(ScanMatchingConfig(coarse_pair_m=0.5, search_rad=search_rad))
        local.insert(room(rng, -2.0), Pose(-2.0, 0.0, 0.0), 0.0)
        pose, *_ = local.match(
            room(rng, -2.0), Pose(-2.0, 0.0, 0.0), Pose(0.0, 0.0, 0.5), 1.0, LOOSE
        )
        found.append(pose)
    without, searched = found
    assert abs(without.theta) > 0.1
    assert abs(searched.theta) < 0.01
    assert searched.distance(Pose(-2.0, 0.0, 0.0)) < 0.02


@pytest.mark.parametrize(
    ("turn", "turn_without", "within"), [(0.04, 0.04, 1e-12), (0.3, 0.0, 0.01), (-0.35, 0.0, 0.01)]
)
def test_the_heading_is_searched_only_where_walls_speak_against_odometry(
    turn: float, turn_without: float, within: float
) -> None:
    """What walls correct anyhow stays as it is; a slip is found, as if there had been none."""
    found = []
    for search_rad, felt in ((0.0, turn_without), (0.4, turn)):
        rng, local = np.random.default_rng(5), maps(ScanMatchingConfig(search_rad=search_rad))
        for x in np.arange(-2.0, 0.0, 0.25):
            local.insert(room(rng, x), Pose(x, 0.0), x + 2.0)
        found.append(local.match(room(rng, 0.0), Pose(-0.25), Pose(0.25, 0.0, felt), 1.0, LOOSE)[0])
    without, searched = found
    assert searched.theta == pytest.approx(without.theta, abs=within)
    assert searched.distance(without) < 5 * within


@pytest.mark.parametrize("locate", [LocalMaps.find, LocalMaps.match])
def test_a_robot_that_comes_round_a_corner_unseen_is_found_by_the_walls_it_knew(
    locate: Callable[[LocalMaps, Scan, Pose, Pose, float, Array], tuple[Pose, Array, Laid | None]],
) -> None:
    """Most of what it sees is new, and the wheels are wrong by some centimetres."""
    world = carved([(-4.0, -1.0, 1.0, 1.0), (-1.0, -1.0, 1.0, 9.0)])
    rng, local = np.random.default_rng(7), maps()
    before, here = Pose(-1.8, 0.0, 0.0), Pose(0.0, 1.5, math.pi / 2)
    for x in (-2.4, -2.1, -1.8):
        seen = sweep(world, Pose(x, 0.0, 0.0), field_of_view=LASER_270, sigma=0.01, rng=rng)
        local.insert(seen, Pose(x, 0.0, 0.0), x)
    scan = sweep(world, here, field_of_view=LASER_270, sigma=0.01, rng=rng)
    wheels = before.to(here).compose(Pose(0.08, -0.05, 0.01))
    found, covariance, _ = locate(local, scan, before, wheels, 4.0, LOOSE)
    assert found.distance(here) < 0.035  # the wheels are 0.094 m off
    assert abs(found.theta - here.theta) < 0.01
    assert covariance[0, 0] < 0.05**2


@pytest.mark.xfail(strict=True, reason="points at corners are laid onto lines that cut the corner")
def test_the_corners_of_a_room_do_not_hold_the_robot_back() -> None:
    """Seen from one side only, lines across them are a few centimetres before the end wall."""
    rng, local, noise = np.random.default_rng(8), maps(), noise_of(0.01, 0.005, 0.003)
    believed, odometry = Pose(-4.0, 0.0, 0.0), Pose(0.25, 0.0, 0.0)
    local.insert(room(rng, -4.0, sigma=1e-6), believed, 0.0)
    for step in range(1, 21):
        scan = room(rng, -4.0 + 0.25 * step, sigma=1e-6)
        believed, *_ = local.match(scan, believed, odometry, 1.0, noise)
        local.insert(scan, believed, 0.25 * step)
    assert believed.distance(Pose(1.0, 0.0, 0.0)) < 0.006


def test_a_noisy_laser_does_not_make_the_wheels_slip() -> None:
    """Points that find no line must not speak for a place where they are beyond all walls."""
    rng, local, noise = np.random.default_rng(1), maps(), noise_of(0.01, 0.005, 0.003)
    xs = np.concatenate([np.arange(-4.0, 4.0, 0.25), np.arange(4.0, -4.0, -0.25)] * 2)[:100]
    believed = Pose(float(xs[0]))
    local.insert(room(rng, believed.x, sigma=0.03), believed, 0.0)
    for step, (before, x) in enumerate(itertools.pairwise(xs.tolist()), 1):
        scan = room(rng, x, sigma=0.03)
        believed, *_ = local.match(scan, believed, Pose(x - before), 1.0, noise)
        local.insert(scan, believed, 0.25 * step)
        assert believed.distance(Pose(x)) < 0.06


def test_a_drive_errs_about_as_much_as_its_steps_say_together() -> None:
    """Twenty matched steps: the drift of the walls adds up, the error of a match counts once."""
    rng, noise = np.random.default_rng(6), noise_of(0.01, 0.005, 0.003)
    errors, summed = [], np.zeros(3)
    for _ in range(15):
        local, believed, newest = maps(), Pose(-4.0, 0.0, 0.0), np.zeros(3)
        local.insert(room(rng, -4.0), believed, 0.0)
        for step in range(1, 21):
            slip = Pose.from_array(rng.multivariate_normal([0.25, 0.0, 0.0], noise.sum(axis=0)))
            scan = room(rng, -4.0 + 0.25 * step)
            believed, covariance, laid = local.match(scan, believed, slip, 1.0, noise)
            assert laid is not None
            summed, newest = summed + np.diag(covariance) / 15, np.diag(laid.noise)
            local.insert(scan, believed, 0.25 * step)
        errors.append((believed.x - 1.0, believed.y, believed.theta))
        summed += newest / 15
    share = np.mean(np.square(errors), axis=0)[[0, 2]] / summed[[0, 2]]
    assert (share < chi2.ppf(0.995, 15) / 15).all()
    assert (share > 0.1).all()


def test_who_stands_in_a_room_errs_as_it_says() -> None:
    """Walls are means of many looks, and no scan's noise moves those that it is laid onto."""
    noise, runs, total = noise_of(0.02, 0.02, 0.02), 16, 0.0
    for seed in range(runs):
        rng, local, believed, belief = np.random.default_rng(seed), maps(), Pose(), Belief()
        local.insert(room(rng, 0.0), believed, 0.0)
        for _ in range(20):
            slip = Pose.from_array(rng.multivariate_normal(np.zeros(3), noise.sum(axis=0)))
            scan, before = room(rng, 0.0), believed
            believed, step, laid = local.match(scan, before, slip, 0.0, noise)
            belief = move(belief, before.to(believed), step, laid)
            local.insert(scan, believed, 0.0)
        error = np.array([believed.x, believed.y, believed.theta])
        total += float(error @ np.linalg.solve(belief.P[:3, :3], error))
    assert chi2.ppf(0.01, 3 * runs) < total < chi2.ppf(0.99, 3 * runs)


def test_a_match_tells_what_the_one_before_has_taught_of_odometry() -> None:
    """A posterior covariance is what is left of an error times the prior one."""
    rng, local, told = np.random.default_rng(5), maps(), list[Laid]()
    local.insert(room(rng, -4.0), Pose(-4.0, 0.0, 0.0), 0.0)
    for x in (-3.75, -3.5):
        scan = room(rng, x)
        found, _, laid = local.match(scan, Pose(x - 0.25), Pose(0.25, 0.0, 0.0), 1.0, LOOSE)
        local.insert(scan, found, x + 4.0)
        assert laid is not None
        told.append(laid)
    first, second = told
    np.testing.assert_array_equal(first.left, np.eye(3))
    assert second.P[0, 0] < 0.995 * first.P[0, 0]
    np.testing.assert_allclose(second.left @ first.P, second.P, rtol=1e-4, atol=1e-11)
    assert (first.look, second.look) == (2, 3)
    assert np.unique(first.looks, axis=0).tolist() == [[1, 2]]
    assert np.unique(second.looks, axis=0).tolist() == [[1, 2], [1, 3], [2, 3]]


POSTS = [(0.5 * k, y, 0.5 * k + 0.1, y + 0.1) for k in range(25) for y in (0.0, 9.0)]
POSTS += [(x, 0.5 * k, x + 0.1, 0.5 * k + 0.1) for k in range(1, 18) for x in (0.0, 12.0)]
YARD = carved([(-3.0, -3.0, 15.0, 12.0)], [*POSTS, (5.0, 4.0, 7.0, 5.0)])


def test_what_a_match_has_taught_is_told_once() -> None:
    """In a fog after it there is no match that teaches anything."""
    rng, local = np.random.default_rng(6), maps()
    for x in np.arange(-2.0, 0.0, 0.25):
        local.insert(room(rng, x), Pose(x, 0.0), x + 2.0)
    blind = Scan(0.0, np.full(1081, np.nan), float(BEARINGS[0]), math.radians(0.25), 0.1, 30.0)
    left = []
    for scan in (room(rng, 0.0), blind, blind):
        laid = local.match(scan, Pose(-0.25), Pose(0.25), 1.0, LOOSE).laid
        assert laid is not None
        left.append(laid.left)
    assert not np.array_equal(left[1], np.eye(3))
    assert np.array_equal(left[2], np.eye(3))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_between_posts_the_robot_does_not_take_its_wheels_for_slipping(seed: int) -> None:
    """Few points of a fence lie on lines; many do where the robot is not, from post to post."""
    rng, local, truth = np.random.default_rng(seed), maps(), Pose(2.0, 2.0)
    noise, believed = noise_of(0.02, 0.01, 0.01), truth
    for step in range(28):
        scan = sweep(YARD, truth, field_of_view=math.radians(240), sigma=0.01, rng=rng, reach=5.6)
        if step:
            slip = Pose.from_array(rng.multivariate_normal([0.25, 0.0, 0.0], noise.sum(axis=0)))
            believed, *_ = local.match(scan, believed, slip, 0.5, noise)
        local.insert(scan, believed, 0.25 * step)
        assert believed.distance(truth) < 0.15
        truth = truth.compose(Pose(0.25))


def test_where_walls_are_old_errors_do_not_add_up() -> None:
    """To and fro three times: the walls of the first way hold the robot, and its steps say so.

    The belief, which knows whose walls they are, is as sure at the end as after the first way.
    """
    rng, noise, runs = np.random.default_rng(9), noise_of(0.01, 0.005, 0.003), 6
    first = np.arange(-3.75, 1.01, 0.25)
    way = [*first, *np.tile([*np.arange(0.75, -2, -0.25), *np.arange(-1.5, 1.01, 0.25)], 3)]
    errors, claimed = np.zeros(3), np.zeros((2, 3))  # on the first way, and on all that follow
    sure = np.zeros((2, 3))  # the belief's variances after the first way, and at the end
    for _ in range(runs):
        local, believed, before = maps(), Pose(-4.0, 0.0, 0.0), -4.0
        belief, newest = Belief(np.array([before, 0.0, 0.0])), np.zeros(3)
        local.insert(room(rng, before), believed, 0.0)
        for step, x in enumerate(way, 1):
            slip = Pose.from_array(
                rng.multivariate_normal([x - before, 0.0, 0.0], noise.sum(axis=0))
            )
            scan, before = room(rng, x), float(x)
            old = believed
            believed, covariance, laid = local.match(scan, old, slip, 1.0, noise)
            belief = move(belief, old.to(believed), covariance, laid)
            assert laid is not None
            newest = np.diag(laid.noise)
            claimed[int(step > len(first))] += np.diag(covariance) / runs
            if step in (len(first), len(way)):
                sure[int(step > len(first))] += np.diag(belief.P)[:3] / runs
            local.insert(scan, believed, 0.25 * step)
        claimed[1] += newest / runs
        errors += np.square([believed.x - before, believed.y, believed.theta]) / runs
    share = errors / claimed.sum(axis=0)
    assert (share[[0, 2]] < chi2.ppf(0.995, runs) / runs).all()
    assert (claimed[1] < 1.5 * claimed[0]).all()  # on a way that is more than three times as long
    assert (sure[1] < 1.5 * sure[0]).all()
    assert ((errors / sure[1])[[0, 2]] < chi2.ppf(0.995, runs) / runs).all()


def test_a_thin_wall_seen_from_behind_is_not_taken_for_the_face_seen_before() -> None:
    """Along a corridor, through a door, and back along the other side of its wall."""
    thin = 0.1
    world = carved(
        [(-3.0, -1.0, 6.0, 1.0), (-3.0, 1.0 + thin, 6.0, 4.0), (4.2, 0.9, 5.2, 1.1 + thin)]
    )
    way = [Pose(x, 0.0, 0.0) for x in np.arange(-1.5, 4.7, 0.3)]
    way += [Pose(4.7, 0.0, turn) for turn in np.arange(0.3, math.pi / 2, 0.3)]
    way += [Pose(4.7, y, math.pi / 2) for y in np.arange(0.3, 2.6, 0.3)]
    way += [Pose(4.7, 2.5, turn) for turn in np.arange(1.8, math.pi, 0.3)]
    way += [Pose(x, 2.5, math.pi) for x in np.arange(4.5, 0.0, -0.3)]
    rng, noise = np.random.default_rng(3), noise_of(0.015, 0.008, 0.005)
    local, believed, errors = maps(), way[0], list[float]()
    for before, here in itertools.pairwise([way[0], *way]):
        slip = before.to(here).compose(
            Pose.from_array(rng.multivariate_normal(np.zeros(3), noise.sum(axis=0)))
        )
        scan = sweep(world, here, field_of_view=LASER_270, sigma=0.01, rng=rng, reach=5.6)
        believed, *_ = local.match(scan, believed, slip, 0.5, noise)
        local.insert(scan, believed, 0.3 * len(errors))
        errors.append(abs(believed.y - here.y))
    assert max(errors) < 0.5 * thin


def test_what_was_learnt_last_is_not_old_either_when_it_counts_on() -> None:
    """Both maps forget by metres driven, and the far one learns a scan late."""
    local, seen = maps(), room(np.random.default_rng(1), 0.0)
    blind = replace(seen, ranges=np.full(len(BEARINGS), np.nan))
    local.insert(seen, Pose(), 3.0)
    local.count_on(1000.0)
    local.insert(blind, Pose(), 1003.1)
    local.catch_up()
    near, far = len(local.near.points()), len(local._far.points())
    fresh = maps()
    fresh.insert(seen, Pose(), 3.0)
    fresh.catch_up()
    assert (near, far) == (len(fresh.near.points()), len(fresh._far.points()))
    assert min(near, far) > 100
