"""What a robot does unasked: it looks at gaps in its map before it calls all explored."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.control.orders import Drive, LookAround, Order, Stand
from gvgbot.autonomy.ending import Surveyed
from gvgbot.autonomy.errands import Errands
from gvgbot.autonomy.errands.plans import Kept
from gvgbot.autonomy.events import Decision, ErrandEnded, Event, Recovery
from gvgbot.autonomy.exploration.certainty import CertaintyConfig, vertex_sigma
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Pose
from tests.unit.autonomy.local_graphs import drawn
from tests.unit.autonomy.sights import carved, looked
from tests.unit.autonomy.test_mission import CLOSED, CONFIG, TEE, Last, Robot, join_out_of_reach

GAP = [2.0, 0.0]
BRANCH = drawn(
    {1: (-1.0, 0.0), 2: (4.0, 0.0), 3: (2.5, 0.0), 4: (2.5, -2.0)},
    {10: (1, 3, []), 11: (3, 2, []), 12: (3, 4, [])},
)


class Explorer(Robot):
    """A robot that also has errands; its surveys find what they are told to find."""

    def __init__(self, *surveys: list[list[float]]) -> None:
        super().__init__()
        self.errands = Errands(self.mission, self.mapper, CONFIG, room_m=0.2)
        self.left = list(surveys)
        self.mission.survey = self._survey
        self.narrows = self.doorsteps = self.awaited = np.empty((0, 2))
        self.is_barred = False  # all that is joined
        self.somebody_until = 0.0  # s, that somebody is found
        self.hidden_until = 0.0  # s, that the branch may be there for a while only
        self.passing_until = math.inf  # s, that bodies may yet go
        self.may_be_robots = False  # whoever is seen

    def _survey(self) -> Surveyed:
        places = np.array(self.left.pop(0)).reshape(-1, 2)
        barred = tuple(self.mapper.graph.edges) if self.is_barred else ()
        return Surveyed(
            places, self.narrows, doorsteps=self.doorsteps, awaited=self.awaited, barred=barred
        )

    def decide(self, view: View, known: Correspondence) -> tuple[Order, list[Event]]:
        is_found = view.stamp < self.somebody_until
        if view.stamp < self.hidden_until:
            view = replace(view, gvg=BRANCH, doubted=frozenset({3}))
        if view.stamp >= self.passing_until:
            view = replace(view, passing=np.empty((0, 2)))
        view = replace(view, is_somebody_found=is_found, may_be_robots=self.may_be_robots)
        return self.errands.advance(view, known)

    def until_it_moves_or_ends(self, gvg: LocalGvg = CLOSED) -> Order:
        order: Order = Stand()
        while self.mission.outcome is None and self.stamp < 200.0:
            order = self.look(gvg)
            if isinstance(order, Drive) and self.errands.errand is not None:
                break
        return order


def test_it_drives_to_a_gap_before_all_is_explored() -> None:
    robot = Explorer([GAP], [])
    order = robot.until_it_moves_or_ends()
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == GAP
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    robot.until_it_moves_or_ends()
    assert robot.mission.outcome == "explored"
    assert robot.mission.reason == "no frontier is left"
    assert not robot.left
    (ended,) = robot.said(ErrandEnded)
    assert isinstance(ended, ErrandEnded)
    assert ended.outcome == "arrived"
    (decision,) = [d for d in robot.said(Decision) if isinstance(d, Decision) and d.vertex is None]
    assert decision.reason == "something may be missing there"


def test_it_drives_to_a_gap_after_what_it_cannot_reach_has_been_given_up() -> None:
    robot = Explorer([GAP])
    join_out_of_reach(robot)
    while not robot.mapper.graph.blocked() and robot.stamp < 5 * CONFIG.patience_s:
        robot.drive(CLOSED, (0.0, 0.0), (3.8, 0.0), (-0.8, 0.0), (0.0, 0.0))
    robot.until_it_moves_or_ends()
    given_up = [e for e in robot.said(Recovery) if isinstance(e, Recovery)]
    assert [recovery.reason for recovery in given_up][1:] == ["no way leads there"]
    assert str(robot.errands.errand) == "goto 2 0"


def test_who_is_sent_to_where_it_was_driving_unasked_waits_there() -> None:
    """It would go on by itself, and forget the way there when it is started again."""
    robot = Explorer([GAP], [])
    robot.until_it_moves_or_ends()
    robot.errands.goto_point(GAP[0], GAP[1], robot.stamp)
    assert robot.errands.kept() == Kept("point", x=2.0, y=0.0)
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    assert robot.errands.errand is None
    assert robot.errands.is_waiting


def test_a_drive_that_nobody_asked_for_leaves_nothing_behind_when_it_is_over() -> None:
    """No errand to go on with after a restart, no wait for the next one, and no way closed."""
    robot = Explorer([GAP], [])
    robot.until_it_moves_or_ends()
    errands, graph = robot.errands, robot.mapper.graph
    assert str(errands.errand) == "goto 2 0"
    assert errands.kept() is None
    assert not errands.will_wait
    robot.drive(CLOSED, (0.0, 0.0), (1.75, 0.0))
    (edge,) = graph.edges.values()
    errands.closures.close(graph, [edge.a, edge.b], until=robot.stamp + 1000.0)
    robot.drive(CLOSED, (1.75, 0.0), (2.0, 0.0))
    assert errands.errand is None
    assert not errands.is_waiting
    assert not graph.blocked()


def test_who_has_driven_on_since_the_survey_makes_another_one_before_the_end() -> None:
    """It went to look at something, and saw more of the floor on the way."""
    robot = Explorer([], [GAP])
    while len(robot.left) > 1:
        robot.look(CLOSED)
    robot.travelled += 2.0
    robot.until_it_moves_or_ends()
    assert robot.mission.outcome is None
    assert robot.errands.errand is not None


def test_who_stands_in_sight_is_watched_before_the_survey_is_made() -> None:
    robot = Explorer([])
    robot.somebody_until = 20.0
    while robot.left:
        robot.look(CLOSED)
    assert robot.stamp > 20.0
    assert robot.travelled == 0.0


@pytest.mark.parametrize(
    ("hidden_s", "waits_s"), [(0.0, 0.0), (0.4, 10.5), (12.0, 22.0), (200.0, 130.0)]
)
def test_what_somebody_hides_where_it_went_for_a_look_is_waited_for(
    hidden_s: float, waits_s: float
) -> None:
    """He may go as soon as it has come there, and before it stands still."""
    robot = Explorer([GAP], [])
    robot.until_it_moves_or_ends()
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    came, robot.hidden_until = robot.stamp, robot.stamp + hidden_s
    while robot.left:
        robot.look(CLOSED)
    assert robot.stamp - came == pytest.approx(waits_s, abs=1.5)


@pytest.mark.parametrize(
    ("body", "stands_s", "waits_s"),
    [([2.0, -0.5], 50.0, 60.0), ([2.0, -0.5], 300.0, 130.0), ([3.5, 0.0], 50.0, 0.0)],
)
def test_who_stands_in_a_narrow_way_is_waited_for_before_it(
    body: list[float], stands_s: float, waits_s: float
) -> None:
    """In vain after two minutes; and not at all who stands elsewhere."""
    robot = Explorer([], [])
    robot.awaited, robot.doorsteps = np.array([[2.0, -0.7]]), np.array([GAP])
    robot.passing = np.array([body])
    robot.until_it_moves_or_ends()
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    came, robot.passing_until = robot.stamp, robot.stamp + stands_s
    orders = list[Order]()
    while robot.left:
        orders.append(robot.look(CLOSED))
    assert robot.stamp - came == pytest.approx(waits_s, abs=1.5)
    assert not any(isinstance(order, LookAround) for order in orders)


@pytest.mark.parametrize(
    ("body", "in_team", "waits_s"),
    [([2.4, 0.3], True, 60.0), ([2.0, 1.5], True, 0.0), ([2.4, 0.3], False, 0.0)],
)
def test_a_team_waits_for_who_stands_in_what_may_be_missing(
    body: list[float], waits_s: float, *, in_team: bool
) -> None:
    """Edges may lead round where he was: that nothing is there is to be seen when he has gone.

    Alone, a robot has its map shaped by him, and waits for that.
    """
    robot = Explorer([GAP], [])
    robot.passing = np.array([body])
    if in_team:
        robot.mission.choice.sharing = Last()
    robot.until_it_moves_or_ends()
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    came, robot.passing_until = robot.stamp, robot.stamp + 50.0
    while robot.left:
        robot.look(CLOSED)
    assert robot.stamp - came == pytest.approx(waits_s, abs=1.5)


def test_who_comes_to_where_somebody_has_gone_looks_round_for_what_he_hid() -> None:
    robot = Explorer([], [])
    robot.awaited, robot.doorsteps = np.array([[2.0, -0.7]]), np.array([GAP])
    robot.passing = np.array([[2.0, -0.5]])
    robot.until_it_moves_or_ends()
    robot.passing_until = 0.0
    order = robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    while robot.left and not isinstance(order, LookAround):
        order = robot.look(CLOSED)
    assert order == LookAround(math.tau)


def test_who_was_kept_from_a_gap_by_somebody_tries_again() -> None:
    """It does not come off the spot for as long as he stands there, and gives up."""
    robot = Explorer([GAP], [GAP], [GAP], [])
    robot.passing, robot.passing_until = np.array([GAP]), 20.0
    for _ in range(3):
        robot.until_it_moves_or_ends()
        assert str(robot.errands.errand) == "goto 2 0"
        while robot.errands.errand is not None:
            robot.look(CLOSED)
    robot.until_it_moves_or_ends()
    assert robot.mission.reason == "no frontier is left"


@pytest.mark.parametrize(("somebody_until", "visits"), [(0.0, 1), (5.0, 2)])
def test_a_gap_that_stays_is_told_of(somebody_until: float, visits: int) -> None:
    """It goes there once, or twice if somebody was about; then one more survey shows no use."""
    robot = Explorer(*[[GAP]] * (visits + 1))
    robot.somebody_until = somebody_until
    robot.until_it_moves_or_ends()
    robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
    robot.until_it_moves_or_ends()
    assert not robot.left
    assert robot.mission.outcome == "explored"
    assert robot.mission.reason == "no frontier is left; something may be missing near (2.0, 0.0)"


def test_what_is_too_narrow_is_told_of() -> None:
    robot = Explorer([])
    robot.narrows = np.array([[3.04, -1.0]])
    robot.until_it_moves_or_ends()
    assert robot.mission.reason == "no frontier is left; too narrow for it near (3.0, -1.0)"


@pytest.mark.parametrize(
    ("somebody_until", "passing_until", "may_be_robots", "visits"),
    [
        (0.0, 0.0, False, 0),
        (5.0, 0.0, False, 1),
        (5.0, 0.0, True, 0),
        (0.0, 5.0, False, 1),
        (0.0, 5.0, True, 0),
    ],
)
def test_a_narrow_way_is_looked_at_again_once_where_somebody_may_have_stood_in_it(
    *, somebody_until: float, passing_until: float, may_be_robots: bool, visits: int
) -> None:
    robot = Explorer(*[[]] * (visits + 1))
    robot.narrows, robot.doorsteps = np.array([[2.0, -0.5]]), np.array([GAP])
    robot.somebody_until, robot.may_be_robots = somebody_until, may_be_robots
    robot.passing, robot.passing_until = np.array([[0.0, 2.0]]), passing_until
    robot.until_it_moves_or_ends()
    if visits:
        robot.drive(CLOSED, (0.0, 0.0), (2.0, 0.0))
        robot.until_it_moves_or_ends()
    looks = [d for d in robot.said(Decision) if isinstance(d, Decision) and d.vertex is None]
    assert [look.reason for look in looks] == ["somebody may have stood there"] * visits
    assert not robot.left
    assert robot.mission.reason == "no frontier is left; too narrow for it near (2.0, -0.5)"


def test_an_edge_that_may_lead_through_glass_is_a_frontier_once_more() -> None:
    """Here it is seen again at once, but believed when the robot has come along it."""
    robot = Explorer([], [])
    robot.is_barred = True
    while not robot.mapper.graph.edges:
        robot.look(CLOSED)
    (edge,) = robot.mapper.graph.edges.values()
    while len(robot.left) > 1:
        robot.look(CLOSED)
    frontiers = sorted([edge.a, edge.b])
    assert robot.mapper.graph.frontiers() == frontiers
    robot.stand(CLOSED, 5)
    assert robot.mapper.graph.frontiers() == frontiers
    robot.drive(CLOSED, (-1.0, 0.0), (4.0, 0.0))
    joined = robot.mapper.graph.edge_at(edge.a)
    assert joined is not None
    assert (joined.other(edge.a), joined.driven) == (edge.b, True)
    robot.until_it_moves_or_ends()
    assert robot.mission.outcome == "explored"
    assert not robot.left


def test_who_asks_it_to_go_on_gets_another_look_at_every_gap() -> None:
    robot = Explorer([], [GAP])
    robot.until_it_moves_or_ends()
    assert robot.mission.outcome == "explored"
    robot.errands.explore(robot.stamp)
    order = robot.until_it_moves_or_ends()
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == GAP


def test_while_frontiers_are_left_there_is_no_survey() -> None:
    robot = Explorer()
    robot.stand(TEE, 20)
    assert robot.mission.target is not None


def test_a_survey_waits_until_ways_are_open_again() -> None:
    """Somebody stands in the only edge: no way leads to the gap until it is tried again."""
    robot = Explorer([GAP], [])
    while len(robot.mapper.graph.edges) == 0:
        robot.look(CLOSED)
    (edge,) = robot.mapper.graph.edges.values()
    robot.mission._obstructions.close(robot.mapper.graph, [edge.a, edge.b], robot.stamp)
    order = robot.until_it_moves_or_ends()
    assert isinstance(order, Drive)
    assert robot.stamp > CONFIG.retry_after_s


def test_another_survey_is_made_when_edges_have_gone_since_the_last() -> None:
    """What nothing leads to is forgotten late: then there may be a blank where it was."""
    robot = Explorer([], [GAP])
    while robot.left == [[], [GAP]]:
        robot.look(CLOSED)
    robot.errands.own_tasks._surveyed.add(999)  # an edge that is not there any more
    order = robot.until_it_moves_or_ends()
    assert robot.left == []
    assert isinstance(order, Drive)


def test_what_was_found_on_an_errand_goes_as_soon_as_it_is_gone() -> None:
    """A gap between boxes in a corridor that is known: the map was finished without it."""
    gap = drawn(
        {1: (-1.0, 0.0), 2: (4.0, 0.0), 3: (1.5, 0.0), 4: (1.5, -3.0)},
        {10: (1, 3, []), 11: (3, 2, []), 12: (3, 4, [])},
        unseen={4: -math.pi / 2},
    )
    robot = Explorer([])
    robot.until_it_moves_or_ends()
    known = set(robot.mapper.graph.vertices)
    robot.drive(gap, (0.0, 0.0), (1.0, 0.0))
    robot.stand(gap, 20)
    assert len(robot.mapper.graph.vertices) > len(known)
    robot.errands.home(robot.stamp)
    robot.stand(CLOSED, 20)
    assert set(robot.mapper.graph.vertices) == known


def test_into_a_room_whose_door_lies_aslant_from_the_edge_it_drives_by_way_of_before_it() -> None:
    """From the point of the edge that is nearest to the gap, a jamb is too near to the way."""
    hall, room, door = (-4.0, -2.0, 4.0, 2.0), (-4.0, 2.2, 4.0, 6.0), (-0.3, 2.0, 0.3, 2.2)
    aslant = drawn({1: (-3.0, 0.9), 2: (3.0, -1.5)}, {10: (1, 2, [])})
    gap, nearest = [0.0, 2.6], Pose(-1.0, 0.1)
    robot = Explorer([gap], [])
    robot.walls = looked(carved([hall, room, door]), [Pose(), nearest])
    robot.pose = nearest
    robot.mapper.move(nearest, np.zeros((3, 3)))
    order = robot.until_it_moves_or_ends(aslant)
    assert isinstance(order, Drive)
    assert order.track.polyline[-1].tolist() == gap
    jambs = np.array([(x, y) for x in (-0.3, 0.3) for y in (2.0, 2.2)])
    assert min(np.hypot(*(jambs - point).T).min() for point in order.track.polyline) > 0.2


@pytest.mark.parametrize(("share", "told"), [(0.5, "1 vertex stays"), (-1.0, "2 vertices stay")])
def test_vertices_that_stay_less_certain_than_wanted_are_counted(share: float, told: str) -> None:
    """The robot knows its own place so badly that no visit helps."""
    robot = Explorer([])
    robot.mapper.move(Pose(), np.diag([1.0, 1.0, 0.0]))
    while len(robot.mapper.belief.ids) < 2:
        robot.look(CLOSED)
    near, far = (vertex_sigma(robot.mapper.belief, v) for v in robot.mapper.belief.ids)
    goal = CertaintyConfig(pose_sigma_m=100.0, vertex_sigma_m=near + share * (far - near))
    config = replace(CONFIG, certainty=goal)
    robot.errands = Errands(robot.mission, robot.mapper, config, room_m=0.2)
    robot.until_it_moves_or_ends()
    assert robot.mission.reason == f"no frontier is left; {told} less certain than wanted"


# one of three edges has been driven, the others are left to the rest of the team
SHARED = drawn(
    {1: (-1.0, 0.0), 2: (3.0, 0.0), 3: (8.0, 0.0), 4: (3.0, -4.0)},
    {10: (1, 2, []), 11: (2, 3, []), 12: (2, 4, [])},
    unseen={3: 0.0, 4: -math.pi / 2},
)


def of_a_team(*surveys: list[list[float]]) -> Explorer:
    """A robot whose team is done."""
    robot = Explorer(*surveys)
    robot.drive(SHARED, (0.0, 0.0), (3.0, 0.0))
    robot.mission.choice.sharing, robot.mission.target = Last(), None
    return robot


def test_when_its_team_has_followed_all_it_looks_for_what_is_missing_before_it_ends() -> None:
    robot = of_a_team([[1.5, 1.1]], [])
    robot.until_it_moves_or_ends(SHARED)
    assert str(robot.errands.errand) == "goto 1.5 1.1"
    robot.drive(SHARED, (3.0, 0.0), (1.5, 0.0), (1.5, 1.1))
    assert robot.errands.errand is None
    robot.until_it_moves_or_ends(SHARED)
    assert robot.mission.outcome == "explored"
    assert not robot.left


@pytest.mark.parametrize("is_asked", [False, True])
def test_it_explores_nothing_to_find_a_way_there_unless_somebody_asks_it_to_go(
    *, is_asked: bool
) -> None:
    """Others have followed all that it might explore."""
    robot = of_a_team([[-0.5, 0.6]])
    robot.until_it_moves_or_ends(SHARED)
    if is_asked:
        robot.errands.goto_point(-0.5, 0.6, robot.stamp)
        robot.look(SHARED)
    robot.errands.obstruct("no way on")
    robot.stand(SHARED, 2)
    actions = [event.action for event in robot.said(Recovery) if isinstance(event, Recovery)]
    assert ("explore" in actions) == is_asked
