"""What a robot that has explored all may have missed, by the grid of all its scans."""

import numpy as np

from gvgbot.autonomy.estimate import scans_at, smoothed_keyframes
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.geometry import Array, resampled
from gvgbot.maps.blanks import blanks
from gvgbot.maps.gaps import gaps
from gvgbot.maps.occupancy import occupancy_grid
from gvgbot.maps.viewpoints import viewpoints

_STEP_M = 0.05  # between points of a way: a cell of the grid


def survey(pipeline: Pipeline) -> Array:
    """Places (N, 2), m, map frame, that are worth another look.

    From there the robot could drive onto floor that nobody has seen, or sees some that was seen but
    that no edge leads to.
    """
    grid = occupancy_grid(scans_at(smoothed_keyframes(pipeline), pipeline))
    here, room = pipeline.map_base.position, pipeline.errands.room_m
    ways, found = _ways(pipeline), gaps(grid, here, room)
    if not len(ways):
        return found
    found = np.concatenate([found, blanks(grid, ways, here, room)])
    return viewpoints(grid, ways, found, here, room)


def _ways(pipeline: Pipeline) -> Array:
    """Points (N, 2), m, map frame, along all edges."""
    belief, points = pipeline.mapper.belief, [np.empty((0, 2))]
    for edge in pipeline.mapper.graph.edges.values():
        line = belief.map_vertex(edge.a.vertex).transform(edge.polyline)
        points.append(resampled(line, _STEP_M))
    return np.concatenate(points)
