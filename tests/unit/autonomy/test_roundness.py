"""Discs, corners and ends of walls, seen with noise from exact geometry: which are round."""

import math

import numpy as np
import pytest

from gvgbot.autonomy.roundness import SURE, body_of, round_evidence, with_look
from gvgbot.geometry import Array

EYE = np.zeros(2)
FINE = math.tau / 1440  # rad from beam to beam
COARSE = math.tau / 1024
LOOKS, TRIALS = 8, 50
ROBOT = 0.177  # m, its radius
ROOM = (4.0, 2.0)  # m from the laser to its walls, ahead and beside

NOISES = pytest.mark.parametrize("noise", [0.01, 0.03])
PLACES = pytest.mark.parametrize(
    ("increment", "away"), [(COARSE, 1.5), (COARSE, 3.0), (FINE, 2.0), (FINE, 5.0)]
)


def to_disc(bearings: Array, away: float, radius: float) -> Array:
    """Ranges (N,) to a disc straight ahead; inf beside it."""
    inside = radius**2 - (away * np.sin(bearings)) ** 2
    return np.where(inside > 0.0, away * np.cos(bearings) - np.sqrt(np.maximum(inside, 0)), np.inf)


def to_box(bearings: Array, away: float, size: tuple[float, float], turned: float) -> Array:
    """Ranges (N,) to a box (length, width) that is turned; inf beside it.

    A beam is inside a box from where it has entered both pairs of its sides to where it leaves one.
    """
    c, s = math.cos(turned), math.sin(turned)
    eye = np.array([-away * c, away * s])
    towards = np.stack([np.cos(bearings - turned), np.sin(bearings - turned)], axis=1)
    half = np.array(size) / 2
    first, last = np.sort([(-half - eye) / towards, (half - eye) / towards], axis=0)
    enters, leaves = first.max(axis=1), last.min(axis=1)
    return np.where(enters < leaves, enters, np.inf)


def ends(bearings: Array, ranges: Array, noise: float, rng: np.random.Generator) -> Array:
    """Where beams end (N, 2) on what they meet, with noise and two per cent of failures."""
    met = np.isfinite(ranges) & (rng.random(len(ranges)) > 0.02)
    r = ranges[met] + noise * rng.standard_normal(met.sum())
    return np.stack([r * np.cos(bearings[met]), r * np.sin(bearings[met])], axis=1)


def sweep(increment: float, rng: np.random.Generator) -> Array:
    """Bearings (N,) of beams ahead, none of which looks straight ahead but by chance."""
    return np.arange(-0.6, 0.6, increment) + rng.uniform(0.0, increment)


@pytest.mark.parametrize("seen", [1.0, 0.75])
def test_a_disc_is_found_where_it_is(seen: float) -> None:
    bearings = np.arange(-0.2, 0.2, FINE)
    points = ends(bearings, to_disc(bearings, 2.0, 0.22), 0.0, np.random.default_rng(1))
    evidence, centre, radius = round_evidence(points[: int(seen * len(points))], EYE, 0.0)
    assert evidence > SURE
    assert math.dist(centre, (2.0, 0.0)) < 0.002
    assert abs(radius - 0.22) < 0.002


def test_a_bay_is_no_body_though_it_is_round() -> None:
    """An arc that curves about the eye's side, as the corner of a cave does."""
    angles = np.linspace(-1.2, 1.2, 40)
    bay = np.stack([2.0 + 0.25 * np.cos(angles), 0.25 * np.sin(angles)], axis=1)
    assert round_evidence(bay, EYE, 0.01)[0] <= 0.0


def test_what_no_circle_goes_through_is_no_body() -> None:
    """A flat wall seen head-on, exactly, and beams that all end on one ray: nothing to solve."""
    wall = np.stack([np.full(20, 2.0), np.linspace(-0.2, 0.2, 20)], axis=1)
    ray = np.stack([np.linspace(1.0, 1.3, 20), np.zeros(20)], axis=1)
    for points in (wall, ray):
        assert round_evidence(points, EYE, 0.01)[0] <= 0.0


@NOISES
@PLACES
def test_a_few_looks_at_somebody_are_sure(noise: float, increment: float, away: float) -> None:
    rng = np.random.default_rng(2)
    known = 0
    for _ in range(TRIALS):
        radius, evidence = rng.uniform(0.2, 0.25), 0.0
        for _ in range(LOOKS):
            bearings = sweep(increment, rng)
            points = ends(bearings, to_disc(bearings, away, radius), noise, rng)
            evidence = with_look(evidence, round_evidence(points, EYE, noise)[0])
        known += evidence > SURE
    assert known >= 0.9 * TRIALS


@NOISES
@PLACES
@pytest.mark.parametrize("kind", ["post", "end of a wall", "half a cupboard"])
def test_corners_and_ends_of_walls_are_not(
    noise: float, increment: float, away: float, kind: str
) -> None:
    rng = np.random.default_rng(3)
    mistaken = 0
    for _ in range(TRIALS):
        length = {"post": rng.uniform(0.2, 0.5), "end of a wall": 0.7}.get(kind, 0.6)
        width = length if kind == "post" else rng.uniform(0.1, 0.2) if "wall" in kind else 0.5
        turned, evidence = rng.uniform(0.0, math.tau), 0.0
        for _ in range(LOOKS):
            bearings = sweep(increment, rng)
            points = ends(bearings, to_box(bearings, away, (length, width), turned), noise, rng)
            points = points[: len(points) * 2 // 3] if "half" in kind else points
            if len(points) >= 8:
                evidence = with_look(evidence, round_evidence(points, EYE, noise)[0])
        mistaken += evidence > SURE
    assert mistaken <= 0.04 * TRIALS


@pytest.mark.parametrize("away", [4.0, 8.0, 12.0])
def test_where_a_body_of_known_radius_is_few_beams_tell(away: float) -> None:
    """At 12 m they are 5 cm apart, and the rim of a robot is seen to within one of them."""
    rng, found = np.random.default_rng(5), []
    for _ in range(TRIALS):
        bearings = sweep(FINE, rng)
        points = ends(bearings, to_disc(bearings, away, ROBOT), 0.01, rng)
        found.append(body_of(points, EYE, ROBOT))
        assert body_of(points, EYE, ROBOT - 0.08) is None
        assert body_of(points, EYE, ROBOT + 0.08) is None
    off = np.array([centre - (away, 0.0) for centre in found if centre is not None])
    assert len(off) >= 0.9 * TRIALS
    assert np.abs(off.mean(axis=0)).max() < 0.01
    assert np.hypot(*off.T).max() < 0.05


def test_what_goes_back_farther_than_a_body_or_is_hardly_seen_is_none() -> None:
    bearings = np.arange(-0.2, 0.2, FINE)
    panel = to_box(bearings, 6.0, (0.6, 0.02), 0.5)  # as wide, as it is seen
    points = np.stack([panel * np.cos(bearings), panel * np.sin(bearings)], axis=1)
    assert body_of(points[np.isfinite(panel)], EYE, ROBOT) is None
    disc = to_disc(bearings, 22.0, ROBOT)
    points = np.stack([disc * np.cos(bearings), disc * np.sin(bearings)], axis=1)
    assert body_of(points[np.isfinite(disc)], EYE, ROBOT) is None
