"""One exploration: the mind, the way it went, and what both leave in the run directory."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import structlog

from gvgbot import __version__
from gvgbot.autonomy import events
from gvgbot.autonomy.estimate import still
from gvgbot.autonomy.pipeline import Pipeline
from gvgbot.config import Config
from gvgbot.drivers.tapped import Tap
from gvgbot.errors import GvgbotError
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Contact, Odometry
from gvgbot.maps import geojson
from gvgbot.maps.run_directory import MAP, RunDirectory, record_of
from gvgbot.maps.team_map import team_files
from gvgbot.report import Journey, map_files, world_files
from gvgbot.simulation import Place, Simulation
from gvgbot.survey import survey
from gvgbot.team.chart import Chart
from gvgbot.team.member import Member

if TYPE_CHECKING:  # it needs packages that only those have who record
    from gvgbot.recording.recorder import Recorder

log = structlog.get_logger()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """What a session has counted; stamps in s of the robot's clock."""

    first_stamp: float | None
    last_stamp: float
    contacts: int
    closures: int
    recoveries: int


def new_mind(config: Config, *, led: bool) -> Pipeline:
    """A robot's mind that knows nothing yet; `led` if somebody else drives."""
    localisation, radius = config.localisation, config.robot.radius_m
    return Pipeline(config.mind, config.exploration, radius, led=led, localisation=localisation)


class Session:
    """What an exploration knows and has counted. `place` is None where the robot is real.

    `led` if somebody else drives, so that there is nothing to decide.
    """

    def __init__(
        self, config: Config, directory: RunDirectory, place: Place | None, *, led: bool = False
    ) -> None:
        self.config, self.directory, self.place = config, directory, place
        self.begin_with(new_mind(config, led=led))
        self.journey = Journey(period=0.0) if led else Journey()
        self.title = config.robot.name if place is None else place.world.name  # of the picture
        self.simulation: Simulation | None = None
        self.member: Member | None = None  # of a team, if it is in one
        self.recorder: Recorder | None = None
        self.failure: str | None = None  # what ended the run, if it was neither mission nor person
        self._counts = {events.LoopClosed: 0, events.Recovery: 0}
        self.contacts = 0  # times that a bumper was pressed
        self._in_contact = False
        self._untold: list[events.Event] = []  # that are not written yet
        self._has_trouble = False  # they could not be
        self._started = time.perf_counter()
        self._first_stamp: float | None = None
        self._last_stamp = 0.0

    def begin_with(self, pipeline: Pipeline) -> None:
        """Let this be the robot's mind."""
        self.pipeline = pipeline
        pipeline.mission.survey = partial(survey, pipeline)

    @property
    def tap(self) -> Tap | None:
        """What listens to the links, if that is recorded."""
        if self.recorder is None or not self.config.recording.raw_bytes:
            return None
        return self.recorder.on_bytes

    @property
    def is_blank(self) -> bool:
        """Whether nothing was seen, nothing has happened and nothing went wrong."""
        is_told_of = bool(self._untold) or not self.directory.is_blank or self.failure is not None
        return not (self.pipeline.past.keyframes or self.recorder or is_told_of)

    def on_events(self, happened: list[events.Event]) -> None:
        """Take down what happened, and write it."""
        self.note_events(happened)
        self.write_events()

    def note_events(self, happened: list[events.Event]) -> None:
        """Take down what happened, to be written."""
        self._untold += happened
        for event in happened:
            if self.recorder is not None:
                self.recorder.on_event(record_of(event))
            if type(event) in self._counts:
                self._counts[type(event)] += 1
            if isinstance(event, events.WayForgotten):
                self.journey.forget(event.kept)

    def write_events(self) -> None:
        """Write what happened, perhaps in a thread; what cannot be written now is written later."""
        had_trouble, self._has_trouble = self._has_trouble, True
        try:
            self._tell()
        except GvgbotError as error:
            if not had_trouble:
                log.warning("events not written, exploring on", reason=str(error))
        else:
            self._has_trouble = False

    def _tell(self) -> None:
        """Write what is still to be told. Raises GvgbotError if that is not possible."""
        while self._untold:
            self.directory.append_event(self._untold[0])
            del self._untold[0]

    def on_cycle(self, odometry: Odometry, contact: Contact | None) -> None:
        """Take down a control cycle."""
        if self._first_stamp is None:
            self._first_stamp = odometry.stamp
        elif odometry.stamp < self._last_stamp:  # the clock was set back: what was before counts on
            self._first_stamp += odometry.stamp - self._last_stamp
        self._last_stamp = odometry.stamp
        touching = contact is not None and contact.bumper
        self.contacts += touching and not self._in_contact
        self._in_contact = touching
        if not self.pipeline.is_lost:
            self.journey.record(odometry, self.pipeline, self._truth(odometry.stamp))

    @property
    def tally(self) -> Tally:
        """What has been counted so far."""
        return Tally(
            first_stamp=self._first_stamp,
            last_stamp=self._last_stamp,
            contacts=self.contacts,
            closures=self._counts[events.LoopClosed],
            recoveries=self._counts[events.Recovery],
        )

    def count_on(self, tally: Tally) -> None:
        """Go on from what an earlier life of this session has counted."""
        self._first_stamp, self._last_stamp = tally.first_stamp, tally.last_stamp
        self.contacts = tally.contacts
        self._counts = {
            events.LoopClosed: tally.closures,
            events.Recovery: tally.recoveries,
        }

    def _truth(self, stamp: float) -> Pose | None:
        """world_base at a stamp, where it is known."""
        if self.simulation is None:
            return None
        self.simulation.body.advance(stamp)
        return self.simulation.body.pose

    def save(self, *, unfinished: str = "stopped from outside") -> None:
        """Write events, map and summary. Raises GvgbotError if not all of them can be written."""
        try:
            self._tell()
        finally:
            self.saving(unfinished=unfinished)()

    def saving(self, *, unfinished: str) -> Callable[[], None]:
        """A function that writes the map as it is now, even if it is called later or in a thread.

        `unfinished` is the reason that the summary gives as long as there is no outcome.
        """
        summary = self._summary(unfinished)
        others = None if self.member is None else self.member.charts
        parts = self.pipeline.mission.parts()
        pipeline, journey = still(self.pipeline), self.journey.still()
        return partial(self._write, pipeline, journey, parts, others, summary)

    def _write(
        self,
        pipeline: Pipeline,
        journey: Journey,
        parts: list[tuple[Array, float]],
        others: dict[str, tuple[Chart, Pose]] | None,
        summary: dict[str, object],
    ) -> None:
        files = map_files(pipeline, journey, self.title)
        if others is not None:
            files |= team_files(geojson.decode(str(files[MAP])), parts, others, self.title)
            summary["frames"] = {name: (p.x, p.y, p.theta) for name, (_, p) in others.items()}
        if self.place is not None:
            files |= world_files(self.place.world)
        self.directory.write(files)
        self.directory.write_summary(summary)

    def _summary(self, unfinished: str) -> dict[str, object]:
        mission, graph = self.pipeline.mission, self.pipeline.mapper.graph
        recording = {} if self.recorder is None else {"recording": str(self.recorder.first)}
        return {
            "outcome": mission.outcome or ("failed" if self.failure else "stopped"),
            "reason": mission.reason or self.failure or unfinished,
            "distance_m": self.pipeline.driven,
            "duration_s": self._last_stamp - (self._first_stamp or 0.0),
            "wall_s": time.perf_counter() - self._started,
            "vertices": len(graph.vertices),
            "edges": len(graph.edges),
            "loop_closures": self._counts[events.LoopClosed],
            "contacts": self.contacts,
            "recoveries": self._counts[events.Recovery],
            "seed": self.config.twin.seed,
            "version": __version__,
            "config": self.config,
            **recording,
        }
