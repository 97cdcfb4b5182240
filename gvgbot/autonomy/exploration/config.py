"""What is worth a drive to an exploring robot, and how much patience it has."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from gvgbot.autonomy.exploration.certainty import CertaintyConfig
from gvgbot.ranges import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationConfig:
    """What is worth a drive, and when to give up.

    `ears`: at the end of an edge the next one clockwise, and the nearest frontier when there is
    none. `nearest`: always the nearest; at a vertex with several, the next clockwise. `balanced`:
    as `nearest`, but the standard deviation of a frontier's place counts, too.
    """

    # which frontier comes next, see above
    policy: Literal["ears", "nearest", "balanced"] = "nearest"
    detour_m_per_m: Annotated[float, Range(0.0, 1000.0)] = (
        50.0  # for less standard deviation, if balanced
    )
    certainty: CertaintyConfig = field(default_factory=CertaintyConfig)
    drive_dead_ends: bool = False  # although the end of a dead end can be seen from its mouth
    patience_m: Annotated[float, Range(5.0, 1000.0)] = (
        60.0  # driven beyond twice the way to a frontier
    )
    patience_s: Annotated[float, Range(10.0, 3600.0)] = 60.0  # without coming nearer to anything
    look_around_s: Annotated[float, Range(0.5, 60.0)] = (
        3.0  # standing at the end of sight before turning
    )
    in_the_way_s: Annotated[float, Range(1.0, 600.0)] = (
        10.0  # behind something before another way is tried
    )
    retry_after_s: Annotated[float, Range(0.0, 3600.0)] = 20.0  # and at the end, that way again,
    retries: Annotated[int, Range(0, 20)] = 3  # so many times
    # a way that something stood in is not driven by errands for so long
    remember_blocked_s: Annotated[float, Range(0.0, 86400.0)] = 300.0
    nothing_in_sight_s: Annotated[float, Range(2.0, 600.0)] = (
        20.0  # without any edge before giving up
    )
