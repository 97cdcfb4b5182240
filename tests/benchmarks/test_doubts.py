"""Tours whose crossings nobody tells."""

from benchmarks.doubts import Doubting, streets
from benchmarks.figures.tours import NORTH, SIDE

MARGIN = 10.0


def test_a_town_has_as_many_street_ends_as_two_for_each_street() -> None:
    places = [(x, y) for x in range(SIDE) for y in range(SIDE)]
    assert sum(len(streets(place)) for place in places) == 2 * 2 * SIDE * (SIDE - 1)


def test_with_hardly_any_noise_every_crossing_is_known_again_at_once() -> None:
    tour = Doubting(0.05, 1, NORTH, MARGIN)
    tour.drive()
    crossings = SIDE**2 - 4  # but for the corners
    assert tour.tally["new added"] == crossings == len(tour.place)
    assert tour.tally.keys() == {"new added", "closed right"}


def test_a_robot_that_believes_the_likeliest_at_once_errs_where_a_cautious_one_does_not() -> None:
    """A margin below nought takes any vertex that is the only one in the gate."""
    rash, cautious = ({"WRONG": 0}, {"WRONG": 0})
    for counts, margin in ((rash, -1e3), (cautious, MARGIN)):
        for seed in range(4):
            tour = Doubting(0.7, seed, NORTH, margin)
            tour.drive()
            counts["WRONG"] += sum(n for what, n in tour.tally.items() if "WRONG" in what)
    assert cautious["WRONG"] == 0
    assert rash["WRONG"] > 0
