"""People stand free, are as wide as people and go; walls and furniture are or do none of this."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gvgbot.autonomy.gvg.local_map import LocalMap, LocalMapConfig
from gvgbot.autonomy.newcomers import Newcomers, NewcomersConfig
from gvgbot.drivers.world import World
from gvgbot.geometry import Array, Pose
from tests.unit.autonomy.sights import LASER_270, Rectangle, carved, sweep

ROOM: Rectangle = (-4.0, -3.0, 4.0, 3.0)
EMPTY = carved([ROOM])
HERE = Pose()
RADIUS = 0.22  # m, of a person
CONFIG = NewcomersConfig(found_after_s=20.0, came_after_s=120.0)

Point = tuple[float, float]


class Watch:
    """Somebody who looks from one place, and what of each sweep is kept out of the map."""

    def __init__(self, known: World | None = None, *, noise: float = 0.0) -> None:
        self.map, self.newcomers = LocalMap(LocalMapConfig()), Newcomers(CONFIG)
        self._noise, self._rng = noise, np.random.default_rng(1)
        if known is not None:
            for _ in range(3):
                self.map.insert(sweep(known, HERE), HERE, 0.0)

    def dropped(
        self,
        world: World,
        stamp: float = 0.0,
        *,
        person: Point | None = None,
        passer: tuple[Point, float] | None = None,
        way: Point = (math.inf, math.inf),
    ) -> int:
        """How many beams are kept out, if a way is known to lead past half a metre from `way`.

        Who passes has another radius, m.
        """
        scan = replace(sweep(world, HERE), stamp=stamp)
        people = [] if person is None else [(person, RADIUS)]
        for one in people if passer is None else [*people, passer]:
            scan = replace(scan, ranges=np.minimum(scan.ranges, to_disc(scan.bearings, *one)))
        errors = self._noise * self._rng.standard_normal(len(scan.ranges))
        scan = replace(scan, ranges=scan.ranges + errors)
        sifted = self.newcomers.sift(scan, HERE, self.map, lambda xy: math.dist(xy, way) < 0.5)
        self.map.insert(sifted, HERE, 0.0)
        return int(np.isnan(sifted.ranges).sum() - np.isnan(scan.ranges).sum())

    def glimpse(self, ranges: Array, offsets: Array, looks: int = 2) -> None:
        """Looks of three beams each, those with the least offset (N,), at what is new here."""
        for second in range(looks):
            few = np.where(
                np.isin(np.arange(len(ranges)), np.argsort(abs(offsets))[:3]), ranges, np.inf
            )
            scan = sweep(EMPTY, HERE)
            scan = replace(scan, ranges=np.minimum(scan.ranges, few), stamp=float(second))
            self.map.insert(scan, HERE, 0.0)
        assert self.inside() > 0

    def inside(self) -> int:
        """How many points of the map are not the room's walls."""
        return int((np.abs(self.map.points()) < [3.9, 2.9]).all(axis=1).sum())


def lost_behind_a_screen() -> Watch:
    """Somebody who stood at (2, 0) from the first look on, and is hidden from second 4 to 39."""
    watch, screened = Watch(), carved([ROOM], [(1.0, -1.0, 1.1, 1.0)])
    for second in range(4):
        watch.dropped(EMPTY, second, person=(2.0, 0.0))
    for second in range(4, 40):
        watch.dropped(screened, second)
    return watch


def to_disc(bearings: Array, centre: Point, radius: float = RADIUS) -> Array:
    """Ranges (N,) from the origin to a person; inf beside."""
    along = np.cos(bearings) * centre[0] + np.sin(bearings) * centre[1]
    beside = centre[0] ** 2 + centre[1] ** 2 - along**2
    hit = (beside < radius**2) & (along > 0.0)
    return np.where(hit, along - np.sqrt(np.maximum(radius**2 - beside, 0.0)), np.inf)


def test_there_is_floor_up_to_a_robot_that_says_where_it_is_and_less_for_sure_up_to_others() -> (
    None
):
    scan = sweep(EMPTY, HERE)
    person, robot = (3.0, 0.0), (0.0, -2.5)
    ranges = np.minimum(to_disc(scan.bearings, person), to_disc(scan.bearings, robot))
    scan = replace(scan, ranges=np.minimum(scan.ranges, ranges))
    newcomers = Newcomers(CONFIG)
    newcomers.company = [(np.array(robot), RADIUS)]
    free = newcomers.free(scan, HERE)
    ahead, aside = (int(np.abs(scan.bearings - b).argmin()) for b in (0.0, -math.pi / 2))
    assert free[aside] == pytest.approx(2.5 - RADIUS, abs=0.01)
    assert free[ahead] < 3.0 - RADIUS - 1.0


def test_who_comes_into_an_empty_room_is_kept_out_of_the_map() -> None:
    watch = Watch(EMPTY)
    beams = 2 * math.asin(RADIUS / 2.0) / (math.tau / 1080)  # by the angle of the disc
    assert abs(watch.dropped(EMPTY, person=(2.0, 0.0)) - beams) <= 2
    assert watch.inside() == 0
    assert np.abs(np.hypot(*(watch.newcomers.points - [2.0, 0.0]).T) - RADIUS).max() < 0.1


def test_nothing_is_new_in_a_room_that_stays_as_it_was() -> None:
    pillar: Rectangle = (1.9, -0.2, 2.3, 0.2)
    watch = Watch(carved([ROOM], [pillar]))
    assert watch.dropped(carved([ROOM], [pillar])) == 0
    assert len(watch.newcomers.points) == 0


def test_a_wall_is_no_newcomer_even_where_the_map_knew_free_space() -> None:
    watch = Watch(EMPTY)
    assert watch.dropped(carved([(-4.0, -3.0, 3.4, 3.0)])) == 0
    assert len(watch.newcomers.points) == 0


def test_what_is_flat_is_taken_for_a_wall_at_once_as_no_body_is() -> None:
    """A patch of glass that shows only where it is seen head-on, 0.4 m wide."""
    patch: Rectangle = (2.0, -0.2, 2.1, 0.2)
    watch = Watch(EMPTY)
    assert watch.dropped(carved([ROOM], [patch])) == 0
    assert watch.inside() > 0


@pytest.mark.parametrize(
    ("known", "patience"), [(None, CONFIG.found_after_s), (EMPTY, CONFIG.came_after_s)]
)
def test_what_stands_long_enough_is_a_part_of_the_building(
    known: World | None, patience: float
) -> None:
    """A pillar is found at the first look, and a person comes: that takes longer to believe."""
    watch = Watch(known)
    for second in range(math.ceil(patience)):
        assert watch.dropped(EMPTY, second, person=(2.0, 0.0)) > 0
        assert len(watch.newcomers.points) > 0
    for later in (0.0, 1.0):
        assert watch.dropped(EMPTY, patience + later, person=(2.0, 0.0)) == 0
        assert len(watch.newcomers.points) == 0
    assert watch.inside() > 0


@pytest.mark.parametrize(
    ("radius", "patience"), [(RADIUS, CONFIG.came_after_s), (0.3, CONFIG.found_after_s)]
)
def test_where_somebody_walks_who_is_found_standing_may_have_come(
    radius: float, patience: float
) -> None:
    """One passes the other, and is gone: he was no pillar. One as wide as a robot was that."""
    watch = Watch()
    watch.newcomers.strangers = [0.3]
    for second in range(math.ceil(patience)):
        passer = ((-2.0, second - 2.0), radius) if second < 4 else None
        assert watch.dropped(EMPTY, second, person=(2.0, 0.0), passer=passer) > 0
    assert watch.dropped(EMPTY, patience, person=(2.0, 0.0)) == 0


def test_who_has_stood_there_since_before_the_clock_began_anew_is_waited_for_the_rest() -> None:
    """For 9 of 20 seconds; a memory of another run has its stamps."""
    watch = Watch()
    for stamp in [1000.0 + second for second in range(10)] + list(range(11)):
        assert watch.dropped(EMPTY, stamp, person=(2.0, 0.0)) > 0
    assert watch.dropped(EMPTY, 11.0, person=(2.0, 0.0)) == 0


def test_who_may_be_a_robot_of_the_team_that_waits_is_no_pillar_so_soon() -> None:
    """Where its map lies is not known yet, so it may be anywhere."""
    slim, as_wide = Watch(), Watch()
    slim.newcomers.strangers, as_wide.newcomers.strangers = [RADIUS - 0.1], [0.35, RADIUS]
    for second in range(math.ceil(CONFIG.came_after_s)):
        slim.dropped(EMPTY, second, person=(2.0, 0.0))
        assert as_wide.dropped(EMPTY, second, person=(2.0, 0.0)) > 0
        assert as_wide.inside() == 0
    assert slim.inside() > 0


def test_who_is_as_wide_as_a_robot_that_may_be_anywhere_may_be_it_from_far_away() -> None:
    """Too few beams meet it to tell that it is round."""
    hall, there = carved([(-2.0, -3.0, 24.0, 3.0)]), (14.0, 0.5)
    anybody, stranger = Watch(hall), Watch(hall)
    stranger.newcomers.strangers = [RADIUS - 0.1, RADIUS]
    for watch in (anybody, stranger):
        watch.dropped(hall, person=there)
    assert len(anybody.newcomers.bodies) == 0
    ((x, y, radius),) = stranger.newcomers.bodies
    assert math.dist((x, y), there) < 0.03
    assert radius == RADIUS


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_what_surely_has_an_edge_is_a_post_after_a_glimpse(noise: float) -> None:
    """Else doors beside it are not believed until the robot has passed them."""
    post = carved([ROOM], [(1.6, 0.6, 2.0, 1.0)])
    watch = Watch(noise=noise)
    assert all(watch.dropped(post, float(second)) > 0 for second in range(3))
    assert watch.dropped(post, 4.0) == 0
    assert watch.inside() > 0


def test_who_stands_in_a_way_that_is_known_came_there() -> None:
    watch = Watch()
    for second in range(math.ceil(CONFIG.came_after_s)):
        watch.dropped(EMPTY, second, person=(2.0, 0.0), way=(2.0, 0.3))
        assert watch.inside() == 0


def test_who_walks_is_never_believed_and_leaves_nothing_behind() -> None:
    """To and fro at 0.5 m/s, two metres away, for five minutes."""
    watch = Watch()
    for second in range(300):
        person = (2.0, 1.5 * math.sin(second / 3.0))
        assert watch.dropped(EMPTY, second, person=person) > 0
        near = np.hypot(*(watch.newcomers.points - person).T) < 2 * RADIUS
        assert near.any()
    assert watch.inside() == 0


def test_the_last_that_is_seen_of_who_goes_behind_a_corner_is_no_wall() -> None:
    """At 0.4 m/s, so that there are looks at less of him than could be anybody."""
    corner = carved([ROOM], [(1.0, 0.0, 1.1, 3.0)])
    watch = Watch(corner)
    for look in range(40):
        watch.dropped(corner, look / 10, person=(2.0, 0.04 * look - 0.8))
    walls = watch.map.points()
    assert not ((walls > [1.2, -2.9]) & (walls < [3.9, 2.9])).all(axis=1).any()


def test_who_walks_along_a_wall_is_kept_out_too() -> None:
    """With 0.35 m between shoulder and wall, which is in the map already."""
    watch = Watch(EMPTY)
    for second in range(10):
        watch.dropped(EMPTY, second, person=(0.5 * second - 2.5, 3.0 - RADIUS - 0.35))
    assert watch.inside() == 0


def test_of_whom_too_little_was_seen_at_first_is_no_wall_afterwards() -> None:
    watch = Watch(EMPTY)
    bearings = sweep(EMPTY, HERE).bearings
    watch.glimpse(to_disc(bearings, (2.0, 0.0)), bearings)
    assert watch.dropped(EMPTY, 2.0, person=(2.0, 0.0)) > 0
    assert len(watch.newcomers.points) > 0


def test_of_whom_little_is_seen_beside_a_corner_and_less_was_at_first_is_no_wall() -> None:
    """Seven beams, an arc too short to tell that it is round, three of them at the first look."""
    corner, spot = carved([ROOM], [(1.0, 0.0, 1.1, 3.0)]), (3.3, 0.1)
    watch = Watch(corner)
    bearings = sweep(corner, HERE).bearings
    watch.glimpse(to_disc(bearings, spot), bearings + math.radians(1.0), looks=1)
    assert 3 <= watch.dropped(corner, 1.0, person=spot) < 8


def test_the_corner_of_a_wall_is_one_however_little_was_seen_of_it_at_first() -> None:
    with_corner = carved([ROOM], [(1.6, -1.0, 2.0, -0.6)])
    watch = Watch(EMPTY)
    scan = sweep(with_corner, HERE)
    corner = np.where(scan.ranges < sweep(EMPTY, HERE).ranges - 0.5, scan.ranges, np.inf)
    watch.glimpse(corner, scan.bearings - math.atan2(-0.8, 1.8))
    assert watch.dropped(with_corner, 2.0) == 0


def test_who_stood_for_long_and_goes_is_forgotten_at_the_next_look() -> None:
    watch = Watch()
    for second in range(60):
        watch.dropped(EMPTY, second, person=(2.0, 0.0))
    assert watch.inside() > 0
    watch.dropped(EMPTY, 60.0)
    assert watch.inside() == 0


def test_who_was_let_in_may_yet_go_until_he_has_stood_for_very_long() -> None:
    """Who is as round as people are; a post with edges never may."""
    watch = Watch()
    for second in range(130):
        watch.dropped(EMPTY, second, person=(2.0, 0.0))
        passing = watch.newcomers.passing(float(second))
        assert len(passing) == (second < CONFIG.came_after_s)
        assert np.allclose(passing, [2.0, 0.0], atol=0.05)
    post, watch = carved([ROOM], [(1.6, 0.6, 2.0, 1.0)]), Watch()
    for second in range(3):
        assert watch.dropped(post, second) > 0
        assert len(watch.newcomers.passing(float(second))) == 0


def test_who_seemed_wide_beside_a_wall_is_forgotten_as_soon_as_he_has_gone() -> None:
    """Once, somebody else hid in part what there was to be seen of him."""
    watch, place = Watch(EMPTY), (2.0, 2.65)
    for second in range(3):
        watch.dropped(EMPTY, second, person=place)
    (one,) = watch.newcomers._all
    one.radius = 0.45  # the wall is 0.35 m off
    watch.dropped(EMPTY, 3.0)
    assert len(watch.newcomers.gone) == 1


def test_who_goes_is_forgotten_as_soon_as_that_is_seen() -> None:
    watch = Watch(EMPTY)
    watch.dropped(EMPTY, 0.0, person=(2.0, 0.0))
    watch.dropped(EMPTY, 1.0)
    assert len(watch.newcomers.points) == 0


@pytest.mark.parametrize("y", [0.5, 0.7, 2.0])
def test_who_stood_before_a_wall_and_goes_is_forgotten(y: float) -> None:
    """Seen from close by, the wall is hardly farther off than he was, or not at all."""
    room = carved([(-4.0, -3.0, 4.0, y + RADIUS + 0.05)])
    watch = Watch(room)
    watch.dropped(room, 0.0, person=(0.0, y))
    assert len(watch.newcomers.points) > 0
    watch.dropped(room, 1.0)
    assert len(watch.newcomers.points) == 0


def test_where_somebody_was_last_seen_nobody_knows_the_floor_until_it_is_seen() -> None:
    """A screen is put before him, who stays or goes, and taken away after a minute."""
    watch, spot = Watch(EMPTY), np.array([2.0, 0.0])
    screened = carved([ROOM], [(1.0, -1.0, 1.1, 1.0)])
    watch.dropped(EMPTY, 0.0, person=(2.0, 0.0))
    assert watch.map.known(spot)
    for second in range(1, 60):
        watch.dropped(screened, second)
    assert len(watch.newcomers.points) == 0
    assert not watch.map.known(spot)
    assert not watch.map.is_bare(spot, RADIUS)
    for second in range(60, 63):
        watch.dropped(EMPTY, second)
    assert watch.map.is_bare(spot, RADIUS)


def test_who_never_moved_stays_in_the_way_out_of_sight_until_the_place_is_seen() -> None:
    """He may be a column, behind a screen that is put before him and taken away."""
    watch = lost_behind_a_screen()
    away = np.hypot(*(watch.newcomers.lost - [2.0, 0.0]).T)
    assert away == pytest.approx(np.full(12, RADIUS), abs=0.05)
    assert watch.newcomers.discs == []  # nobody drives round him, nor waits for him
    watch.dropped(EMPTY, 40)
    assert len(watch.newcomers.lost) == 0


@pytest.mark.parametrize(("place", "is_kept_out"), [((2.0, 0.1), False), ((2.0, 0.6), True)])
def test_where_a_body_proved_to_be_of_the_building_one_is_let_in_at_once(
    place: Point, *, is_kept_out: bool
) -> None:
    watch = Watch(EMPTY)
    watch.newcomers.lasting = np.array([place])
    assert (watch.dropped(EMPTY, 0.0, person=(2.0, 0.0)) > 0) == is_kept_out


def test_who_is_seen_again_where_he_stood_may_have_come_back() -> None:
    watch = lost_behind_a_screen()
    for second in range(40, 60):
        assert watch.dropped(EMPTY, second, person=(2.0, 0.0)) > 0


@pytest.mark.parametrize(
    ("known", "step", "seconds", "missed"),
    [
        (None, 0.0, 5, 1),
        pytest.param(EMPTY, 0.0, 5, 0, id="came"),
        pytest.param(None, 0.4, 5, 0, id="walked"),
        pytest.param(None, 0.0, 30, 0, id="was let in"),
    ],
)
def test_who_stood_until_he_was_out_of_sight_is_missed(
    known: World | None, step: float, seconds: int, missed: int
) -> None:
    """A screen is put before him; whoever came, walked or was let into the map is not missed."""
    screened = carved([ROOM], [(1.0, -1.0, 1.1, 1.0)])
    watch = Watch(known)
    for second in range(seconds):
        watch.dropped(EMPTY, second, person=(2.0, step * second - 0.8 * (step > 0.0)))
        is_watched = watch.newcomers.is_one_standing(float(second), watch.map)
        assert is_watched == (known is None and step == 0.0 and 3 <= second < CONFIG.found_after_s)
    found = []
    for second in range(60):
        watch.dropped(screened, seconds + second)
        assert not watch.newcomers.is_one_standing(float(seconds + second), watch.map)
        found += watch.newcomers.missed
    assert len(found) == missed
    assert all(np.hypot(*(one.centre - [2.0, 0.0])) < 0.1 for one in found)


def test_who_passes_where_somebody_stood_is_not_taken_for_him() -> None:
    screened = carved([ROOM], [(1.0, -1.0, 1.1, 1.0)])
    watch = Watch()
    for second in range(4):
        watch.dropped(EMPTY, second, person=(2.0, 0.0))
    for second in range(4, 120):
        watch.dropped(screened, second)
    for second in range(10):
        assert watch.dropped(EMPTY, 120.0 + second, person=(2.0, 0.4 * second - 1.2)) > 0
    assert watch.inside() == 0


def test_a_post_between_panes_of_glass_stays_where_it_is() -> None:
    """Most beams towards the disc around it go through the panes."""
    watch, post = Watch(), carved([ROOM], [(2.0, -0.07, 2.1, 0.07)])
    for second in range(30):
        watch.dropped(carved([ROOM], [(2.0, -0.35, 2.1, 0.35)]), second)
    assert [watch.dropped(post, 30 + second) for second in range(10)] == 10 * [0]


def test_the_leg_of_a_table_is_no_person() -> None:
    leg: Rectangle = (1.9, -0.02, 1.96, 0.04)
    assert Watch().dropped(carved([ROOM], [leg])) == 0


def test_what_is_half_hidden_is_kept_out_for_a_glimpse_and_not_led_round() -> None:
    """A cupboard behind a corner, so that one side of it is never seen."""
    world = carved([ROOM], [(1.0, 0.0, 1.1, 3.0), (2.3, -0.3, 2.7, 0.1)])
    watch = Watch()
    assert watch.dropped(world, 0.0) > 0
    assert len(watch.newcomers.points) == 0
    assert watch.dropped(world, 2.0) > 0
    assert watch.dropped(world, 4.0) == 0


def test_who_is_half_hidden_is_known_by_the_other_half() -> None:
    world, spot = carved([ROOM], [(1.0, 0.0, 1.1, 3.0)]), (2.5, -0.1)
    watch = Watch()
    for second in range(math.ceil(CONFIG.found_after_s)):
        assert watch.dropped(world, second, person=spot) > 0
        assert np.abs(np.hypot(*(watch.newcomers.points - spot).T) - RADIUS).max() < 0.03


def test_who_was_half_hidden_for_long_and_steps_forward_is_kept_out_again() -> None:
    world, spot = carved([ROOM], [(1.0, 0.0, 1.1, 3.0)]), (2.5, -0.1)
    watch = Watch()
    for second in range(8):
        watch.dropped(world, second, person=spot)
    assert watch.dropped(world, 8.0, person=(2.5, -0.35)) > 0
    assert len(watch.newcomers.points) > 0


def test_who_looked_like_a_wall_for_long_is_taken_out_when_more_is_seen() -> None:
    """A narrow part of somebody, again and again, as through the gap of a door."""
    for noise in (0.01, 0.03):
        watch = Watch(EMPTY, noise=noise)
        bearings = sweep(EMPTY, HERE).bearings
        watch.glimpse(to_disc(bearings, (2.0, 0.0)), bearings, looks=10)
        kept_out = [watch.dropped(EMPTY, 10.0 + k / 2, person=(2.0, 0.0)) > 0 for k in range(12)]
        assert all(kept_out[6:])
        assert np.hypot(*(watch.map.points() - [2.0, 0.0]).T).min() > 1.0
        assert np.hypot(*(watch.newcomers.discs[0][0] - [2.0, 0.0])) < 0.1
        watch.dropped(EMPTY, 20.0)
        assert len(watch.newcomers.points) == 0


def test_a_pillar_that_was_taken_for_a_wall_is_let_in_once_and_for_all() -> None:
    """A third of it is no circle for sure: that it is one is forgotten, until it is seen whole."""
    watch, spot, patience = Watch(EMPTY), (2.0, 0.0), math.ceil(CONFIG.came_after_s)
    bearings = sweep(EMPTY, HERE).bearings
    watch.glimpse(to_disc(bearings, spot), bearings, looks=10)
    screened = carved([ROOM], [(1.0, -2.0, 1.1, 0.05)])
    worlds = [EMPTY] * patience + [screened] * 30 + [EMPTY] * 5
    looks = [watch.dropped(world, 10.0 + k, person=spot) > 0 for k, world in enumerate(worlds)]
    assert all(looks[:patience])
    assert not any(looks[patience:])


def test_what_looked_round_for_a_moment_is_the_wall_that_it_was() -> None:
    """A pane of glass does: it must be in the map again before the robot has passed."""
    watch, spot = Watch(EMPTY), (2.0, 0.0)
    bearings = sweep(EMPTY, HERE).bearings
    watch.glimpse(to_disc(bearings, spot), bearings, looks=10)
    assert watch.dropped(EMPTY, 10.0, person=spot) > 0
    screened = carved([ROOM], [(1.0, -2.0, 1.1, 0.06)])
    for k in range(1, 10):
        watch.dropped(screened, 10.0 + k, person=spot)
    assert watch.dropped(screened, 20.0, person=spot) == 0
    assert len(watch.newcomers.points) == 0


def test_who_stands_beside_a_wall_is_kept_out_by_roundness() -> None:
    """With 0.13 m of air behind the shoulder, seen along a wall and in front of one."""
    for spot in ((2.0, 3.0 - RADIUS - 0.13), (4.0 - RADIUS - 0.13, 0.0)):
        watch = Watch()
        for second in range(math.ceil(CONFIG.found_after_s)):
            assert watch.dropped(EMPTY, second, person=spot) > 0
        assert np.abs(np.hypot(*(watch.newcomers.points - spot).T) - RADIUS).max() < 0.03


def test_who_stands_where_the_laser_hardly_reaches_is_kept_out() -> None:
    local_map, newcomers = LocalMap(LocalMapConfig()), Newcomers(CONFIG)
    hall = carved([(-9.0, -9.0, 9.0, 9.0)])
    scan = sweep(hall, HERE, reach=5.6)
    scan = replace(scan, ranges=np.minimum(scan.ranges, to_disc(scan.bearings, (5.6, 0.0))))
    assert 5.6 - scan.ranges.min() < 0.3
    assert np.isnan(newcomers.sift(scan, HERE, local_map).ranges).any()


def test_who_is_farther_off_than_the_laser_reaches_has_not_gone_for_all_it_sees() -> None:
    local_map, newcomers = LocalMap(LocalMapConfig()), Newcomers(CONFIG)
    hall, nearer, farther = carved([(-9.0, -9.0, 9.0, 9.0)]), Pose(-2.0), Pose(-6.0)
    scan = sweep(hall, HERE, reach=5.6)
    scan = replace(scan, ranges=np.minimum(scan.ranges, to_disc(scan.bearings, (3.0, 0.0))))
    newcomers.sift(scan, HERE, local_map)
    newcomers.sift(sweep(hall, farther, reach=5.6), farther, local_map)
    assert not newcomers.gone
    newcomers.sift(sweep(hall, nearer, reach=5.6), nearer, local_map)
    assert newcomers.gone


def test_in_noise_a_corner_is_a_wall_as_soon_as_without() -> None:
    """A cupboard, half behind a corner: in the end it stays in the map."""
    world = carved([ROOM], [(1.0, 0.0, 1.1, 3.0), (2.3, -0.3, 2.7, 0.1)])
    watch = Watch(noise=0.03)
    looks = [watch.dropped(world, second / 2) > 0 for second in range(20)]
    assert not any(looks[10:])
    assert watch.inside() > 0


def test_who_is_cut_off_where_the_sweep_ends_is_led_round_too() -> None:
    """Half of a person straight behind the laser, the other half beyond its last beam."""
    watch = Watch()
    for second in range(math.ceil(CONFIG.found_after_s)):
        assert watch.dropped(EMPTY, second, person=(-2.0, 0.0)) > 0
        assert np.abs(np.hypot(*(watch.newcomers.points - [-2.0, 0.0]).T) - RADIUS).max() < 0.03


def test_what_came_half_hidden_is_waited_for_as_long_as_what_came_in_sight() -> None:
    watch = Watch(carved([ROOM], [(1.0, 0.0, 1.1, 3.0)]))
    came = carved([ROOM], [(1.0, 0.0, 1.1, 3.0), (2.3, -0.3, 2.7, 0.1)])
    for second in range(math.ceil(CONFIG.came_after_s)):
        assert watch.dropped(came, second) > 0
        assert len(watch.newcomers.points) > 0
    assert watch.dropped(came, CONFIG.came_after_s) == 0


def test_the_stretch_of_wall_within_a_short_range_is_no_newcomer() -> None:
    """A wall 3.4 m ahead, of which a laser that reaches 3.5 m sees the nearest part only."""
    local_map, newcomers = LocalMap(LocalMapConfig()), Newcomers(NewcomersConfig())
    local_map.insert(sweep(carved([ROOM]), HERE), HERE, 0.0)
    room: Rectangle = (-4.0, -3.0, 3.4, 3.0)
    short = sweep(carved([room]), HERE, reach=3.5)
    assert np.isinf(short.ranges).any()
    assert newcomers.sift(short, HERE, local_map) is short


def test_a_laser_that_tells_nothing_shows_nobody() -> None:
    scan = sweep(EMPTY, HERE)
    blind = replace(scan, ranges=np.full_like(scan.ranges, np.nan))
    watch = Watch(EMPTY)
    assert np.isnan(watch.newcomers.sift(blind, HERE, watch.map).ranges).all()


def test_a_glance_shows_where_somebody_near_has_gone_and_adds_nobody() -> None:
    watch = Watch(EMPTY)
    watch.dropped(EMPTY, person=(2.0, 0.0))
    scan = sweep(EMPTY, HERE)
    for person in ((2.3, 0.4), (-2.0, 0.0)):
        seen = replace(scan, ranges=np.minimum(scan.ranges, to_disc(scan.bearings, person)))
        watch.newcomers.glance(seen, HERE)
        latest = [centre for centre, _ in watch.newcomers.latest]
        is_followed = person[0] > 0.0  # whoever else is there has not been looked at yet
        assert len(latest) == is_followed
        if is_followed:
            assert np.hypot(*(latest[0] - person)) < 0.1
    assert np.hypot(*(watch.newcomers.discs[0][0] - [2.0, 0.0])) < 0.1


def test_without_patience_whoever_comes_is_taken_for_a_wall_at_once() -> None:
    watch = Watch(EMPTY)
    watch.newcomers = Newcomers(NewcomersConfig(found_after_s=0.0, came_after_s=0.0))
    assert watch.dropped(EMPTY, person=(2.0, 0.0)) == 0
    assert watch.inside() > 0
    assert len(watch.newcomers.points) == 0
    watch.newcomers.company = [(np.array([2.0, 0.0]), RADIUS)]
    assert watch.dropped(EMPTY, person=(2.0, 0.0)) > 0


def test_another_robot_is_kept_out_of_the_map_where_it_is_seen_not_where_it_says_it_is() -> None:
    """Its frame is known to half a metre only; and however long it waits, it will go."""
    watch = Watch(EMPTY)
    watch.newcomers.company = [(np.array([2.0, 0.5]), RADIUS)]
    for stamp in (0.0, 200.0, 400.0):
        assert watch.dropped(EMPTY, stamp, person=(2.0, 0.0)) > 0
        assert watch.inside() == 0
    centre, _ = watch.newcomers.discs[0]
    assert np.hypot(*(centre - [2.0, 0.0])) < 0.1


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_sliver_of_another_robot_at_the_rim_of_sight_is_kept_out_of_the_map(side: float) -> None:
    """The outermost beams end on who is all but out of sight: too little to know anybody by."""
    away = 2.0
    hidden = LASER_270 / 2 + math.asin(RADIUS / away) - math.radians(1.5)
    person = (away * math.cos(hidden), side * away * math.sin(hidden))
    watch, scan = Watch(EMPTY), sweep(EMPTY, HERE, field_of_view=LASER_270)
    watch.newcomers.in_team = True
    seen = replace(scan, ranges=np.minimum(scan.ranges, to_disc(scan.bearings, person)))
    on_person = seen.ranges < scan.ranges
    assert 1 < np.count_nonzero(on_person) < 8
    watch.map.insert(watch.newcomers.sift(seen, HERE, watch.map), HERE, 0.0)
    assert watch.inside() == 0


def test_a_sliver_of_another_robot_behind_a_corner_is_kept_out_of_the_map() -> None:
    """A few beams end on it, where there was nothing but floor."""
    corner, behind_it = carved([ROOM], [(1.0, 0.0, 1.1, 3.0)]), Pose(2.5, 1.0, math.pi)
    watch, scan = Watch(corner), sweep(corner, HERE)
    watch.map.insert(sweep(corner, behind_it), behind_it, 0.0)
    watch.newcomers.in_team = True
    ranges = np.minimum(scan.ranges, to_disc(scan.bearings, (2.0, 0.18)))
    assert 1 <= np.count_nonzero(ranges < scan.ranges) <= 4
    walls = watch.inside()
    for stamp in (0.0, 1.0):
        look = replace(scan, ranges=ranges, stamp=stamp)
        watch.map.insert(watch.newcomers.sift(look, HERE, watch.map), HERE, 0.0)
    assert watch.inside() == walls


def test_a_wall_at_the_rim_of_sight_is_no_sliver() -> None:
    watch, scan = Watch(), sweep(EMPTY, HERE, field_of_view=LASER_270)
    watch.newcomers.in_team = True
    sifted = watch.newcomers.sift(scan, HERE, watch.map)
    assert np.array_equal(sifted.ranges, scan.ranges)
