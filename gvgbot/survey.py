"""What a robot that has explored all has still not seen: gaps in the grid of all its scans."""

from gvgbot.autonomy.estimate import smoothed_keyframes
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.geometry import Array
from gvgbot.maps.gaps import gaps
from gvgbot.maps.occupancy import occupancy_grid

_RESOLUTION_M, _REACH_M = 0.1, 8.0  # coarser than the saved grid: the robot stands and waits for it


def survey(pipeline: Pipeline) -> Array:
    """Places (N, 2), m, map frame, on seen floor from which the robot could drive onto unseen."""
    poses = smoothed_keyframes(pipeline)
    scans = [
        (pose, keyframe.scan)
        for pose, keyframe in zip(poses, pipeline.keyframes, strict=True)
        if keyframe.scan is not None
    ]
    return gaps(
        occupancy_grid(scans, _RESOLUTION_M, _REACH_M),
        pipeline.map_base.position,
        pipeline.errands.room_m,
    )
