"""Two laps around a block of known walls: the second lap lands on the first, and nowhere else."""

import math
from itertools import pairwise

import numpy as np

from gvgbot.autonomy.slam.revisits import Traverse, revisits
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.slam.smoothing import Constraint, PoseGraph
from gvgbot.geometry import Array, Pose

SIDE_M, STEP_M, SIGHT_M = 12.0, 0.75, 5.0
STEP_SIGMAS = np.diag([0.03**2, 0.03**2, 0.01**2])
MATCHING = ScanMatchingConfig()


def lap() -> list[Pose]:
    """Once around a square, from its middle of the lower side, anticlockwise."""
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    way = []
    for (x0, y0), (x1, y1) in pairwise(corners):
        for f in np.arange(0.0, 1.0, STEP_M / SIDE_M):
            heading = math.atan2(y1 - y0, x1 - x0)
            way.append(Pose(x0 + f * (x1 - x0), y0 + f * (y1 - y0), heading))
    return way


def box(x: float, y: float, side: float) -> Array:
    along = np.arange(0.0, side, 0.05)
    zero = np.zeros_like(along)
    edges = [(along, zero), (along, zero + side), (zero, along), (zero + side, along)]
    return np.concatenate([np.stack([x + a, y + b], axis=1) for a, b in edges])


def walls() -> Array:
    """Boxes of unequal sizes along both sides of the way."""
    rng = np.random.default_rng(5)
    places = [(p.x, p.y) for p in lap()[::3]]
    boxes = [box(-3.0, -3.0, SIDE_M + 6.0), box(2.0, 2.0, SIDE_M - 4.0)]
    for x, y in places:
        for dx, dy in rng.uniform(-1.5, 1.5, (2, 2)):
            boxes.append(box(x + dx, y + dy, float(rng.uniform(0.2, 0.6))))
    return np.concatenate(boxes)


def seen(world: Array, pose: Pose) -> Array:
    near = world[np.hypot(*(world - pose.position).T) < SIGHT_M]
    return pose.inverse().transform(near)


def run(true: list[Pose], world: Array, turn: float) -> Traverse:
    """What somebody believes who turns too far by `turn` at each step."""
    steps = [(a.to(b).compose(Pose(0.0, 0.0, turn)), STEP_SIGMAS) for a, b in pairwise(true)]
    return Traverse(steps, {i: seen(world, p) for i, p in enumerate(true)})


def poses(traverse: Traverse, found: list[Constraint]) -> Array:
    """The poses (N, 3) by the steps, and by what was found."""
    chain = [
        Constraint(i, i + 1, motion, np.asarray(np.linalg.inv(P), np.float64))
        for i, (motion, P) in enumerate(traverse.steps)
    ]
    way = [Pose()]
    for motion, _ in traverse.steps:
        way.append(way[-1].compose(motion))
    return PoseGraph(chain + found).solve(np.array([(p.x, p.y, p.theta) for p in way]))


def test_a_second_lap_is_laid_onto_the_first() -> None:
    true = lap() + lap()
    traverse = run(true, walls(), turn=0.001)
    n = len(lap())
    before, after = (poses(traverse, found) for found in ([], revisits(traverse, MATCHING)))
    assert np.hypot(*(before[n:, :2] - before[:n, :2]).T).max() > 0.5
    assert np.hypot(*(after[n:, :2] - after[:n, :2]).T).max() < 0.05


def test_a_match_tells_where_the_earlier_keyframe_saw_the_later_one() -> None:
    true = lap() + lap()
    matches = revisits(run(true, walls(), turn=0.001), MATCHING)
    assert matches
    for match in matches:
        off = match.a_b.inverse().compose(true[match.a].to(true[match.b]))
        assert math.hypot(off.x, off.y) < 0.05
        assert abs(off.theta) < 0.01


def test_another_place_that_looks_the_same_is_not_taken_for_it() -> None:
    """Two equal streets, 1.5 m apart: nobody jumps who knows well enough where he is."""
    street = [Pose(x, 0.0, 0.0) for x in np.arange(0.0, 12.0, STEP_M)]
    world = np.concatenate([box(x, y, 0.8) for x in range(-3, 16, 2) for y in (-1.2, 0.7)])
    traverse = run(street + [Pose(p.x, 1.5, 0.0) for p in street], world, turn=0.0)
    for i, pose in enumerate(street):
        traverse.walls[i] = traverse.walls[len(street) + i] = seen(world, pose)
    traverse.steps[:] = [(motion, 0.01 * P) for motion, P in traverse.steps]
    assert revisits(traverse, MATCHING) == []


def test_a_run_without_a_second_visit_has_no_matches() -> None:
    assert revisits(run(lap()[:20], walls(), turn=0.001), MATCHING) == []


def test_a_round_corridor_tells_no_place() -> None:
    """Its walls look the same all the way round, but for the noise of the laser."""
    rng = np.random.default_rng(3)
    turns = np.arange(0.0, 4.0 * math.pi, STEP_M / 6.0)
    true = [Pose(6.0 * math.cos(a), 6.0 * math.sin(a), a + math.pi / 2) for a in turns]
    around = np.arange(0.0, math.tau, 0.005)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    traverse = run(true, np.concatenate([5.0 * circle, 7.0 * circle]), turn=0.004)
    for i, points in traverse.walls.items():
        traverse.walls[i] = points + rng.normal(0.0, 0.01, points.shape)
    assert revisits(traverse, MATCHING) == []


def test_a_match_errs_as_much_as_it_says_where_steps_are_uncertain() -> None:
    """The walls of a place are of several scans, and lie as wrong as the steps between them."""
    true, world, distances = lap() + lap(), walls(), list[float]()
    for seed in range(6):
        traverse = run(true, world, turn=0.0)
        noise = np.random.default_rng(seed).multivariate_normal(
            np.zeros(3), STEP_SIGMAS, len(traverse.steps)
        )
        traverse.steps[:] = [
            (motion.compose(Pose.from_array(off)), STEP_SIGMAS)
            for (motion, _), off in zip(traverse.steps, noise, strict=True)
        ]
        for match in revisits(traverse, MATCHING):
            expected = true[match.a].to(true[match.b])
            off = match.a_b
            r = np.array([off.x - expected.x, off.y - expected.y, off.theta - expected.theta])
            r[2] = math.remainder(r[2], math.tau)
            distances.append(float(r @ match.information @ r))
    assert len(distances) > 50
    assert np.mean(distances) < 4.0
