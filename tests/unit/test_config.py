"""The configuration tree and the files that come with the package."""

import math
from pathlib import Path

import pytest

from gvgbot.config import Config, doubt_of_devices, load_config
from gvgbot.errors import ConfigError
from gvgbot.strict_yaml import as_mapping, packaged


def test_without_a_file_the_robot_is_simulated() -> None:
    config = load_config()
    assert config.twin.enabled
    assert config.twin.world == "office"


def test_the_defaults_of_the_code_never_move_a_real_robot() -> None:
    assert Config().twin.enabled


def test_the_simulated_robot_has_a_kobuki_and_ten_scans_a_second() -> None:
    config = load_config(Path("sim.yaml"))
    assert config.robot.radius_m == 0.177
    assert config.twin.laser.model == "UTM-30LX"
    assert config.laser.rate_hz == 10.0
    assert config.twin.base.odometry == "kobuki"


def test_the_turtlebot_is_real() -> None:
    config = load_config(Path("turtlebot2.yaml"))
    assert not config.twin.enabled
    assert config.base.port.startswith("/dev/")
    assert config.laser.port.startswith("/dev/")


def test_a_file_of_the_user_wins_over_a_packaged_one_of_the_same_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sim.yaml").write_text("robot: {name: mine}", encoding="utf-8")
    assert load_config(Path("sim.yaml")).robot.name == "mine"


def test_a_path_with_a_folder_is_never_a_packaged_file(tmp_path: Path) -> None:
    assert packaged(tmp_path / "sim.yaml") == tmp_path / "sim.yaml"


def test_a_start_pose_has_three_numbers() -> None:
    assert load_config(None, ["twin.start=[0, -8.2, 1]"]).twin.start == (0.0, -8.2, 1.0)


@pytest.mark.parametrize("key", ["laser.x_m", "laser.y_m"])
def test_a_laser_is_on_its_base(key: str) -> None:
    load_config(None, [f"{key}=-2"])
    with pytest.raises(ConfigError, match="must be a number from -2 to 2"):
        load_config(None, [f"{key}=47"])  # centimetres


@pytest.mark.parametrize("max_range_m", [0.5, 1.0])
def test_a_laser_that_could_see_nothing_is_refused(max_range_m: float) -> None:
    overrides = ["laser.min_range_m=1.0", f"laser.max_range_m={max_range_m}"]
    with pytest.raises(ConfigError, match=r"max_range_m = .*greater than min_range_m = 1"):
        load_config(None, overrides)
    load_config(None, [overrides[0], "laser.max_range_m=1.1"])


@pytest.mark.parametrize(
    ("walls", "complaint"),
    [
        ("[[[1, 2]]]", r"virtual_walls\[0\]: a wall needs two different points"),
        ("[[[0, 0], [1, 0]], [[1, 2], [1, 2]]]", r"virtual_walls\[1\]: a wall needs two"),
        ("[[1, 2], [3, 4]]", r"write \[\[\[1, 2\], \[3, 4\]\]\]"),
        ("[[[1, 2], [3, x]]]", r"virtual_walls\[0\]\[1\]\[1\] = 'x': must be a number"),
        ("[[[1, 2], [3, 1e9]]]", "from -10000 to 10000"),
        ("[[[1, 2], [3, .nan]]]", "must be a number"),
    ],
)
def test_a_virtual_wall_that_is_no_line_is_refused(walls: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        load_config(None, [f"autonomy.virtual_walls={walls}"])
    assert load_config(None, ["autonomy.virtual_walls=[]"]).autonomy.virtual_walls == ()


@pytest.mark.parametrize("name", ["a/b", "a b", "*", "", "ä"])
def test_a_name_that_cannot_be_part_of_a_topic_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="letters, digits"):
        load_config(None, [f"robot.name='{name}'"])


@pytest.mark.parametrize("key", ["max_braking_mps2", "max_angular_acceleration_radps2"])
def test_a_base_that_obeys_the_guard_late_is_refused(key: str) -> None:
    planned, gentle = getattr(load_config().robot.limits, key), 0.3
    with pytest.raises(ConfigError) as refused:
        load_config(None, [f"base.{key}={gentle}"])
    line = str(refused.value)
    assert f"base.{key} = {gentle} " in line
    assert f"robot.limits.{key} = {planned:g}," in line
    assert f"set robot.limits.{key} to {gentle} or less" in line
    assert "\n" not in line
    for overrides in ([f"robot.limits.{key}={gentle}", f"base.{key}={gentle}"], [f"base.{key}=4"]):
        load_config(None, overrides)


@pytest.mark.parametrize(
    ("settings", "search_rad"),
    [
        ([], 0.0),
        (["base.heading=wheels"], 0.4),
        (["base.heading=wheels", "autonomy.scan_matching.search_rad=0.2"], 0.2),
    ],
)
def test_without_a_gyro_scans_are_searched_for_what_a_slip_has_turned(
    settings: list[str], search_rad: float
) -> None:
    """A slip of 9 cm turns wheels that are 23 cm apart by 0.39 rad."""
    config = load_config(None, settings)
    assert config.mind.scan_matching.search_rad == search_rad
    if not search_rad:
        assert config.mind is config.autonomy


def test_a_port_can_only_be_that_of_one_device(tmp_path: Path) -> None:
    link = tmp_path / "laser"
    link.symlink_to("/dev/ttyUSB0")
    for laser in ("/dev/ttyUSB0", str(link)):
        ports = [f"laser.port={laser}", "base.port=/dev/ttyUSB0"]
        with pytest.raises(
            ConfigError, match=r"laser\.port and base\.port are one .*/dev/ttyUSB0:"
        ):
            load_config(None, [*ports, "twin.enabled=false"])
        load_config(None, ports)  # twins have none
    link.unlink()
    link.symlink_to(link)
    for laser in ("/dev/ttyUSB1", str(link)):
        ports = [f"laser.port={laser}", "base.port=/dev/ttyUSB0"]
        load_config(None, [*ports, "twin.enabled=false"])


def test_an_unknown_odometry_profile_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="must be one of perfect, kobuki, worn, wheels"):
        load_config(None, ["twin.base.odometry=ideal"])


def test_every_number_of_the_default_configuration_is_finite() -> None:
    def numbers(value: object) -> list[float]:
        if isinstance(value, dict):
            return [n for item in value.values() for n in numbers(item)]
        if isinstance(value, list):
            return [n for item in value for n in numbers(item)]
        return [value] if isinstance(value, int | float) else []

    found = numbers(as_mapping(load_config()))
    assert len(found) > 20
    assert all(math.isfinite(n) for n in found)


def test_the_defaults_are_within_their_own_ranges() -> None:
    def settings(value: object, path: str = "") -> list[str]:
        if not isinstance(value, dict):
            return [f"{path}={value}"] if isinstance(value, bool | int | float) else []
        prefix = f"{path}." if path else ""
        return [one for key in value for one in settings(value[key], f"{prefix}{key}")]

    mapping = as_mapping(Config())
    overrides = [
        text.replace("True", "true").replace("False", "false") for text in settings(mapping)
    ]
    assert as_mapping(load_config(None, overrides))["autonomy"] == mapping["autonomy"]


@pytest.mark.parametrize(
    "text", ["", "# base: {port: /dev/base}\n", "base:\n", "base: {}\ntwin:\n"]
)
def test_a_file_that_does_not_tell_twins_from_devices_is_doubted(text: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    assert load_config(path).twin.enabled
    assert "robot.yaml" in doubt_of_devices(path)
    assert doubt_of_devices(path, ["twin.seed=3"]) == ""


def test_who_asks_for_twins_or_for_no_file_is_not_doubted(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("twin: {world: ring}")
    assert [doubt_of_devices(one) for one in (None, path, Path("sim.yaml"))] == [""] * 3
