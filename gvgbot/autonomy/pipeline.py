"""Every stage from HAL messages to a twist, in the order of the flow. No I/O, clock or chance."""

from dataclasses import replace
from functools import partial

import numpy as np

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.control.execution import Execution
from gvgbot.autonomy.control.orders import Drive, Stand
from gvgbot.autonomy.control.reflexes import (
    AWAY_M,
    LONGEST_GAP_S,
    WAITS,
    Felt,
    Held,
    Hit,
    Incident,
    Moment,
    PutDown,
    Reflexes,
)
from gvgbot.autonomy.control.room import room_ahead
from gvgbot.autonomy.defects import Defects
from gvgbot.autonomy.errands import Errands
from gvgbot.autonomy.errands.kinds import Look
from gvgbot.autonomy.events import EdgeJoined, Event, Recovery, VertexAdded, WayForgotten
from gvgbot.autonomy.exploration.config import ExplorationConfig
from gvgbot.autonomy.gvg.beams import without_mixed_pixels
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.hazards import Hazards
from gvgbot.autonomy.keyframes import Past, has_come_on
from gvgbot.autonomy.localisation import Localisation
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.obedience import DOES_NOT_MOVE
from gvgbot.autonomy.overlooked import blind_angle
from gvgbot.autonomy.placing import LATELY_M, search_near_by
from gvgbot.autonomy.pose_tracking import PoseTracker
from gvgbot.autonomy.sight import Sight
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.traffic import Traffic
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import STANDSTILL, Array, Pose, Twist, wrap_angle
from gvgbot.hal.messages import Odometry, Scan
from gvgbot.hal.packed_scan import Sweep
from gvgbot.hal.sweep import has_sight

_NOTHING_FELT = Felt()
_LOOKS_ASIDE = (
    "the laser does not see where the robot drives: say how it is mounted by laser.yaw_deg, "
    "or widen laser.first_angle_deg and laser.last_angle_deg, and restart the program"
)
_CANNOT_TURN = "go on without a look around", "the base does not turn"
_ROOM_BESIDE_EDGES_M = 0.08  # on each side, where no edge leads
_SEARCHES_NEAR_BY = "look for its place near by", "the base has started anew"
STANDS_CARRIED = (
    "stand until it is asked to resume",
    "no walls that it knows are around it, and it was lifted or its base has started anew: if it "
    "was carried, restart the program, and it looks for its place on the whole map",
)
_LED_EVERY_M, _LED_EVERY_RAD = 0.4, 2.0  # looks for the GVG, where nobody waits for a way


class Pipeline:
    """The robot's mind: feed it odometry and scans, ask it for twists."""

    def __init__(
        self,
        config: AutonomyConfig,
        exploration: ExplorationConfig,
        robot_radius: float,
        *,
        led: bool = False,
        localisation: Localisation = "full",
    ) -> None:
        """`led` if somebody else drives: it only learns, and its twists mean nothing."""
        self._config, self.radius, self.led = config, robot_radius, led
        self.mapper = Mapper(
            config.mapping,
            config.recognition,
            config.scan_matching,
            drive_dead_ends=exploration.drive_dead_ends,
            by_position=localisation == "paper",
        )
        self.tracker = PoseTracker(config, matches_walls=localisation != "paper")
        self.mission = Mission(exploration, self.mapper)
        self.errands = Errands(
            self.mission, self.mapper, exploration, robot_radius + _ROOM_BESIDE_EDGES_M
        )
        self._reflexes = Reflexes(config.reflexes)
        self._hazards = Hazards(config.hazards)
        self.traffic = Traffic(config.newcomers)
        self.sight = Sight(config, robot_radius, self.mapper, self._hazards, self.traffic)
        self._defects = Defects(config.scan_matching)
        self._told = STANDSTILL  # what the base is to do
        self._incidents: list[tuple[str, str]] = []  # action and reason, since the last scan
        self._look_now = False
        self._doubted: int | None = None  # keyframe since which somebody doubts the pose
        self._looked: Pose | None = None  # local_base of the last look for the GVG
        self._execution = Execution(config.edge_follower, robot_radius)
        self.gvg = LocalGvg()
        self.past = Past()

    def configure(self, exploration: ExplorationConfig) -> None:
        """Explore by another configuration from now on."""
        self.errands.configure(exploration)

    # -- state -----------------------------------------------------------------------------------

    @property
    def matching(self) -> ScanMatchingConfig:
        """How scans are laid onto walls."""
        return self._config.scan_matching

    @property
    def matches_walls(self) -> bool:
        """Whether walls tell where it is, and not odometry and vertices alone."""
        return self.tracker.matches_walls

    @property
    def is_lost(self) -> bool:
        """Whether it does not know where on its map it is."""
        return False

    @property
    def is_seeking(self) -> bool:
        """Whether it drives about to find its place: what it knew of it is out of date."""
        return False

    @property
    def driven(self) -> float:
        """Metres that the robot has driven itself."""
        return self.past.driven

    @property
    def _is_idle(self) -> bool:
        """Whether it rests, and no other robot of its team may want to pass, or be recognised."""
        rests, stands_by = self.errands.is_resting, self.errands.stands_by
        return rests and not (stands_by and self.traffic.is_somebody_about(self.map_base))

    @property
    def map_base(self) -> Pose:
        """The pose as believed now."""
        last, newest = self.past.last, self.tracker.odometry.newest
        if last is None or newest is None:
            return Pose()
        return self.mapper.belief.map_base.compose(last.odom_base.to(newest.odom_base))

    def map_base_at(self, stamp: float) -> Pose | None:
        """The pose as believed now to have been a moment ago; None if odometry does not tell."""
        last, odom_base = self.past.last, self.tracker.odometry.odom_base_at(stamp)
        if last is None or odom_base is None:
            return None
        return self.mapper.belief.map_base.compose(last.odom_base.to(odom_base))

    @property
    def track(self) -> Array:
        """What is being driven along (N, 2), m, map frame; no point while standing or turning."""
        last, order = self.past.last, self._execution.order
        if last is None or not isinstance(order, Drive):
            return np.zeros((0, 2))
        map_local = self.mapper.belief.map_base.compose(last.local_base.inverse())
        return map_local.transform(order.track.polyline)

    # -- perception, per scan --------------------------------------------------------------------

    def perceive(self, scan: Scan) -> list[Event]:
        """Learn from a scan, if it was taken somewhere new; what happened."""
        happened: list[Event] = [Recovery(scan.stamp, *what) for what in self._incidents]
        self._incidents.clear()
        odom_base = self.tracker.odometry.odom_base_at(scan.stamp)
        if odom_base is None:
            return happened
        self._glance(scan, odom_base)
        if not self._worth_a_look(scan, odom_base):
            self.tracker.maps.catch_up()
            return happened
        if self.past.last is not None:
            self.mission.skip(max(0.0, scan.stamp - self.past.last.stamp - LONGEST_GAP_S))
        defect = self._defects.note_scan(scan, odom_base, self._told)
        if defect is not None and not self.led:
            return [*happened, *self._halt(scan.stamp, defect, spoils_map=defect != DOES_NOT_MOVE)]
        motion = self.tracker.odometry.motion_during(scan)
        sweep = Sweep.of(without_mixed_pixels(scan), motion)
        local_base = self._localise(sweep.deskewed, odom_base)
        if local_base is None:
            return happened
        whole = sweep.deskewed
        scan = self._sift(whole, local_base)
        free = self.traffic.newcomers.free(whole, local_base)
        maps, travelled = self.tracker.maps, self.past.travelled
        for one in self.traffic.nearby(self.mapper.map_in_local(local_base)):
            maps.near.stand_on(one.pose.position, one.radius, travelled)
        maps.insert(scan, local_base, travelled, free)
        self.sight.note(whole, local_base.position, maps.near, travelled)
        if self.led and not self._worth_a_gvg(local_base):
            self.past.keep(scan, odom_base, local_base, self.mapper.belief.map_base, sweep)
            return happened
        view = self.sight.view(scan, local_base, maps.near, len(self.past.keyframes), travelled)
        self.gvg = view.gvg
        known, learnt = self.mapper.observe(view)
        self.past.keep(scan, odom_base, local_base, self.mapper.belief.map_base, sweep)
        done = self._act(view, known, scan)
        happened += learnt + done  # what was done may have taught the mapper more
        return happened + self._forget(scan.stamp, happened)

    def _halt(self, stamp: float, reason: str, *, spoils_map: bool = True) -> list[Event]:
        """Stand until it is started anew: it cannot drive by what it sees, or not at all."""
        self.errands.halt(stamp, reason, spoils_map=spoils_map)
        return [*self.errands.take_events(), self.mission.stop(stamp, reason, "failed")]

    def _glance(self, scan: Scan, odom_base: Pose) -> None:
        """Look out for other robots in every scan: they move."""
        if self.past.last is not None:
            self.traffic.glance(scan, self.past.last.local_base_at(odom_base))

    def _sift(self, scan: Scan, local_base: Pose) -> Scan:
        """The scan without what may be people or robots; the mission hears of the robots."""
        self.mission.meet(local_base, self.traffic.nearby(self.mapper.map_in_local(local_base)))
        walls, now = self.tracker.maps.near, len(self.past.keyframes)
        return self.traffic.sift(scan, local_base, self.mapper, walls, now)

    def _act(self, view: View, known: Correspondence, scan: Scan) -> list[Event]:
        """Decide what to do next; what happened by that."""
        if self.led:
            return self.mission.witness(view, known)
        if self._execution.cannot_turn:
            self._execution.stand()
            self._incidents.append(_CANNOT_TURN)
        if self._execution.is_turning:
            return []
        if len(self.past.keyframes) == 1:
            if not scan.looks_ahead:
                return self._halt(scan.stamp, _LOOKS_ASIDE)
            self._execution.turn(blind_angle(scan))
            return []
        if self._doubted is not None and len(self.past.keyframes) > self._doubted + 1:
            placed = self._search_near_by(view)
            if placed:
                return placed
        order, done = self.errands.advance(view, known)
        if isinstance(order, Drive) and self.traffic.is_in_team:
            room = self.radius, self._config.passage_margin_m
            map_in_local = self.mapper.map_in_local(view.local_base)
            order = Drive(self.traffic.led_round(order.track, view, map_in_local, *room))
        self._execution.obey(order)
        return done

    def _worth_a_look(self, scan: Scan, odom_base: Pose) -> bool:
        """Whether it is about something, not covered, and has come on, turned or waited enough."""
        last, c = self.past.last, self._config.keyframe
        if self._reflexes.is_lifted:
            return False
        if last is not None:
            if self._is_idle or self._reflexes.is_plugged_in:
                return False
            is_due = self._look_now or scan.stamp - last.stamp >= c.interval_s
            is_due |= has_come_on(last.odom_base, odom_base, c.distance_m, c.turn_rad)
            if not (is_due and (self.led or has_sight(scan))):
                return False  # covered, it does not drive either
        self._look_now = False
        return True

    def _worth_a_gvg(self, local_base: Pose) -> bool:
        """Whether a robot that is led has come on; it is taken down."""
        is_worth = has_come_on(self._looked, local_base, _LED_EVERY_M, _LED_EVERY_RAD)
        if is_worth:
            self._looked = local_base
        return is_worth

    def _localise(self, scan: Scan, odom_base: Pose) -> Pose | None:
        """The base in the local frame; None, and the robot stands, if it may be anywhere."""
        is_broken = self.tracker.notice_break()
        if self.past.last is None:
            return Pose()
        is_doubted, self.errands.is_lost = self.errands.is_lost, False
        if is_doubted and isinstance(self.errands.errand, Look):
            self._doubted = len(self.past.keyframes)
        if is_broken:
            self._incidents.append(_SEARCHES_NEAR_BY)
        local_base = self.tracker.track(
            scan, odom_base, self.past, self.mapper, is_broken=is_broken, is_doubted=is_doubted
        )
        if local_base is None:
            self.errands.pause()
            self.errands.is_lost = self.errands.is_carried = True
            self._incidents.append(STANDS_CARRIED)
        return local_base

    def _forget(self, stamp: float, happened: list[Event]) -> list[Event]:
        """Leave out the way but its end, if it has become long and there was nothing to learn."""
        past = self.past
        is_new = any(isinstance(event, VertexAdded | EdgeJoined) for event in happened)
        if is_new or self.errands.is_exploring:
            past.lasting = len(past.keyframes)
        is_long = len(past.keyframes) > past.lasting + self._config.keyframe.latest
        # what was seen since somebody doubted the pose is yet to be compared with the map
        return [self._leave_out(stamp)] if is_long and self._doubted is None else []

    def _leave_out(self, stamp: float) -> Event:
        past = self.past
        left_out = past.leave_out()
        self.mapper.forget_between(past.lasting, past.lasting + left_out)
        self.traffic.passed = [one.before(past.lasting) for one in self.traffic.passed]
        return WayForgotten(stamp, past.lasting, left_out)

    def _search_near_by(self, view: View) -> list[Event]:
        """After a look around because somebody doubts the pose, compare that with the map.

        What was seen since the last new place, or since that, was drawn where the robot was not.
        """
        past, first, self._doubted = self.past, self._doubted, None
        seen, old, seen_at = past.keyframes[first:], past.old(LATELY_M), past.travelled - LATELY_M
        placed = search_near_by(self.mission, self.mapper, view, seen, old, self.matching, seen_at)
        if placed is None:
            return []
        self._execution.stand()
        self._look_now = True
        past.keyframes[-1] = replace(past.keyframes[-1], map_base=self.mapper.belief.map_base)
        return [placed, self._leave_out(view.stamp)]

    # -- control, per odometry message -------------------------------------------------------------

    def control(self, odometry: Odometry, felt: Felt = _NOTHING_FELT) -> Twist:
        """The twist to drive now."""
        before = self.tracker.odometry.newest
        if before is not None:
            turned = wrap_angle(odometry.odom_base.theta - before.odom_base.theta)
            since_s = odometry.stamp - before.stamp
            is_free = not self._is_idle and felt.stopped_for not in WAITS
            free_s = since_s if is_free and since_s < LONGEST_GAP_S else 0.0
            self._execution.note_turn(turned, free_s)
            unhindered_s = 0.0 if felt.stopped_for else free_s
            self._defects.note_motion(odometry.odom_base, self._told, unhindered_s)
        self.tracker.odometry.append(odometry)
        if self.past.last is None or self.led:
            return STANDSTILL
        local_base = self.past.last.local_base_at(odometry.odom_base)
        moment = Moment(odometry.stamp, local_base, self._wish(local_base), felt)
        twist, incident = self._reflexes.act(moment, partial(self._room, local_base))
        command = self.errands.command(odometry.stamp)
        if command is not None and not self._reflexes.is_lifted:
            self._execution.stand()
            twist = command
        if self._is_idle:  # whoever touches it then is no obstacle
            incident, twist = incident if isinstance(incident, PutDown) else None, STANDSTILL
        if incident is not None:
            self._take_down(incident, local_base)
        self._told = twist
        return twist

    def _wish(self, local_base: Pose) -> Twist:
        """The twist that carries out the present order."""
        if self._is_idle:
            self._execution.order = Stand()
            return STANDSTILL
        return self._execution.wish(local_base, partial(self._careful, local_base))

    def _careful(self, local_base: Pose, twist: Twist) -> Twist:
        """The twist, slow enough to stop with room for somebody ahead who comes as fast."""
        if not self.traffic.is_in_team or self.past.last is None:
            return twist
        map_in_local = self.mapper.map_in_local(self.past.last.local_base)
        slow = self._config.edge_follower.min_speed_mps
        careful = self.traffic.careful(twist, local_base, map_in_local, self.radius, slow)
        if careful.linear == 0.0 < twist.linear:
            self.errands.hold()
        return careful

    def _room(self, local_base: Pose, bearing: float) -> float:
        """How far the robot can go straight at a bearing over what it knows to be free, m."""
        turned = Pose(local_base.x, local_base.y, local_base.theta + bearing)
        farthest = max(AWAY_M, self._config.reflexes.back_off_m)
        others = np.concatenate([self.traffic.newcomers.points, self._hazards.points])
        margin = self._config.passage_margin_m
        return room_ahead(
            self.tracker.maps.near, others, turned, farthest, radius=self.radius, margin=margin
        )

    def _take_down(self, incident: Incident, local_base: Pose) -> None:
        """Let the next look, which is due now, take account of an incident."""
        self._look_now = True
        match incident:
            case Hit(cause=cause, bearings=bearings):
                self._incidents.append(("back off", cause))
                self._defects.note_hit(cause)
                blocks = self._hazards.add(
                    local_base, bearings, self.radius, self.past.travelled, lasting=cause == "cliff"
                )
                if blocks:
                    self.errands.obstruct(f"{cause} again and again")
            case Held(action=action):
                self._incidents.append((action, "something is in the way"))
                self.errands.hold()
            case PutDown():
                self.errands.note_lifted()
                self._incidents.append(("look around", "the robot was lifted"))
                self.tracker.was_lifted = True
