"""The robot in real time: explores, stands when done, reports, saves, and outlives lost devices."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Protocol

import structlog

from gvgbot.autonomy import events
from gvgbot.autonomy.errands import Declined
from gvgbot.autonomy.estimate import smoothed
from gvgbot.autonomy.loop import Loop
from gvgbot.autonomy.returning import ReturningPipeline
from gvgbot.beside_loop import BesideLoop
from gvgbot.clock import Clock, LoopClock, OffLoop
from gvgbot.config import Config
from gvgbot.geometry import STANDSTILL, Twist
from gvgbot.hal.guard import Guard, Reason
from gvgbot.hal.messages import Contact, Odometry, Scan
from gvgbot.hal.own_parts import OwnParts, how_to_clear
from gvgbot.journal import BatteryJournal, GuardJournal, log_event, status_line
from gvgbot.links import Devices, Links
from gvgbot.live.events import LiveEvents
from gvgbot.live.feed import LiveFeed, Pace
from gvgbot.live.map import LiveMap, Update
from gvgbot.live.past import CORRECTIONS
from gvgbot.live.ros import LiveRos, Neighbour, UnixTime
from gvgbot.live.team import LiveTeam, TeamNetwork
from gvgbot.persistence.keeper import Keeper
from gvgbot.requests import Answer, Asked
from gvgbot.saving import Saving
from gvgbot.service import Notifier
from gvgbot.session import Session
from gvgbot.simulation import Simulation
from gvgbot.snapshots import sign, state
from gvgbot.steering import Steering
from gvgbot.survey import survey
from gvgbot.topics import HEALTH, MAP, STATE, STUCK_AFTER, Health, Payload, State
from gvgbot.vitals import Vitals

CALL_EVERY = 10.0  # s between two attempts to drive home with a low battery
_DRIVEN = "it is driven until it is asked for something else"

log = structlog.get_logger()


class Network(Protocol):
    """Where the robot is watched from."""

    failures: int  # samples that could not be sent

    def publish(self, value: Payload, latest: Payload | None = None) -> None:
        """Send without waiting; from any thread. `latest`: what to answer who asks, if not that."""

    def is_heard(self, payload: type[Payload]) -> bool:
        """Whether to send values of a type; not, if nobody listens and none are kept."""

    async def answer(self) -> None:
        """Answer queries until cancelled."""

    async def hear(self, handle: Callable[[Asked], Awaitable[Answer]]) -> None:
        """Put requests to the handler until cancelled."""


class Driver(Protocol):
    """Somebody who may want to drive."""

    async def hear(self, drive: Callable[[Twist], None]) -> None:
        """Hand on twists as they come, until cancelled."""


class Robot:
    """One exploration as a daemon. `off_loop` runs a function that takes long, and waits for it."""

    _clock: Clock
    _vitals: Vitals
    _devices: Devices
    _loop: Loop
    _steering: Steering

    def __init__(
        self,
        session: Session,
        notifier: Notifier,
        network: Network | None,
        off_loop: OffLoop = asyncio.to_thread,
        keeper: Keeper | None = None,
        *,
        neighbours: Sequence[Neighbour] = (),
        driver: Driver | None = None,
        team: TeamNetwork | None = None,
    ) -> None:
        """`keeper` keeps the mission on disk; without one a restart begins anew.

        `neighbours` are told what is to be seen, a `driver` may drive, and robots of a `team` share
        the frontiers.
        """
        self._team: LiveTeam | None = None
        if team is not None:
            config = session.config
            self._team = LiveTeam(config.robot, config.team, session.pipeline, team)
            session.member = self._team.member
        self._neighbours, self._driver = neighbours, driver
        self._session, self._notifier = session, notifier
        self._network, self._off_loop, self._keeper = network, off_loop, keeper
        self._pipeline = session.pipeline
        self._saving = Saving(session, off_loop)
        self._survey = BesideLoop(session.pipeline, survey)
        self._pipeline.mission.survey = self._survey.newest
        self._estimate = BesideLoop(session.pipeline, smoothed)
        if isinstance(self._pipeline, ReturningPipeline):
            self._pipeline.smooth = self._estimate.newest
        self._odometry: Odometry | None = None
        self._sequence, self._ready = 0, False
        self._events = LiveEvents()
        self._decided = ""  # the reason of the last decision
        self._not_driven = ""  # why nobody may drive it just now
        self._feed: LiveFeed | None = None
        self._live_map: LiveMap | None = None
        if network is not None:
            rate_hz = session.config.telemetry.scan_rate_hz
            self._feed = LiveFeed(network, session.pipeline, rate_hz)
        self._guard, self._battery = GuardJournal(), BatteryJournal()
        self._own_parts = OwnParts(session.config.robot.radius_m)
        self._healths, self._calls_home = Pace(HEALTH.rate_hz), Pace(1.0 / CALL_EVERY)
        self._ros: LiveRos | None = None

    # -- the tasks ---------------------------------------------------------------------------------

    async def serve(self, stopped: Awaitable[str], links: Links | None = None) -> None:
        """Live until `stopped` returns; the base stands still then."""
        self._clock = LoopClock() if self._keeper is None else self._keeper.clock()
        links = self._open_links() if links is None else links
        self._prepare(links)
        self._vitals = Vitals(self._clock.now())
        work = {
            "devices": self._devices.run(),
            "explore": self._explore(),
            "beat": self._beat(),
            "events": self._saving.keep_written(),
            "save": self._saving.keep_saved(),
            "survey": self._survey.work(self._off_loop),
            "estimate": self._estimate.work(self._off_loop),
        }
        if self._keeper is not None:
            self._keeper.attach(links.feedback)
            work["keep"] = self._keeper.keep(self._clock, self._off_loop)
        if self._network is not None:
            work["network"] = self._network.answer()
            work["map"] = self._keep_shown(self._network)
            work["requests"] = self._network.hear(self._answer)
        if self._ros is not None:
            work["neighbours"] = self._ros.keep_shown(self._clock, self._off_loop)
        if self._team is not None:
            work["team"] = self._team.take_part(self._clock, self._off_loop)
        if self._driver is not None:
            work["driver"] = self._driver.hear(self._let_drive)
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(task, name=name) for name, task in work.items()]
            log.info("stopping", signal=await stopped)
            self._notifier.stopping()
            self._steering.close()
            for task in serving:
                task.cancel()

    async def _answer(self, asked: Asked) -> Answer:
        """Do what is asked for, and keep it before that is answered."""
        answer = await self._steering.handle(asked)
        if answer.done and self._keeper is not None:
            await self._keeper.wish_kept()
        return answer

    def stand(self) -> None:
        """Tell the base to stand, until the next control cycle."""
        self._devices.base.drive(STANDSTILL)

    async def _explore(self) -> None:
        """Drive, or stand, until cancelled."""
        await self._loop.run()

    def _open_links(self) -> Links:
        session = self._session
        if session.place is not None:
            session.simulation = Simulation(session.config, session.place, self._clock)
        return Links(session.config, self._clock, session.simulation, session.tap)

    def _prepare(self, links: Links) -> None:
        robot = self._session.config.robot
        self._devices = Devices(links)
        self._devices.laser.on_scan = self._show_scan
        if self._neighbours:
            self._ros = LiveRos(
                self._neighbours,
                self._pipeline,
                self._session.config.autonomy.odometry_noise,
                UnixTime(self._clock.now),
            )
        self._loop = Loop(
            self._devices.laser,
            self._devices.base,
            self._pipeline,
            Guard(robot.limits, robot.radius_m),
            on_events=self._on_events,
            on_cycle=self._on_cycle,
            log=self._session.recorder,
            goes_on=lambda: True,
        )
        self._steering = Steering(
            self._session.config,
            self._pipeline.errands,
            self,
            now=self._clock.now,
            save=self._saving.save,
            use=self._use,
            tell=self._on_events,
        )

    def _show_scan(self, scan: Scan) -> None:
        own = self._own_parts.note(scan)
        if own is not None and len(own):
            remedy = how_to_clear(own)
            log.warning("laser sees a part of the robot", beams=len(own), remedy=remedy)
        for shown in (self._feed, self._ros):
            if shown is not None:
                shown.on_scan(scan)

    def _let_drive(self, twist: Twist) -> None:
        """Let somebody drive, unless the robot is paused or does not know its surroundings yet.

        Why not is told once, however often it is asked.
        """
        stamp, errands = self._clock.now(), self._pipeline.errands
        try:
            is_new, text = errands.drive(twist, stamp), _DRIVEN
        except Declined as error:
            is_new, text = str(error) != self._not_driven, str(error)
        is_done = text == _DRIVEN
        self._not_driven = "" if is_done else text
        if is_new:
            asked = events.Requested(stamp, "cmd_vel", "ROS 2", is_done, text)
            self._on_events([asked, *errands.take_events()])

    def _use(self, config: Config) -> None:
        """Put a configuration into effect, as far as that can be changed."""
        self._session.config = config
        self._pipeline.configure(config.exploration)
        self._loop.guard_by(Guard(config.robot.limits, config.robot.radius_m))

    # -- what the robot feels ----------------------------------------------------------------------

    @property
    def away(self) -> str | None:
        """Which devices are missing, and why."""
        return self._devices.away

    @property
    def contact(self) -> Contact | None:
        """What the base feels."""
        return self._devices.base.contact

    @property
    def stopped_for(self) -> Reason | None:
        """Why the guard holds the robot."""
        return self._loop.stopped_for

    async def _keep_shown(self, network: Network) -> None:
        """Publish the map as it grows."""
        due = self._clock.now()
        self._live_map = LiveMap(began=due)
        while True:
            draw = self._live_map.update(self._pipeline, self._clock.now())
            if draw is not None:
                await self._off_loop(partial(_publish_drawn, network, draw))
            due = max(due + 1.0 / MAP.rate_hz, self._clock.now())
            await self._clock.sleep_until(due)

    async def _beat(self) -> None:
        """Tell everybody how things are, a few times a second."""
        due = self._clock.now()
        while True:
            self._report()
            due = max(due + 1.0 / STATE.rate_hz, self._clock.now())
            await self._clock.sleep_until(due)

    # -- what happens ------------------------------------------------------------------------------

    def _on_events(self, happened: list[events.Event]) -> None:
        self._saving.on_events(happened)
        for event in happened:
            log_event(event)
            self._events.note(event)
            if self._keeper is not None:
                self._keeper.on_event(event)
            if isinstance(event, events.Decision):
                self._decided = event.reason
            if isinstance(event, CORRECTIONS):
                self._doubt_the_past()

    def _doubt_the_past(self) -> None:
        """Let what is shown of it be drawn anew."""
        for shown in (self._live_map, self._ros):
            if shown is not None:
                shown.doubt()

    def _on_cycle(self, odometry: Odometry) -> None:
        self._note(odometry)
        if not self._pipeline.errands.is_resting:
            self._session.on_cycle(odometry, self._devices.base.contact)
        if self._pipeline.past.keyframes or self._pipeline.mission.outcome is not None:
            self._be_ready()  # a scan and odometry made the first
        if self._ready:
            self._guard.note(self._loop.stopped_for, odometry.stamp)

    def _be_ready(self) -> None:
        if not self._ready:
            self._ready = True
            self._notifier.status(status_line(self._state()))  # of a robot that is ready
            self._notifier.ready()

    def _note(self, odometry: Odometry) -> None:
        self._odometry = odometry
        self._vitals.note_cycle(self._clock.now() - odometry.stamp)
        for shown in (self._feed, self._ros):
            if shown is not None:
                shown.on_odometry(odometry)

    def _report(self) -> None:
        """Publish the state; tell the service manager, unless the control loop is stuck."""
        now = self._state()
        self._sequence += 1
        if self._feed is not None:
            self._feed.on_beat(now.stamp, self._decided)
        if self._network is not None:
            self._network.publish(now)
            if self._healths.allows(now.stamp):
                self._network.publish(self._health(self._network, now))
            happened = self._events.news()
            if happened is not None:
                self._network.publish(happened)
        needs_somebody = self._guard.needs_somebody
        self._notifier.status(status_line(now, needs_somebody=needs_somebody))
        self._heed_battery(now.stamp)
        shown = sign(now, is_lost=self._pipeline.is_lost, needs_somebody=needs_somebody)
        self._devices.base.show(shown)
        stuck = now.cycle_age is not None and now.cycle_age > STUCK_AFTER
        if not stuck or self._devices.base.away is not None:
            self._notifier.alive()

    def _heed_battery(self, stamp: float) -> None:
        """Drive home when it is low, as soon as that can be."""
        self._battery.note(self._devices.base.battery, stamp)
        is_called = self._battery.calls_home and self._session.config.service.home_when_low
        if not is_called:
            self._steering.call_off()
        elif self._calls_home.allows(stamp):
            self._battery.calls_home = not self._steering.go_home("low battery")

    def _health(self, network: Network, now: State) -> Health:
        return self._vitals.health(
            now.stamp, unsent=network.failures, laser=now.laser, base=now.base
        )

    def _state(self) -> State:
        now = self._clock.now()
        return state(
            self._pipeline,
            self._odometry,
            self._devices.base.battery,
            stamp=now,
            sequence=self._sequence,
            cycles=self._vitals.cycles,
            uptime=self._vitals.uptime(now),
            noise=self._session.config.autonomy.odometry_noise,
            away=self._devices.away,
            guard=self._loop.stopped_for,
            contacts=self._session.contacts,
            slips=self._devices.slips,
            laser=self._devices.laser_health,
            base=self._devices.base_health,
            requests=self._session.config.telemetry.requests,
        )


def _publish_drawn(network: Network, draw: Callable[[], list[Update]]) -> None:
    for value, latest in draw():
        network.publish(value, latest)
