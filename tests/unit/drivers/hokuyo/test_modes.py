"""Which scans are asked for: by configuration, by angle, and by what the link can carry."""

import math
from typing import Any

import numpy as np
import pytest

from gvgbot.drivers.hokuyo.config import Echo, HokuyoConfig
from gvgbot.drivers.hokuyo.models import MODELS
from gvgbot.drivers.hokuyo.modes import choose_mode, configured_request, frame_bytes, link_rate
from gvgbot.drivers.hokuyo.scan_geometry import one_per_step, scan_geometry
from gvgbot.drivers.hokuyo.scip_messages import ScanReply, ScanRequest, parse_request

URG = MODELS["URG-04LX"].parameters
HALF = {"first_angle_deg": -90.0, "last_angle_deg": 90.0}


@pytest.mark.parametrize(
    ("request_", "size"),
    [
        (ScanRequest("MS", 44, 725), 1435),
        (ScanRequest("MD", 44, 725), 2137),
        (ScanRequest("MD", 44, 725, 2), 1082),
        (ScanRequest("MD", 44, 725, 3), 733),
        (ScanRequest("ME", 44, 725), 4247),
        (ScanRequest("MD", 0, 1080), 3372),
        (ScanRequest("ME", 0, 1080), 6717),
        (ScanRequest("MD", 0, 760), 2382),
    ],
    ids=lambda value: value.text() if isinstance(value, ScanRequest) else "",
)
def test_the_size_of_a_frame_is_that_of_the_table(request_: ScanRequest, size: int) -> None:
    assert frame_bytes(request_) == size


@pytest.mark.parametrize(
    ("model", "rate_hz", "skip"),
    [
        ("UTM-30LX", 10.0, 3),
        ("UTM-30LX", 40.0, 0),
        ("UTM-30LX", 13.0, 2),
        ("UTM-30LX", 1.0, 9),
        ("URG-04LX", 10.0, 0),
        ("URG-04LX", 40.0, 0),
        ("URG-04LX", 5.0, 1),
        ("UBG-04LX-F01", 10.0, 3),
        ("UXM-30LX-E", 10.0, 1),
        ("UHG-08LX", 10.0, 1),  # 15 a second: 7.5 are as near, on the safe side for the link
    ],
)
def test_scans_are_left_out_for_the_rate_that_is_wanted(
    model: str, rate_hz: float, skip: int
) -> None:
    request = configured_request(HokuyoConfig(rate_hz=rate_hz), MODELS[model].parameters)
    assert request.skip == skip


def test_a_configured_skip_beats_the_rate() -> None:
    config = HokuyoConfig(skip=1, rate_hz=40.0)
    assert configured_request(config, MODELS["UTM-30LX"].parameters).skip == 1


@pytest.mark.parametrize(
    ("changes", "baud", "expected"),
    [  # command, cluster, skip; by the milliseconds that a scan takes at each rate
        pytest.param({}, None, ("MD", 1, 0), id="USB carries everything"),
        pytest.param({}, 750000, ("MD", 1, 0), id="28 of 100 ms"),
        pytest.param({}, 115200, ("MD", 2, 0), id="186 ms do not fit, 94 ms do"),
        pytest.param({}, 57600, ("MD", 2, 1), id="127 ms in clusters of 3, 188 of 2"),
        pytest.param({"max_range_m": 4.0}, 115200, ("MD", 2, 0), id="125 ms with two characters"),
        pytest.param({"max_range_m": 4.0} | HALF, 115200, ("MS", 1, 0), id="two do for half of it"),
        pytest.param({"max_range_m": 4.0, "rate_hz": 5.0}, 115200, ("MD", 1, 1), id="slow enough"),
        pytest.param({"skip": 1}, 115200, ("MD", 1, 1), id="186 of 200 ms"),
        pytest.param({"adapt": False}, 115200, ("MD", 1, 0), id="as asked, come what may"),
        pytest.param(HALF, 115200, ("MD", 2, 0), id="half of it with three"),
    ],
)
def test_a_urg_04lx_is_asked_for_what_its_link_carries(
    changes: dict[str, Any], baud: int | None, expected: tuple[str, int, int]
) -> None:
    config = HokuyoConfig(**changes)
    mode = choose_mode(config, URG, baud)
    request = mode.request
    got = (request.command, request.cluster, request.skip)
    assert got == expected
    assert (mode.adapted is None) == (request == configured_request(config, URG))


def test_a_link_that_carries_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="300 bit/s"):
        choose_mode(HokuyoConfig(), MODELS["URG-04LX"].parameters, 300)


@pytest.mark.parametrize(
    ("config", "port", "sbps", "rate"),
    [
        (HokuyoConfig(), "/dev/pts/3", "Ethernet 100 [Mbps]", None),
        (HokuyoConfig(), "/dev/pts/3", "", None),
        (HokuyoConfig(), "/dev/pts/3", "19200[bps]", 57600),
        (HokuyoConfig(), "/dev/ttyACM1", "19200[bps]", None),
        (HokuyoConfig(), "/dev/ttyUSB0", "USB Full Speed", None),
        (HokuyoConfig(), "/dev/ttyUSB0", "19200[bps]", 57600),
        (HokuyoConfig(), "tcp://laser:10940", "", None),
        (HokuyoConfig(link="serial"), "/dev/ttyACM0", "", 57600),
        (HokuyoConfig(link="usb"), "/dev/ttyS0", "", None),
    ],
)
def test_a_link_is_known_by_its_port_and_by_the_laser(
    config: HokuyoConfig, port: str, sbps: str, rate: int | None
) -> None:
    assert link_rate(config, 57600, port, sbps) == rate


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("upside_down", [False, True])
def test_cropped_beams_lie_within_the_angles_and_none_is_missing(
    model: str, *, upside_down: bool
) -> None:
    parameters = MODELS[model].parameters
    config = HokuyoConfig(first_angle_deg=-30.0, last_angle_deg=75.0, upside_down=upside_down)
    request = configured_request(config, parameters)
    geometry = scan_geometry(config, parameters, request)
    bearings = geometry.scan(np.full(request.values, 1000, np.int32), 0.0).bearings
    assert bearings[0] == pytest.approx(math.radians(-30.0), abs=parameters.step_angle)
    assert bearings[-1] == pytest.approx(math.radians(75.0), abs=parameters.step_angle)
    assert bearings[0] >= math.radians(-30.0) - 1e-9
    assert bearings[-1] <= math.radians(75.0) + 1e-9


@pytest.mark.parametrize("cluster", [2, 3, 7, 99])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("upside_down", [False, True])
def test_every_beam_of_a_cluster_is_in_the_middle_of_its_steps(
    model: str, cluster: int, *, upside_down: bool
) -> None:
    parameters = MODELS[model].parameters
    config = HokuyoConfig(cluster=cluster, upside_down=upside_down)
    request = configured_request(config, parameters)
    geometry = scan_geometry(config, parameters, request)
    bearings = geometry.scan(np.full(request.values, 1000, np.int32), 0.0).bearings
    steps = np.arange(request.start, request.end + 1)
    groups = [steps[i : i + cluster] for i in range(0, len(steps), cluster)]
    middles = [parameters.bearing(float(np.mean(group))) for group in groups]
    expected = [-middle for middle in reversed(middles)] if upside_down else middles
    assert bearings == pytest.approx(expected)
    assert parameters.last_step - request.end < cluster


def test_a_cluster_of_a_slow_link_has_no_short_one_at_its_end() -> None:
    request = choose_mode(HokuyoConfig(skip=0), URG, 19200 * 4).request
    assert (request.start, request.end, request.cluster) == (44, 724, 3)


def test_a_cluster_that_is_wider_than_the_angles_is_an_error() -> None:
    config = HokuyoConfig(cluster=99, first_angle_deg=-5.0, last_angle_deg=5.0)
    with pytest.raises(ValueError, match="is 99, and there are 29 steps"):
        configured_request(config, URG)


def test_angles_without_a_beam_are_an_error() -> None:
    config = HokuyoConfig(first_angle_deg=150.0, last_angle_deg=170.0)
    with pytest.raises(ValueError, match="no beam"):
        configured_request(config, MODELS["URG-04LX"].parameters)
    with pytest.raises(ValueError, match="greater"):
        HokuyoConfig(first_angle_deg=10.0, last_angle_deg=10.0)


@pytest.mark.parametrize("string", ["ä", "a;b", "a\n", "a-b", "abcdefghijklmnopq", "٣"])
def test_a_string_that_no_laser_accepts_is_an_error_in_the_configuration(string: str) -> None:
    with pytest.raises(ValueError, match="must be up to 16 of A-Z"):
        HokuyoConfig(user_string=string)


@pytest.mark.parametrize("string", ["", "a7", "abcDEF_+@. 12345"])
def test_a_string_as_scip_has_it_marks_the_scans(string: str) -> None:
    request = configured_request(HokuyoConfig(user_string=string), MODELS["URG-04LX"].parameters)
    assert parse_request(request.text().encode()) == request


def test_a_laser_upside_down_sees_left_what_it_takes_for_right() -> None:
    parameters = MODELS["UTM-30LX"].parameters
    request = ScanRequest("MD", 0, 1080)
    readings = np.arange(1000, 2081, dtype=np.int32)
    upright = scan_geometry(HokuyoConfig(), parameters, request).scan(readings, 5.0)
    hanging = scan_geometry(HokuyoConfig(upside_down=True), parameters, request).scan(readings, 5.0)
    assert (np.diff(hanging.bearings) > 0.0).all()
    for beam in (0, 3, 540, 1080):  # the same beam, mirrored at the axis straight ahead
        twin = 1080 - beam
        assert hanging.bearings[twin] == pytest.approx(-upright.bearings[beam])
        assert hanging.ranges[twin] == upright.ranges[beam]
        upright_stamp = upright.stamp + beam * upright.time_increment
        assert hanging.stamp + twin * hanging.time_increment == pytest.approx(upright_stamp)


def echo_reply(*, with_intensities: bool = True) -> ScanReply:
    return ScanReply(
        ScanRequest("NE" if with_intensities else "ND", 0, 3),
        "99",
        0,
        np.array([700, 100, 900, 50, 60, 70, 5], np.int32),
        np.array([10, 5, 80, 30, 90, 20, 0], np.int32) if with_intensities else None,
        np.array([1, 2, 3, 1], np.int32),
    )


def test_one_echo_of_each_step_is_chosen() -> None:
    reply = echo_reply()
    assert one_per_step(reply, "first", URG)[0].tolist() == [700, 100, 50, 5]
    assert one_per_step(reply, "last", URG)[0].tolist() == [700, 900, 70, 5]
    ranges, intensities = one_per_step(reply, "strongest", URG)
    assert ranges.tolist() == [700, 900, 60, 5]
    assert intensities is not None
    assert intensities.tolist() == [10, 80, 90, 0]


def test_without_intensities_the_strongest_echo_is_the_first() -> None:
    ranges, intensities = one_per_step(echo_reply(with_intensities=False), "strongest", URG)
    assert ranges.tolist() == [700, 100, 50, 5]
    assert intensities is None


@pytest.mark.parametrize(
    ("echo", "ranges"),
    [
        ("first", [400, 500, 600, 7]),
        ("last", [400, 500, 800, 9]),
        ("strongest", [400, 500, 800, 8]),
    ],
)
def test_an_error_code_hides_no_good_echo(echo: Echo, ranges: list[int]) -> None:
    """A URG-04LX measures from 20 to 5600 mm."""
    readings = [400, 0, 65533, 500, 1, 600, 800, 5601, 7, 8, 9]
    strengths = [10, 99, 99, 10, 99, 10, 20, 99, 1, 3, 2]
    reply = ScanReply(
        ScanRequest("NE", 0, 3),
        "99",
        0,
        np.array(readings, np.int32),
        np.array(strengths, np.int32),
        np.array([2, 3, 3, 3], np.int32),
    )
    assert one_per_step(reply, echo, URG)[0].tolist() == ranges
