"""What a mind must remember to go on after a restart; the only place that knows all of it.

The names of the fields are the names in saved missions, and so are those of the values below them:
a field that is added needs a default, and one that is renamed cannot be read any more.
What a moment decides (the order, reflexes, patience) is left to the next moment.
"""

from bisect import bisect_left
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gvgbot.autonomy.candidates import Candidate
from gvgbot.autonomy.ending import Outcome
from gvgbot.autonomy.errands.plans import Kept
from gvgbot.autonomy.exploration.obstructions import Obstructions
from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.hazards import Hazard
from gvgbot.autonomy.keyframes import Keyframe, Step
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.newcomers import Newcomer
from gvgbot.autonomy.odometry_log import OdometryLog
from gvgbot.autonomy.passed import Passed
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.graph import GvgGraph, HalfEdgeId
from gvgbot.autonomy.slam.names import Names
from gvgbot.autonomy.start_edge import StartEdge
from gvgbot.autonomy.views import Observation
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import STANDSTILL, Array, Pose
from gvgbot.hal.messages import Odometry

_LEAST = np.diag([1e-5, 1e-5, 1e-6])  # variance of a step or sighting that had to be made up
_JUMP_M = 0.5  # as no closure of a loop moves the robot
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """A local map: what is free, when each cell was seen, and the walls by their cell's number."""

    corner: NDArray[np.int64]  # (2,) indices of the first cell
    free: NDArray[np.uint8]  # bits, rows after each other
    seen_at: NDArray[np.float32]  # (N, N) metres driven when last seen
    walls: NDArray[np.int64]  # (M,) numbers of the occupied cells
    votes: NDArray[np.int16]  # (M,)
    mean: Array  # (M, 2) local frame
    hits: NDArray[np.float32]  # (M,)
    sight: NDArray[np.float32]  # (M, 2) mean direction to where they were seen from
    # (K,) numbers of the cells that sent lone echoes, glass perhaps, and how many
    glass: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    echoes: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))
    looks: int = 0  # so far, and the mean number of those at each of the walls (M,)
    look: NDArray[np.float32] = field(default_factory=lambda: np.zeros(1, np.float32))
    # the variance of these (M,)
    spread: NDArray[np.float32] = field(default_factory=lambda: np.zeros(1, np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class Odds:
    """What is known to be wrong with odometry: mean (3,) and covariance (3, 3).

    `noises` (4,) is how noisy odometry has proved to be, and `told_of` (4,) how many steps told of
    that. `common` (3, 3) is the covariance of the pose with what is wrong.
    """

    x: Array
    P: Array
    noises: Array = field(default_factory=lambda: np.ones(4))
    told_of: Array = field(default_factory=lambda: np.zeros(4))
    common: Array = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """Ways that were closed: how often each, and since when those that will be tried again."""

    times: dict[HalfEdgeId, int] = field(default_factory=dict)
    since: dict[HalfEdgeId, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Intent:
    """Where the mission stands."""

    where: Whereabouts
    target: HalfEdgeId | None
    outcome: Outcome | None
    reason: str
    budget_m: float
    newest_m: float
    start_edge: StartEdge | None
    frontiers: set[HalfEdgeId]
    closed: Closed
    is_paused: bool = False  # somebody asked for that,
    is_waiting: bool = False  # or for something that has been done,
    errand: Kept | None = None  # or is to be done
    blocked_until: dict[HalfEdgeId, float] = field(default_factory=dict)  # stamps


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """A mind at a keyframe, but for what only ever grows: keyframes, steps and observations."""

    keyframes: int  # that there were
    last: Keyframe | None  # of them, without its scan
    travelled: float
    kept: Pose | None
    belief: Belief
    graph: GvgGraph
    candidates: list[Candidate]
    intent: Intent
    near: Cells
    far: Cells
    odds: Odds
    hazards: list[Hazard]
    newcomers: list[Newcomer] = field(default_factory=list)
    lasting: int | None = None  # keyframes that are kept for good; None: all
    passed: list[Passed] = field(default_factory=list)
    lent: int = 0  # keyframes that came with another's map,
    lent_m: float = 0.0  # and metres driven
    sought_m: float = 0.0  # driven to find its place


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """What one keyframe added: itself, the step to it, and the vertices seen from it."""

    keyframe: Keyframe
    step: Step | None  # None for the first
    observations: list[Observation]


# -- remembering -----------------------------------------------------------------------------------


def remember(pipeline: Pipeline) -> Memory:
    """What there is to remember; it shares its parts with the pipeline, so keep it at once."""
    past, mapper, maps = pipeline.past, pipeline.mapper, pipeline.tracker.maps
    calibration = maps.calibration
    return Memory(
        keyframes=len(past.keyframes),
        last=None if past.last is None else replace(past.last, scan=None),
        travelled=past.travelled,
        kept=past.with_scan,
        belief=ekf.without_trail(mapper.belief),
        graph=mapper.graph.unwalled(),
        candidates=mapper._unbelieved._all,
        intent=_intent(pipeline),
        near=_cells(maps.near),
        far=_cells(maps.far),
        odds=Odds(
            calibration.x,
            calibration.P,
            calibration.noise,
            calibration.told,
            calibration.shared,
        ),
        hazards=pipeline._hazards.felt,
        newcomers=pipeline.traffic.newcomers._all,
        lasting=past.lasting,
        passed=pipeline.traffic.passed,
        lent=past.lent,
        lent_m=past.lent_m,
        sought_m=past.sought_m,
    )


def _intent(pipeline: Pipeline) -> Intent:
    mission, errands = pipeline.mission, pipeline.errands
    closed, names = mission._obstructions, pipeline.mapper.unsettled.names
    return Intent(
        mission.where,
        mission.target,
        mission.outcome,
        mission.reason,
        mission._progress._budget_m,
        mission._progress._newest_m,
        mission._driven.start,
        mission._frontiers,
        Closed(_by_new_names(closed._times, names), _by_new_names(closed._since, names)),
        errands.is_paused and not errands.is_carried,
        errands.will_wait,
        errands.kept(),
        _by_new_names(errands.closures.until, names),
    )


def _by_new_names(values: dict[HalfEdgeId, _T], names: Names) -> dict[HalfEdgeId, _T]:
    return {names.half_edge(end): value for end, value in values.items()}


def _cells(local_map: LocalMap) -> Cells:
    walls = np.flatnonzero(local_map._votes > 0)
    glass = np.flatnonzero(local_map._echoes > 0)
    return Cells(
        local_map._corner,
        np.packbits(local_map._free),
        local_map._seen_at,
        walls,
        local_map._votes.ravel()[walls],
        local_map._mean.reshape(-1, 2)[walls],
        local_map._hits.ravel()[walls],
        local_map._sight.reshape(-1, 2)[walls],
        glass,
        local_map._echoes.ravel()[glass],
        local_map.looks,
        local_map._look.ravel()[walls],
        local_map._spread.ravel()[walls],
    )


def growth(pipeline: Pipeline, start: int = 0, end: int | None = None) -> list[Growth]:
    """What keyframes added from one on, by its number, up to the one before `end`."""
    observations: dict[int, list[Observation]] = {}
    seen_later = bisect_left(pipeline.mapper.observations, start, key=lambda o: o.keyframe)
    for seen in pipeline.mapper.observations[seen_later:]:
        observations.setdefault(seen.keyframe, []).append(seen)
    return [
        Growth(
            pipeline.past.keyframes[i],
            pipeline.past.steps[i - 1] if i > 0 else None,
            observations.get(i, []),
        )
        for i in range(start, len(pipeline.past.keyframes) if end is None else end)
    ]


# -- recalling -------------------------------------------------------------------------------------


def recall(pipeline: Pipeline, memory: Memory, grown: list[Growth]) -> None:
    """Make the mind that was remembered of this one, and take it through what came after.

    Of the past some of the latest may be missing, and some may be younger than the memory. The
    robot is lost a little: the next scan is laid onto the local map from some way around.
    """
    _recall_mapper(pipeline, memory)
    _recall_mission(pipeline.mission, memory.intent)
    pipeline.errands.is_paused = memory.intent.is_paused
    pipeline.errands.is_waiting = memory.intent.is_waiting
    pipeline.errands.recall(memory.intent.errand)
    pipeline.errands.closures.until = memory.intent.blocked_until
    maps = pipeline.tracker.maps
    if _fits(maps.near, memory.near) and _fits(maps._far, memory.far):
        _recall_cells(maps.near, memory.near)
        _recall_cells(maps.far, memory.far)
    calibration = maps.calibration
    calibration.x, calibration.P = memory.odds.x, memory.odds.P
    if len(memory.odds.noises) == len(calibration.noise):  # else it is of an older version
        calibration.noise, calibration.told = memory.odds.noises, memory.odds.told_of
    calibration.shared = memory.odds.common
    pipeline._hazards.felt = list(memory.hazards)
    pipeline.traffic.newcomers._all = list(memory.newcomers)
    pipeline.traffic.passed, pipeline.traffic.lasting = memory.passed, []
    past = pipeline.past
    past.travelled, past.with_scan = memory.travelled, memory.kept
    _recall_past(pipeline, grown[: memory.keyframes])
    if len(grown) < memory.keyframes and memory.last is not None:
        _bridge(pipeline, memory.last)
    for later in grown[memory.keyframes :]:
        _live_again(pipeline, later)
    past.lasting = len(past.keyframes)
    if memory.lasting is not None and memory.lasting < memory.keyframes:
        past.lasting = min(memory.lasting, past.lasting)
    past.lent = min(memory.lent, len(past.keyframes))
    past.lent_m, past.sought_m = memory.lent_m, memory.sought_m
    _tie_vertices(pipeline)
    if past.last is not None:
        _awake(pipeline, past.last)


def _awake(pipeline: Pipeline, last: Keyframe) -> None:
    """Be where the last keyframe was, as after a silence of the base."""
    pipeline.tracker.odometry = OdometryLog()
    pipeline.tracker.odometry.append(Odometry(last.stamp, last.odom_base, STANDSTILL))
    pipeline._look_now = True


def _recall_mapper(pipeline: Pipeline, memory: Memory) -> None:
    mapper = pipeline.mapper
    mapper.belief, mapper.graph = memory.belief, memory.graph
    mapper._unbelieved._all = list(memory.candidates)


def _recall_mission(mission: Mission, intent: Intent) -> None:
    mission.where, mission.target = intent.where, intent.target
    mission.outcome, mission.reason = intent.outcome, intent.reason
    progress = mission._progress
    progress._budget_m, progress._newest_m = intent.budget_m, intent.newest_m
    mission._driven.start, mission._frontiers = intent.start_edge, intent.frontiers
    closed: Obstructions = mission._obstructions
    closed._times, closed._since = intent.closed.times, intent.closed.since


def _fits(local_map: LocalMap, cells: Cells) -> bool:
    """Whether cells are of a map of this size; the configuration may have changed."""
    return cells.seen_at.shape == local_map._seen_at.shape


def _recall_cells(local_map: LocalMap, cells: Cells) -> None:
    shape = cells.seen_at.shape
    local_map._corner, local_map._seen_at = cells.corner, cells.seen_at
    bits = np.unpackbits(cells.free, count=shape[0] * shape[1])
    local_map._free[:] = bits.astype(bool).reshape(shape)
    local_map._votes.ravel()[cells.walls] = cells.votes
    local_map._mean.reshape(-1, 2)[cells.walls] = cells.mean
    local_map._hits.ravel()[cells.walls] = cells.hits
    local_map._sight.reshape(-1, 2)[cells.walls] = cells.sight
    local_map._echoes.ravel()[cells.glass] = cells.echoes
    local_map.looks, local_map._look.ravel()[cells.walls] = cells.looks, cells.look
    local_map._spread.ravel()[cells.walls] = cells.spread
    local_map._renew()


def _recall_past(pipeline: Pipeline, grown: list[Growth]) -> None:
    pipeline.past.keyframes[:] = [one.keyframe for one in grown]
    pipeline.past.steps[:] = [one.step for one in grown if one.step is not None]
    seen = [observation for one in grown for observation in one.observations]
    pipeline.mapper.observations[:] = seen


def _live_again(pipeline: Pipeline, grown: Growth) -> None:
    """Account for a keyframe that is younger than the memory, but for what it would have found."""
    past, mapper = pipeline.past, pipeline.mapper
    keyframe, step = grown.keyframe, grown.step
    if step is not None and past.last is not None:
        mapper.move(step.motion, step.covariance)
        past.steps.append(step)
        past.travelled += past.last.odom_base.distance(keyframe.odom_base)
    past.keyframes.append(keyframe)
    if keyframe.scan is not None:
        past.with_scan, scan = keyframe.local_base, keyframe.scan.unpacked()
        pipeline.tracker.maps.insert(scan, keyframe.local_base, past.travelled)
    for seen in grown.observations:
        if seen.vertex in mapper.belief.ids:
            mapper.belief = ekf.update_in_place(
                mapper.belief, seen.vertex, seen.base_vertex, seen.R
            )
            mapper.observations.append(seen)


def _bridge(pipeline: Pipeline, last: Keyframe) -> None:
    """Let the last keyframe stand in for all that were lost before it."""
    past = pipeline.past
    before = past.last
    if before is not None:
        motion = before.local_base.to(last.local_base)  # which no closure of a loop moves
        as_believed = before.map_base.to(last.map_base)
        if motion.distance(as_believed) > _JUMP_M:  # another local frame, after it was lost
            motion = as_believed
        metres = float(np.hypot(motion.x, motion.y))
        past.steps.append(Step(motion, _LEAST * (1.0 + metres)))
    past.keyframes.append(last)


def _tie_vertices(pipeline: Pipeline) -> None:
    """Let the last keyframe see those vertices whose observations have been lost, as believed."""
    mapper = pipeline.mapper
    ids = set(mapper.belief.ids)
    mapper.observations[:] = [seen for seen in mapper.observations if seen.vertex in ids]
    if not pipeline.past.keyframes:
        return
    for vertex in sorted(ids - {seen.vertex for seen in mapper.observations}):
        base_vertex, _ = ekf.expected(mapper.belief, vertex)
        _, R, _ = ekf.innovation(mapper.belief, vertex, base_vertex, _LEAST)
        number = len(pipeline.past.keyframes) - 1
        mapper.observations.append(Observation(number, vertex, base_vertex, R))
