"""Discs in the simulated world, people and robots alike: how near they are, and what beams hit."""

import numpy as np

from gvgbot.geometry import Array, Pose


def disc_offsets(centres: Array, radii: Array, x: float, y: float, reach: float) -> Array:
    """From (x, y) to the nearest point of each disc within `reach`: (M, 2), m.

    `centres` (N, 2) and `radii` (N,) in m.
    """
    to_centre = centres - (x, y)
    distance = np.hypot(to_centre[:, 0], to_centre[:, 1])
    gap = np.maximum(distance - radii, 0.0)
    near = gap <= reach
    shares: Array = gap[near] / np.maximum(distance[near], 1e-9)
    return np.asarray(to_centre[near] * shares[:, None])


def cast_on_discs(centres: Array, radii: Array, pose: Pose, bearings: Array) -> Array:
    """Ranges (N,) in m to the nearest disc along bearings (N,) of a sensor; inf: none."""
    directions = np.stack((np.cos(bearings + pose.theta), np.sin(bearings + pose.theta)))
    to_centre = centres - (pose.x, pose.y)
    ahead = to_centre @ directions
    beside = (to_centre**2).sum(axis=1)[:, None] - ahead**2
    half_chord = np.sqrt(np.maximum(radii[:, None] ** 2 - beside, 0.0))
    hit = (beside < radii[:, None] ** 2) & (ahead + half_chord > 0.0)
    ranges = np.where(hit, np.maximum(ahead - half_chord, 0.0), np.inf)
    return np.asarray(ranges.min(axis=0, initial=np.inf))
