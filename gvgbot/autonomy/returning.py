"""A mind that comes back to a map it knows: where it was, or lost until it knows better.

If the base vouches that it cannot have moved unnoticed, and the scan agrees with the local map as
it was kept, life goes on there. Otherwise a second mind that knows nothing drives about, and its
local map is laid onto the known one until a single place is left. Before the first vertex there is
hardly a map to find a place on: then a new one begins.
"""

import contextlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.estimate import Estimate, scans_at, smoothed
from gvgbot.autonomy.events import Event, Finished, Recovery, WayForgotten
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.keyframes import UNKNOWN_WAY, Step
from gvgbot.autonomy.localisation import Localisation
from gvgbot.autonomy.memory import Growth, Memory, recall, remember
from gvgbot.autonomy.pipeline import STANDS_CARRIED, Pipeline
from gvgbot.autonomy.placing import be_on_edge, place
from gvgbot.autonomy.relocalisation import Look, Opinion, Relocaliser
from gvgbot.geometry import STANDSTILL, Pose, Twist
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.words import counted

_MOVED_M, _MOVED_RAD = 0.5, 0.3  # farther from where odometry has it, something is wrong
_NOTHING_FELT = Felt()


class ReturningPipeline(Pipeline):
    """A pipeline with a past. Until `is_lost` is false its pose means nothing."""

    def __init__(
        self,
        config: AutonomyConfig,
        exploration: ExplorationConfig,
        robot_radius: float,
        memory: Memory,
        past: list[Growth],
        is_vouched: Callable[[], bool],
        *,
        localisation: Localisation = "full",
    ) -> None:
        """`is_vouched` tells, once the base is heard, whether it counted on all the time."""
        super().__init__(config, exploration, robot_radius, localisation=localisation)
        recall(self, memory, past)
        unwalled = replace(config, virtual_walls=())  # who is lost does not know where they are
        self._unwalled, self._exploration, self._localisation = unwalled, exploration, localisation
        self._is_vouched = is_vouched
        # the best estimate of the map; None as long as that takes
        self.smooth: Callable[[], Estimate | None] = partial(smoothed, self)
        self._is_doubted = False  # the place where it was: it may have been moved
        self._matching = config.scan_matching
        self._is_back = not self.past.keyframes
        is_explored = self.mission.outcome in ("explored", "explored_with_blocked")  # a mere room
        self._is_bare = not (self.mapper.graph.vertices or is_explored)
        self._seeker: Pipeline | None = None
        self._tour: list[int] | None = None  # vertices of its own that it still drives to
        self._relocaliser: Relocaliser
        self._estimate: Estimate

    def configure(self, exploration: ExplorationConfig) -> None:
        """Explore by another configuration from now on, for its place as well."""
        super().configure(exploration)
        self._exploration = exploration
        if self._seeker is not None:
            self._seeker.configure(exploration)

    def _new_mind(self) -> Pipeline:
        settings = self._unwalled, self._exploration, self.radius
        return Pipeline(*settings, localisation=self._localisation)

    @property
    def is_lost(self) -> bool:
        """Whether it does not know where on its map it is."""
        return not self._is_back

    @property
    def is_seeking(self) -> bool:
        """Whether it drives about to find its place: what it knew of it is out of date."""
        return self._seeker is not None

    @property
    def driven(self) -> float:
        """Metres that the robot has driven itself, to find its place as well."""
        return super().driven + (0.0 if self._seeker is None else self._seeker.driven)

    def perceive(self, scan: Scan) -> list[Event]:
        """Learn from a scan; while it is lost, where on the map it was taken."""
        if self._is_back:
            return super().perceive(scan)
        if self.errands.is_resting:  # nobody wants it to drive about
            return []
        if self._seeker is not None:
            return self._seek(self._seeker, scan)
        odom_base = self.tracker.odometry.odom_base_at(scan.stamp)
        if odom_base is None:
            return []
        if not self._is_doubted and self._is_vouched() and self._agrees(scan, odom_base):
            self._is_back = True
            return super().perceive(scan)
        return self._begin_anew(scan) if self._is_bare else self._begin_to_seek(scan)

    def control(self, odometry: Odometry, felt: Felt = _NOTHING_FELT) -> Twist:
        """The twist to drive now."""
        if self._seeker is not None:
            # else it would take its base, or what is before it, for what keeps it from driving
            self._seeker.errands.is_paused = self.errands.is_resting
            return self._seeker.control(odometry, felt)
        twist = super().control(odometry, felt)
        return twist if self._is_back else STANDSTILL

    def _agrees(self, scan: Scan, odom_base: Pose) -> bool:
        """Whether a scan shows the walls that are known where the robot should be."""
        last = self.past.last
        assert last is not None
        before, motion = last.local_base, last.odom_base.to(odom_base)
        felt_s, noise = self.tracker.expected_error(motion, scan.stamp - last.stamp)
        local_base = self.tracker.maps.find(scan, before, motion, felt_s, noise).local_base
        offset = before.compose(motion).to(local_base)
        if np.hypot(offset.x, offset.y) > _MOVED_M or abs(offset.theta) > _MOVED_RAD:
            return False
        return self.tracker.maps.fits(scan, local_base)

    def _begin_anew(self, scan: Scan) -> list[Event]:
        """Forget all, and learn from the scan as from the first one."""
        why, left_out, fresh = "it knew no vertex yet", len(self.past.keyframes), self._new_mind()
        self.errands.give_up(scan.stamp, why)
        is_waiting = self.errands.is_waiting
        recall(self, remember(fresh), [])
        self.errands.is_waiting = is_waiting
        self.tracker.maps, self._is_back = fresh.tracker.maps, True
        happened: list[Event] = [
            Recovery(scan.stamp, "begin a new map", f"it may have been moved, and {why}"),
            WayForgotten(scan.stamp, 0, left_out),
        ]
        return [*happened, *self.errands.take_events(), *super().perceive(scan)]

    # -- lost ------------------------------------------------------------------------------------

    def _begin_to_seek(self, scan: Scan) -> list[Event]:
        self._is_doubted, self.mission.reason = True, "not sure where it is"
        estimate = self.smooth()
        if estimate is None:
            return []
        self._estimate, self._is_doubted = estimate, False
        keyframes, graph = self._estimate.keyframes, self.mapper.graph
        scans = scans_at(keyframes, self)  # of the last keyframes they may be lost
        is_whole = bool(graph.edges) and not graph.frontiers()
        self._relocaliser = Relocaliser(
            scans, self._matching, seen_at=keyframes[-1], is_whole=is_whole
        )
        self._seeker, self._tour = self._new_mind(), None
        self._seeker.tracker.odometry = self.tracker.odometry
        self.errands.unplaced = ""
        return [Recovery(scan.stamp, "look for its place on the map", "it may have been moved")]

    def _seek(self, seeker: Pipeline, scan: Scan) -> list[Event]:
        """Let the second mind drive on; what it finds is of no interest but for the place.

        If it is carried meanwhile it stands, as ever then, and all it has seen is of elsewhere.
        """
        seeker.errands.is_paused = False
        seeker.perceive(scan)
        if seeker.errands.is_carried:
            self.errands.pause()
            self.errands.is_carried = self._is_doubted = True
            self._end_seeking(seeker)
            return [Recovery(scan.stamp, *STANDS_CARRIED)]
        if seeker.errands.unfit:
            self._end_seeking(seeker)
            return self._halt(scan.stamp, seeker.errands.unfit)
        last = seeker.past.last
        if last is None or seeker._execution.is_turning:
            return []
        opinion = self._relocaliser.step(Look.around(last.local_base, seeker.tracker.maps.near))
        if opinion.map_local is not None and opinion.is_sure:
            self._arrive(seeker, opinion.map_local)
            reason = f"{opinion.confidence:.3f} sure after {counted(opinion.looks, 'look')}"
            return [Recovery(scan.stamp, "go on from its place on the map", reason)]
        self.mission.reason = _doubt(opinion)
        if not opinion.is_hopeless and self._goes_on(seeker, scan.stamp):
            return []
        self.mission.reason = self.errands.unplaced = _given_up(opinion)
        self.mission.outcome = "failed"
        self._end_seeking(seeker)
        return [Finished(scan.stamp, "failed", self.mission.reason)]

    def _goes_on(self, seeker: Pipeline, stamp: float) -> bool:
        """Whether there is more to see: when all is explored, once more what was seen long ago."""
        if not seeker.errands.is_resting:
            return True
        vertices = seeker.mapper.graph.vertices
        if self._tour is None:
            self._tour = sorted(vertices, key=lambda v: vertices[v].seen_at, reverse=True)
        while self._tour:
            with contextlib.suppress(Declined):
                seeker.errands.goto_vertex(self._tour.pop(), stamp)
                return True
        return False

    def _end_seeking(self, seeker: Pipeline) -> None:
        self.past.sought_m += seeker.driven
        self._seeker = None

    def _arrive(self, seeker: Pipeline, map_local: Pose) -> None:
        """Be at a place, in the second mind's local frame and with its local maps."""
        found, last = seeker.past.last, self.past.last
        assert found is not None
        assert last is not None
        map_before = self.mapper.belief.map_base.compose(last.local_base.inverse())
        place(
            self.mission,
            self.mapper,
            self._estimate.vertices,
            map_local.compose(found.local_base),
            self.past.travelled - self._config.recognition.tracked_m,
        )
        map_base = self.mapper.belief.map_base
        map_local = map_base.compose(found.local_base.inverse())
        before = self.past.travelled - seeker.past.travelled
        self._hazards.take_over(seeker._hazards, map_local.to(map_before), before)
        seeker.tracker.maps.count_on(before)
        self.tracker.take_over(seeker.tracker)
        self.gvg, self._reflexes = seeker.gvg, seeker._reflexes
        self.traffic.newcomers = seeker.traffic.newcomers
        be_on_edge(self.mission, self.mapper, found.local_base)
        self.past.keyframes.append(replace(found, map_base=map_base))
        self.past.steps.append(Step(last.map_base.to(map_base), UNKNOWN_WAY))
        self.past.with_scan = None
        self._look_now = self._is_back = True
        self._end_seeking(seeker)


def _given_up(opinion: Opinion) -> str:
    """How unsure it is when nothing is left to look at, and what to do about it."""
    doubt = _doubt(opinion).removesuffix(" yet")
    return f"{doubt}; start it where it stopped, or begin a new map (gvgbot run --new)"


def _doubt(opinion: Opinion) -> str:
    """How unsure it is, in words."""
    if not opinion.possible:
        return "not sure where it is: no place on the map fits yet"
    if opinion.is_hopeless:
        return f"not sure where it is: all the map looks the same from {opinion.possible} places"
    places = "place fits" if opinion.possible == 1 else "places fit"
    return (
        f"not sure where it is: {opinion.possible} {places}, {opinion.confidence:.2f} for the best"
    )
