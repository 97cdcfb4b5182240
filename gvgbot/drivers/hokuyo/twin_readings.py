"""From true ranges to what a laser would read: noise, error codes, echoes, clusters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gvgbot.drivers.hokuyo.models import Model
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.geometry import Array

LARGEST_TWO_CHARACTERS = 4095  # mm
NO_RANGE = np.int32(np.iinfo(np.int32).max)
WALL_INTENSITY = 12_000.0  # at no distance; half of it at INTENSITY_RANGE
INTENSITY_RANGE = 1000.0  # mm
THIN_INTENSITY = 300  # of something that lets most of the light through
LEAST_EDGE = 0.1  # m between what two neighbouring beams meet, for an edge

Indices = NDArray[np.intp]


def with_mixed_pixels(ranges: Array, fraction: float, rng: np.random.Generator) -> Array:
    """Ranges (N,) in m with a beam anywhere between near and far at this fraction of the edges.

    It is one of the two beside the edge, as likely on the near side as on the far. On a straight
    wall, where the reciprocal of the range is linear in small angles, no step is an edge.
    """
    if fraction == 0.0:
        return ranges
    finite = np.where(np.isfinite(ranges), ranges, np.nan)
    padded = np.pad(finite, 1, constant_values=np.nan)
    before, here, after, beyond = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    step = after - here
    with np.errstate(divide="ignore", invalid="ignore"):
        on_wall = np.abs(1.0 / (2.0 / here - 1.0 / before) - after) < LEAST_EDGE
        on_wall |= np.abs(1.0 / (2.0 / after - 1.0 / beyond) - here) < LEAST_EDGE
    is_mixed = (np.abs(step) > LEAST_EDGE) & ~on_wall & (rng.random(len(step)) < fraction)
    edges = np.flatnonzero(is_mixed)
    mixed = ranges.copy()
    beside = edges + rng.integers(0, 2, len(edges))
    mixed[beside] = ranges[edges] + rng.random(len(edges)) * step[edges]
    return mixed


def noisy_readings(
    ranges: Array,
    model: Model,
    sigma: float | Array,
    dropout_fraction: float,
    rng: np.random.Generator,
) -> Values:
    """Readings (N,) in mm or the model's error codes, of true ranges (N,) in m, inf = nothing.

    `sigma` is the range noise in m, of all or of each (N,).
    """
    noisy_mm = (ranges + sigma * rng.standard_normal(len(ranges))) * 1000.0
    beyond = model.usable_mm + 1
    readings: Values = np.rint(np.fmin(noisy_mm, beyond)).astype(np.int32)
    readings[readings == beyond] = model.nothing_code
    readings[noisy_mm < model.parameters.range_min_mm] = model.near_code
    readings[rng.random(len(ranges), np.float32) < dropout_fraction] = model.failure_code
    return readings


def intensities_of(readings: Values, shortest_mm: int) -> Values:
    """How much light comes back (N,), without unit; little with an error code."""
    strength = WALL_INTENSITY / (1.0 + np.maximum(readings, 0) / INTENSITY_RANGE)
    return np.where(readings < shortest_mm, 100, strength).astype(np.int32)


@dataclass(frozen=True, slots=True)
class Echoes:
    """Readings and intensities (sum of echoes,), and how many of them each step has (steps,)."""

    readings: Values
    intensities: Values
    counts: Values


def with_thin_things(
    readings: Values,
    intensities: Values,
    shortest_mm: int,
    fraction: float,
    rng: np.random.Generator,
) -> Echoes:
    """Readings of which some have a weak echo before them, half as far away."""
    is_double = (rng.random(len(readings)) < fraction) & (readings >= 2 * shortest_mm)
    places = np.flatnonzero(is_double)
    return Echoes(
        np.insert(readings, places, readings[places] // 2).astype(np.int32),
        np.insert(intensities, places, THIN_INTENSITY).astype(np.int32),
        (1 + is_double).astype(np.int32),
    )


def picks(readings: Values, group: int, shortest_mm: int) -> Indices:
    """Which reading stands for each group of steps: the smallest that is a range, or the first."""
    if group == 1:
        return np.arange(len(readings))
    rows = np.full(-(-len(readings) // group) * group, NO_RANGE, np.int32)
    rows[: len(readings)] = np.where(readings < shortest_mm, NO_RANGE, readings)
    nearest = rows.reshape(-1, group).argmin(axis=1)
    chosen: Indices = np.arange(len(nearest)) * group + nearest
    return chosen


def clustered(readings: Values, group: int, shortest_mm: int) -> Values:
    """The smallest range of each group of steps, or its first error code if it has no range."""
    return readings if group == 1 else readings[picks(readings, group, shortest_mm)]
