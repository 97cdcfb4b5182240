"""Ways round discs on a plane, compared with what geometry says of tangents and arcs."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from gvgbot.autonomy.control.detour import detour, peek, stepping_off
from gvgbot.geometry import Array

RADIUS = 0.18  # of all bodies, m
TOUCH = 2 * RADIUS
ROOM, SOME, LITTLE = 0.32, 0.22, 0.17  # between two bodies that pass each other
EAST = np.stack([np.linspace(0.0, 6.0, 61), np.zeros(61)], axis=1)


def anywhere(way: Array) -> bool:
    return True


def between(low: float, high: float) -> Callable[[Array], bool]:
    """Whether a way keeps between two lines along x."""
    return lambda way: bool(((way[:, 1] > low) & (way[:, 1] < high)).all())


def gap(line: Array, *centre: float) -> float:
    """Between the robot that drives along a line and a body."""
    return float(np.hypot(*(line - centre).T).min()) - TOUCH


def length(line: Array) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def disc(*centre: float) -> tuple[Array, float]:
    return np.array(centre), RADIUS


def test_with_room_it_passes_on_the_right_by_tangents_and_an_arc() -> None:
    line = detour(EAST, [disc(3.0, 0.0)], RADIUS, anywhere)
    reach = TOUCH + ROOM
    away = reach + 0.8  # from the middle of the disc, where it turns aside
    straight = math.sqrt(away**2 - reach**2)
    arc = reach * (math.pi - 2 * math.acos(reach / away))
    assert length(line) == pytest.approx(6.0 - 2 * away + 2 * straight + arc, abs=0.1)
    assert gap(line, 3.0, 0.0) == pytest.approx(ROOM, abs=0.02)
    assert line[:, 1].max() < 0.05
    assert (line[[0, -1]] == EAST[[0, -1]]).all()


@pytest.mark.parametrize(("aside", "side"), [(0.3, -1), (-0.3, -1), (-0.5, 1)])
def test_on_the_left_it_passes_only_if_that_is_much_shorter(aside: float, side: int) -> None:
    line = detour(EAST, [disc(3.0, aside)], RADIUS, anywhere)
    turned = line[np.abs(line[:, 1]).argmax(), 1]
    assert math.copysign(1.0, turned) == side
    assert gap(line, 3.0, aside) > ROOM - 0.02


def test_where_the_wall_is_near_on_the_right_it_passes_on_the_left() -> None:
    line = detour(EAST, [disc(3.0, 0.0)], RADIUS, between(-0.3, 2.0))
    assert line[:, 1].max() == pytest.approx(TOUCH + ROOM, abs=0.02)


def test_where_there_is_little_room_it_passes_nearer_and_not_at_all_without_any() -> None:
    for wide, narrow in ((ROOM, SOME), (SOME, LITTLE)):
        half = TOUCH + (wide + narrow) / 2
        line = detour(EAST, [disc(3.0, 0.0)], RADIUS, between(-half, half))
        assert gap(line, 3.0, 0.0) == pytest.approx(narrow, abs=0.02)
    assert detour(EAST, [disc(3.0, 0.0)], RADIUS, between(-0.4, 0.4)) is EAST


def test_whoever_is_beside_the_line_or_at_its_end_changes_nothing() -> None:
    for centre in ((3.0, 0.9), (6.2, 0.0), (-1.0, 0.0)):
        assert detour(EAST, [disc(*centre)], RADIUS, anywhere) is EAST


def test_it_is_not_led_round_one_into_another() -> None:
    bodies = [disc(3.0, 0.0), disc(3.0, -1.0)]
    line = detour(EAST, bodies, RADIUS, anywhere)
    assert min(gap(line, 3.0, 0.0), gap(line, 3.0, -1.0)) > LITTLE - 0.02
    assert line[:, 1].max() > TOUCH


def test_it_is_led_round_one_after_the_other() -> None:
    bodies = [disc(3.6, 0.1), disc(2.2, 0.0)]  # so near that the ways round them meet
    for room in (between(-1.0, 1.0), between(-0.7, 1.0)):
        line = detour(EAST, bodies, RADIUS, room)
        assert min(gap(line, 3.6, 0.1), gap(line, 2.2, 0.0)) > LITTLE - 0.02
        assert length(line) < 6.6
        assert (line[[0, -1]] == EAST[[0, -1]]).all()


def test_who_stands_too_near_to_another_one_gets_away_from_it_at_once() -> None:
    line = detour(EAST, [disc(0.48, 0.0)], RADIUS, anywhere)
    away = np.hypot(*(line - [0.48, 0.0]).T)
    outside = int(np.argmax(away > TOUCH + ROOM - 0.02))
    assert outside > 0
    assert np.diff(away[: outside + 1]).min() > -0.01
    assert length(line[: outside + 1]) < 0.8


def test_it_looks_behind_who_hides_how_it_goes_on() -> None:
    seen = EAST[:16]  # up to 1.5 m
    line = peek(seen, [disc(2.5, 0.0), disc(9.0, 0.0)], RADIUS, anywhere)
    assert line[-1, 0] == pytest.approx(2.5, abs=0.1)
    assert line[-1, 1] == pytest.approx(-(TOUCH + ROOM), abs=0.05)
    assert gap(line, 2.5, 0.0) > ROOM - 0.02


def test_where_there_is_no_room_it_looks_from_as_near_as_is_free() -> None:
    seen = EAST[:16]
    near = peek(seen, [disc(2.5, 0.0)], RADIUS, between(-0.4, 0.4))
    assert gap(near, 2.5, 0.0) == pytest.approx(LITTLE, abs=0.1)
    assert gap(near, 2.5, 0.0) >= LITTLE

    def known(way: Array) -> bool:
        return bool(way[:, 0].max() < 1.75 and np.abs(way[:, 1]).max() < 0.4)

    assert peek(seen, [disc(2.5, 0.0)], RADIUS, known)[-1, 0] == pytest.approx(1.7, abs=0.05)
    assert peek(seen, [disc(2.1, 0.0)], RADIUS, between(-0.4, 0.4)) is seen


def test_who_stands_too_near_to_pass_steps_off_first() -> None:
    beside, behind = disc(0.12, 0.46), disc(-0.3, 2.0)
    step = stepping_off(EAST, EAST[0], [behind, beside], RADIUS, anywhere)
    away = np.hypot(*(step - [0.12, 0.46]).T)
    assert (step[0] == EAST[0]).all()
    assert np.diff(away).min() > 0.0
    assert away[-1] == pytest.approx(TOUCH + ROOM, abs=0.02)
    assert length(step) < 0.25
    some = stepping_off(EAST, EAST[0], [beside], RADIUS, between(-0.12, 2.0))
    stands = math.hypot(0.12, 0.46)
    assert some[:, 1].min() == pytest.approx((stands - TOUCH - SOME) * 0.46 / stands, abs=0.01)
    assert stepping_off(EAST, EAST[0], [beside], RADIUS, between(-0.01, 2.0)) is EAST
    assert stepping_off(EAST, EAST[0], [disc(0.12, 0.6)], RADIUS, anywhere) is EAST
