"""Readings to ranges and bearings, against the tables of the makers."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.driver import HokuyoConfig
from gvgbot.drivers.hokuyo.models import MODELS, Identity, Parameters, find_model
from gvgbot.drivers.hokuyo.scan_geometry import in_the_middle, scan_geometry
from gvgbot.drivers.hokuyo.scip_messages import ScanRequest
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

UNLISTED = Parameters("XYZ-10LX", 20, 30000, 1440, 0, 1080, 540, 2400)


def scan_of(parameters: Parameters, readings: list[int], config: HokuyoConfig) -> Scan:
    request = ScanRequest("MD", parameters.first_step, parameters.last_step)
    geometry = scan_geometry(config, parameters, request)
    return geometry.scan(np.array(readings, np.int32), 1.0)


@pytest.mark.parametrize("group", [2, 3, 10])
@pytest.mark.parametrize("slant", [-60.0, -20.0, 0.0, 45.0])
def test_the_least_range_of_a_group_is_that_of_the_wall_in_its_middle(
    group: int, slant: float
) -> None:
    """A wall 2 m away, slanted to what is ahead; within 60 degrees of square to it."""
    alpha = np.radians(np.arange(-50, 50, 0.25))
    alpha = alpha[: len(alpha) // group * group]
    alpha = alpha[np.abs(alpha - math.radians(slant)) < math.radians(60)]
    alpha = alpha[: len(alpha) // group * group].reshape(-1, group)
    least = (2.0 / np.cos(alpha - math.radians(slant))).min(axis=1)
    middle = 2.0 / np.cos(alpha.mean(axis=1) - math.radians(slant))
    off, before = in_the_middle(least, group) - middle, least - middle
    assert np.abs(off[1:-1]).max() < 0.004
    assert np.abs(before[1:-1]).max() > 0.005 * (group - 1)


def test_where_a_wall_ends_no_range_is_moved_towards_what_is_behind() -> None:
    """Two walls square to the beams, and one that runs away until a door is open behind it."""
    gone, square = math.inf, np.array([1.0, 1.0, 1.0, 3.0, 3.0, 3.0, math.nan, 2.0, 2.0, math.inf])
    assert in_the_middle(square, 3) == pytest.approx(square, nan_ok=True)
    away = 1.0 / np.array([1.0, 0.99, 0.98, 0.97, 0.5])
    there = in_the_middle(np.append(away, gone), 3)
    assert there[1:4] == pytest.approx(1.0 / np.array([0.99, 0.98, 0.97]), abs=0.0035 + 0.005)
    assert there[3] < 1.0 / 0.96
    assert there[5] == gone


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_beam_of_three_steps_was_measured_with_the_step_in_its_middle(
    *, upside_down: bool
) -> None:
    """A URG-04LX turns once in 0.1 s, with 1024 steps in a turn, of which 384 looks ahead."""
    request = ScanRequest("MD", 44, 725 - 1, 3)
    geometry = scan_geometry(
        HokuyoConfig(upside_down=upside_down), MODELS["URG-04LX"].parameters, request
    )
    scan = geometry.scan(np.full(227, 1000, np.int32), 1.0)
    steps = 45.0 + 3.0 * np.arange(227)
    steps = steps[::-1] if upside_down else steps
    stamps = scan.stamp + scan.time_increment * np.arange(227)
    assert stamps == pytest.approx(1.0 + steps * 0.1 / 1024, abs=1e-9)
    left = -1.0 if upside_down else 1.0
    assert scan.bearings == pytest.approx(left * (steps - 384.0) * math.tau / 1024)


def test_ranges_of_groups_are_whole_millimetres_as_well() -> None:
    """So a scan that is kept takes no more for a beam of many steps than for one of one."""
    parameters = MODELS["URG-04LX"].parameters
    request = ScanRequest("MD", parameters.first_step, parameters.first_step + 17, 3)
    readings = np.array([1000, 1050, 1110, 1190, 1280, 1400])
    ranges = scan_geometry(HokuyoConfig(), parameters, request).scan(readings, 1.0).ranges
    assert (ranges[1:-1] > readings[1:-1] / 1000.0).all()
    assert (ranges == np.rint(ranges * 1000.0) / 1000.0).all()


def ranges_of(parameters: Parameters, readings: list[int], **config: Any) -> Array:
    return scan_of(parameters, readings, HokuyoConfig(**config)).ranges


@pytest.mark.parametrize(
    ("parameters", "readings", "ranges"),
    [
        pytest.param(
            MODELS["URG-04LX"].parameters,
            [0, 1, 6, 7, 10, 19, 20, 5600, 5601],
            [math.inf] + [math.nan] * 5 + [0.02, 5.6, math.inf],
            id="URG-04LX",
        ),
        pytest.param(
            MODELS["UTM-30LX"].parameters,
            [0, 1, 2, 3, 5, 22, 23, 30000, 45000, 65533],
            [math.nan, math.inf] + [math.nan] * 4 + [0.023, 30.0, math.inf, math.inf],
            id="UTM-30LX",
        ),
        pytest.param(
            MODELS["UST-10LX"].parameters,
            [0, 19, 20, 10000, 10001, 29999, 30000, 65533],
            [math.nan] * 2 + [0.02, 10.0, 10.001, 29.999, 30.0, math.inf],
            id="a UST-10LX, which is sure of 10 m and tells of up to 30",
        ),
        pytest.param(
            replace(MODELS["URG-04LX"].parameters, model="URG-04LX[Classic](Hokuyo)"),
            [0, 1, 19, 20],
            [math.inf] + [math.nan] * 2 + [0.02],
            id="a URG-04LX by another name",
        ),
        pytest.param(
            replace(MODELS["URG-04LX"].parameters, range_max_mm=4095),
            [20, 4095, 4096, 5600],
            [0.02, 4.095] + [math.inf] * 2,
            id="a URG-04LX with firmware that reaches 4 m",
        ),
        pytest.param(
            UNLISTED,
            [0, 1, 2, 19, 20, 30000, 65533],
            [math.nan, math.inf] + [math.nan] * 2 + [0.02, 30.0, math.inf],
            id="not listed, steps of a UTM",
        ),
        pytest.param(
            replace(UNLISTED, steps_per_turn=1024),
            [0, 1, 19, 20],
            [math.inf] + [math.nan] * 2 + [0.02],
            id="not listed, steps of a URG",
        ),
        pytest.param(
            replace(UNLISTED, steps_per_turn=3600),
            [0, 1, 19, 20, 65533],
            [math.nan] * 3 + [0.02, math.inf],
            id="of no known family",
        ),
    ],
)
def test_codes_and_ranges_are_told_apart(
    parameters: Parameters, readings: list[int], ranges: list[float]
) -> None:
    np.testing.assert_allclose(ranges_of(parameters, readings), ranges)


def test_nothing_hit_means_free_no_farther_than_the_laser_itself_reaches() -> None:
    parameters = replace(MODELS["URG-04LX"].parameters, range_max_mm=4095)
    assert scan_of(parameters, [0], HokuyoConfig()).range_max == 4.095
    surely = scan_of(MODELS["UST-10LX"].parameters, [65533, 12000], HokuyoConfig())
    assert surely.range_max == 10.0  # though it sees something farther off


def test_configured_limits_narrow_those_of_the_laser() -> None:
    ranges = ranges_of(
        MODELS["UTM-30LX"].parameters, [1, 5, 99, 100, 4000, 4001], min_range_m=0.1, max_range_m=4.0
    )
    np.testing.assert_allclose(ranges, [math.inf, math.nan, math.nan, 0.1, 4.0, math.inf])


def test_the_mount_is_where_the_configuration_says() -> None:
    config = HokuyoConfig(x_m=0.1, y_m=-0.02, yaw_deg=90.0)
    scan = scan_of(MODELS["UTM-30LX"].parameters, [1000], config)
    assert scan.base_laser == Pose(0.1, -0.02, math.pi / 2)


@pytest.mark.parametrize(
    ("name", "first_deg", "last_deg", "beams", "period"),
    [("URG-04LX", -119.53, 119.88, 682, 0.1), ("UTM-30LX", -135.0, 135.0, 1081, 0.025)],
)
def test_bearings_and_times_are_the_makers(
    name: str, first_deg: float, last_deg: float, beams: int, period: float
) -> None:
    parameters = MODELS[name].parameters
    assert np.degrees(parameters.bearings[[0, -1]]) == pytest.approx(
        [first_deg, last_deg], abs=0.01
    )
    assert len(parameters.bearings) == beams
    assert parameters.period == pytest.approx(period)
    assert parameters.bearing(parameters.front_step) == 0.0


@pytest.mark.parametrize("name", MODELS)
def test_parameters_come_back_from_their_lines(name: str) -> None:
    parameters = MODELS[name].parameters
    assert Parameters.from_lines(parameters.lines()) == parameters
    known = find_model(parameters.model)
    assert known is not None
    assert known.parameters == parameters


@pytest.mark.parametrize(
    ("told", "meant"),
    [
        ("UTM-30LX-EW(Hokuyo Automatic Co.,Ltd.)", "UTM-30LX-EW"),
        ("SOKUIKI Sensor TOP-URG UTM-30LX(Hokuyo Automatic Co.,Ltd.)", "UTM-30LX"),
        ("UST-10LX", "UST-10LX"),
    ],
)
def test_a_model_is_known_by_its_name_wherever_that_stands(told: str, meant: str) -> None:
    assert find_model(told) is MODELS[meant]


def test_an_identity_comes_back_from_its_lines() -> None:
    identity = Identity("maker", "product", "1.0", "SCIP 2.0", "H1")
    assert Identity.from_lines(identity.lines()) == identity


@pytest.mark.parametrize(
    "change", [{"DMIN": "x"}, {"ARES": "0"}, {"SCAN": "0"}, {"AMAX": "-3"}, {"DMAX": "20"}]
)
def test_parameters_that_make_no_sense_are_refused_and_told(change: dict[str, str]) -> None:
    ((key, value),) = change.items()
    with pytest.raises(ValueError, match=f"{key}:{value}"):
        Parameters.from_lines(MODELS["URG-04LX"].parameters.lines() | change)


def test_a_missing_parameter_is_named() -> None:
    lines = MODELS["URG-04LX"].parameters.lines()
    del lines["ARES"]
    with pytest.raises(ValueError, match="ARES"):
        Parameters.from_lines(lines)
