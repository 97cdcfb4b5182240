import pytest

from gvgbot.autonomy.relocalisation import Opinion
from gvgbot.autonomy.returning import _given_up
from gvgbot.geometry import Pose


@pytest.mark.parametrize(
    ("opinion", "says"),
    [
        (Opinion(None, 0.0, 0, 9), "no place on the map fits"),
        (Opinion(Pose(), 0.7, 2, 9), "2 places fit, 0.70 for the best"),
        (
            Opinion(Pose(), 0.25, 4, 9, is_hopeless=True),
            "all the map looks the same from 4 places",
        ),
    ],
)
def test_a_robot_that_gives_up_says_what_to_do(opinion: Opinion, says: str) -> None:
    assert _given_up(opinion) == (
        f"not sure where it is: {says}; "
        "start it where it stopped, or begin a new map (gvgbot run --new)"
    )
