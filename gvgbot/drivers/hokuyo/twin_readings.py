"""From true ranges to what a laser would read: noise, error codes, clusters."""

import numpy as np

from gvgbot.drivers.hokuyo.models import Model
from gvgbot.drivers.hokuyo.scip_codec import Values
from gvgbot.geometry import Array

LARGEST_TWO_CHARACTERS = 4095  # mm
NO_RANGE = np.int32(np.iinfo(np.int32).max)


def noisy_readings(
    ranges: Array, model: Model, sigma: float, dropout_fraction: float, rng: np.random.Generator
) -> Values:
    """Readings (N,) in mm or the model's error codes, of true ranges (N,) in m, inf = nothing.

    `sigma` is the range noise in m.
    """
    noisy_mm = (ranges + sigma * rng.standard_normal(len(ranges))) * 1000.0
    beyond = model.usable_mm + 1
    readings: Values = np.rint(np.fmin(noisy_mm, beyond)).astype(np.int32)
    readings[readings == beyond] = model.nothing_code
    readings[noisy_mm < model.parameters.range_min_mm] = model.near_code
    readings[rng.random(len(ranges), np.float32) < dropout_fraction] = model.failure_code
    return readings


def clustered(readings: Values, group: int, shortest_mm: int) -> Values:
    """The smallest range of each group of steps, or its first error code if it has no range."""
    if group == 1:
        return readings
    rows = np.full(-(-len(readings) // group) * group, NO_RANGE, np.int32)
    rows[: len(readings)] = np.where(readings < shortest_mm, NO_RANGE, readings)
    smallest: Values = rows.reshape(-1, group).min(axis=1)
    return np.where(smallest == NO_RANGE, readings[::group], smallest)
