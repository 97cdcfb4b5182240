"""The edges of the local GVG: chains of Voronoi points at even spacing, without their zigzag."""

from collections.abc import Iterator
from itertools import accumulate, pairwise

import numpy as np

from gvgbot.autonomy.gvg.draft import Chain, steps_of
from gvgbot.autonomy.gvg.local import LocalEdge
from gvgbot.geometry import Array

_SPACING = 0.1  # metres between the points of an edge


def smooth_edges(chains: list[Chain]) -> Iterator[LocalEdge]:
    """Chains at even spacing, with the zigzag of the Voronoi vertices smoothed; ends stay.

    They lie one after another in the same arrays: short ones cost most by the number of calls.
    """
    if not chains:
        return
    raw, parts = _end_to_end([chain.points for chain in chains])
    along = _stations(raw, parts)
    even = [_resampled(chain, along[part]) for chain, part in zip(chains, parts, strict=True)]
    line, parts = _end_to_end([points for points, _ in even])
    is_inner = np.ones(len(line), bool)
    is_inner[[end for part in parts for end in (part.start, part.stop - 1)]] = False
    inner = is_inner.nonzero()[0]
    for _ in range(2):
        before, here, after = (line.take(inner + k, axis=0) for k in (-1, 0, 1))
        line[inner] = 0.25 * before + 0.5 * here + 0.25 * after
    along = _stations(line, parts)
    for chain, (_, clearance), part in zip(chains, even, parts, strict=True):
        yield LocalEdge(chain.a, chain.b, line[part], clearance, along[part])


def _resampled(chain: Chain, along: Array) -> tuple[Array, Array]:
    """Points (M, 2) and clearance (M,) of a chain at even spacing, by its stations (N,)."""
    length = float(along[-1])
    count = max(2, round(length / _SPACING) + 1)
    at = np.arange(count) * (length / (count - 1))
    at[-1] = length
    points = np.empty((count, 2))
    for k in (0, 1):
        points[:, k] = np.interp(at, along, chain.points[:, k])
    return points, np.interp(at, along, chain.clearance)


def _end_to_end(lines: list[Array]) -> tuple[Array, list[slice]]:
    """Polylines as one (N, 2), and which part of that each of them is."""
    ends = accumulate(map(len, lines), initial=0)
    return np.concatenate(lines), [slice(a, b) for a, b in pairwise(ends)]


def _stations(line: Array, parts: list[slice]) -> Array:
    """Metres (N,) along each of the polylines that are the parts of one (N, 2)."""
    steps, along = steps_of(line), np.zeros(len(line))
    for part in parts:
        steps[part.start : part.stop - 1].cumsum(out=along[part.start + 1 : part.stop])
    return along
