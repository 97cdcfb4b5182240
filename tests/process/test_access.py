"""Who may watch a robot and who may command it, with the packaged files of zenoh.

An operator may do both, a monitor may only read, and strangers are not let in.
"""

import asyncio
import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path

import pytest
import zenoh

from benchmarks.rigs.addresses import free_endpoint
from gvgbot import client
from gvgbot.errors import GvgbotError, UsageError
from gvgbot.requests import Answer, Asked
from gvgbot.telemetry import Telemetry
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    Event,
    Events,
    Trajectory,
)
from gvgbot.zenoh_config import session_config
from tests.unit.monitor.maps import a_grid
from tests.unit.test_telemetry import EXAMPLE

pytestmark = pytest.mark.slow

PACKAGED = Path(str(files("gvgbot") / "configs" / "zenoh"))
INSTALLED = "/etc/gvgbot/zenoh"
WORDS = {"operator": "strong", "monitor": "weak", "somebody": "known", "teammate": "close"}
WAY = Trajectory(stamp=1.0, stamps=bytes(8), poses=bytes(12))


@dataclass(frozen=True)
class Network:
    """The files of a robot and of those who come to it."""

    endpoint: str
    robot: Path
    client: Callable[[str], Path]


def adapted(name: str, out: Path, *changes: tuple[str, str]) -> Path:
    """A packaged file with what a person has to change in it; each must be there."""
    text = (PACKAGED / name).read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    out.write_text(text)
    return out


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")
    directory = tmp_path_factory.mktemp("certificates")
    people = ["operator", "monitor", "somebody", "teammate"]
    for place, names in ((directory, people), (directory / "foreign", ["operator"])):
        script = [str(PACKAGED / "make_certificates.sh"), str(place), "localhost,127.0.0.1"]
        subprocess.run([*script, *names], check=True, capture_output=True, timeout=30)
    return directory


def test_a_certificate_that_is_kept_is_said_to_be(certificates: Path) -> None:
    before = (certificates / "robot.crt").read_bytes()
    script = [str(PACKAGED / "make_certificates.sh"), str(certificates), "other.local", "guest"]
    done = subprocess.run(script, check=True, capture_output=True, text=True, timeout=30)
    assert f"{certificates}/robot.crt: kept" in done.stdout
    assert (certificates / "robot.crt").read_bytes() == before


@pytest.mark.parametrize("address", ["192.168.1.7", "fd00::7"])
def test_a_certificate_is_for_addresses_as_well(certificates: Path, address: str) -> None:
    place = certificates / address.replace(":", "-")
    script = [str(PACKAGED / "make_certificates.sh"), str(place), f"robot.local,{address}", "you"]
    subprocess.run(script, check=True, capture_output=True, timeout=30)
    ask = ["openssl", "x509", "-noout", "-in", str(place / "robot.crt"), "-checkip", address]
    said = subprocess.run(ask, check=True, capture_output=True, text=True, timeout=30).stdout
    assert "does match certificate" in said


def tls(certificates: Path, tmp_path: Path) -> Network:
    endpoint = free_endpoint().replace("tcp/", "tls/")

    def of(person: str) -> Path:
        return adapted(
            "client_tls.json5",
            tmp_path / "client.json5",
            ("tls/robot.local:7447", endpoint),
            (f"{INSTALLED}/operator", f"{certificates}/{person}"),
            (f"{INSTALLED}/ca.crt", f"{certificates / person}".rpartition("/")[0] + "/ca.crt"),
        )

    robot = adapted(
        "robot_tls.json5",
        tmp_path / "robot.json5",
        (INSTALLED, str(certificates)),
        ("tls/0.0.0.0:7447", endpoint),
    )
    return Network(endpoint, robot, of)


def passwords(tmp_path: Path) -> Network:
    endpoint = free_endpoint()
    known = tmp_path / "passwords.txt"
    known.write_text("".join(f"{name}:{word}\n" for name, word in WORDS.items()))
    said = WORDS | {"foreign/operator": "x"}

    def of(person: str) -> Path:
        return adapted(
            "client_password.json5",
            tmp_path / "client.json5",
            ("tcp/robot.local:7447", endpoint),
            ('user: "monitor"', f'user: "{Path(person).name}"'),
            ("change me", said[person]),
        )

    robot = adapted(
        "robot_password.json5",
        tmp_path / "robot.json5",
        (f"{INSTALLED}/passwords.txt", str(known)),
        ("tcp/0.0.0.0:7447", endpoint),
    )
    return Network(endpoint, robot, of)


@pytest.fixture(params=["tls", "passwords"])
def network(request: pytest.FixtureRequest, tmp_path: Path) -> Network:
    if request.param == "tls":
        return tls(request.getfixturevalue("certificates"), tmp_path)
    return passwords(tmp_path)


def visit(network: Network, guest: Callable[[], object]) -> list[str]:
    """What a robot is asked for while a guest is there."""
    asked: list[str] = []

    async def handle(one: Asked) -> Answer:
        asked.append(one.name)
        return Answer(done=True, text=f"does {one.name}")

    async def live() -> None:
        with Telemetry(TelemetryConfig(zenoh_file=network.robot), "near") as robot:
            robot.publish(EXAMPLE)
            event = Event(number=0, stamp=1.0, kind="decision", details={})
            robot.publish(Events(events=(event,)))
            robot.publish(WAY)
            robot.publish(a_grid(".", number=2), a_grid("#", number=2))  # the first was long ago
            async with asyncio.TaskGroup() as tasks:
                serving = [tasks.create_task(robot.hear(handle)), tasks.create_task(robot.answer())]
                await asyncio.to_thread(guest)
                for task in serving:
                    task.cancel()

    asyncio.run(live())
    return asked


def enter(network: Network, person: str) -> client.Robot:
    return client.connect("near", zenoh_file=network.client(person), patience_s=2.0)


def test_the_operator_reads_and_commands(network: Network) -> None:
    def operate() -> None:
        with enter(network, "operator") as robot:
            assert next(iter(robot.state())) == EXAMPLE
            assert next(iter(robot.events())).kind == "decision"
            assert robot.pause().result() == "does pause"
            assert robot.goto(3).result() == "does goto"

    assert visit(network, operate) == ["pause", "goto"]


def test_the_only_robot_is_found(network: Network) -> None:
    def look() -> None:
        file = network.client("operator")
        assert client.only_robot(client.DEFAULT_ENDPOINT, zenoh_file=file) == "near"

    visit(network, look)


def test_a_monitor_reads_and_its_commands_come_to_nothing(network: Network) -> None:
    def watch() -> None:
        with enter(network, "monitor") as robot:
            assert next(iter(robot.state())) == EXAMPLE
            assert next(iter(robot.events())).kind == "decision"
            assert next(iter(robot.trajectory())) == WAY
            assert next(iter(robot.grid())).raster().cells[0, 0] == 100  # which it had to ask for
            assert robot.presence.word == "alive"
            for asking in (robot.pause(), robot.stop(), robot.goto(3), robot.set("a.b", 1)):
                with pytest.raises(GvgbotError, match=r"does not answer|has not answered"):
                    asking.result()

    assert visit(network, watch) == []


def test_a_monitor_cannot_speak_for_the_robot(network: Network) -> None:
    """What it puts on the robot's own keys reaches nobody."""
    heard: list[bytes] = []

    def pretend() -> None:
        settings = {"mode": "client"}
        with zenoh.open(session_config(settings, network.client("operator"))) as operator:
            operator.declare_subscriber(
                "gvgbot/near/state", lambda sample: heard.append(sample.payload.to_bytes())
            )
            with zenoh.open(session_config(settings, network.client("monitor"))) as monitor:
                answers = partial(monitor.get, "gvgbot/near/state", timeout=5.0)
                while not list(answers()):
                    pass  # it has not heard yet that the robot is there
                monitor.put("gvgbot/near/state", b"lies")
                monitor.put("gvgbot/near/ctl/stop", b"")
                assert len(list(answers())) == 1  # after what it has put

    assert visit(network, pretend) == []
    assert heard == []


def test_who_is_known_but_has_no_rights_gets_nothing(network: Network) -> None:
    def intrude() -> None:
        with enter(network, "somebody") as robot:
            assert robot.presence.word == "absent"
            assert robot.state().latest is None
            for unknown in (robot.grid().latest, robot.trajectory().latest, robot.health().latest):
                assert unknown is None
            with pytest.raises(GvgbotError):
                robot.stop().result()

    assert visit(network, intrude) == []


def test_robots_of_a_team_hear_each_other(network: Network) -> None:
    file = network.client("teammate")
    heard: dict[str, set[bytes]] = {"near": set(), "far": set()}

    async def talk(near: Telemetry, far: Telemetry) -> None:
        async with asyncio.timeout(30), asyncio.TaskGroup() as tasks:
            hearing = [
                tasks.create_task(near.hear_team(lambda _, data: heard["near"].add(data))),
                tasks.create_task(far.hear_team(lambda _, data: heard["far"].add(data))),
            ]
            while not all(heard.values()):
                near.tell_team("team", b"near")
                far.tell_team("team", b"far")
                await asyncio.sleep(0.05)
            for task in hearing:
                task.cancel()

    config = TelemetryConfig(listen=(free_endpoint(),), zenoh_file=file)
    with (
        Telemetry(TelemetryConfig(zenoh_file=network.robot), "near", relays=True) as near,
        Telemetry(config, "far", relays=True) as far,
    ):
        asyncio.run(talk(near, far))
    assert heard == {"near": {b"far"}, "far": {b"near"}}


def test_a_robot_that_comes_with_a_password_can_be_reached_itself(tmp_path: Path) -> None:
    network, own = passwords(tmp_path), free_endpoint()
    file = tmp_path / "teammate.json5"
    text = network.client("teammate").read_text()
    left_out = f'// dictionary_file: "{INSTALLED}/passwords.txt"'
    assert left_out in text
    file.write_text(
        text.replace(left_out, f"dictionary_file: {json.dumps(str(tmp_path / 'passwords.txt'))}")
    )
    config = TelemetryConfig(listen=(own,), zenoh_file=file)
    operator = network.client("operator")
    with (
        Telemetry(config, "far", relays=True),
        client.connect("far", own, zenoh_file=operator, patience_s=5.0) as robot,
    ):
        assert robot.presence.word != "absent"


def test_a_stranger_is_not_let_in(network: Network) -> None:
    """A certificate of another authority with the right name; a wrong password."""

    def intrude() -> None:
        with pytest.raises(GvgbotError, match=f"{network.endpoint}.*does not accept the keys"):
            enter(network, "foreign/operator").open()

    assert visit(network, intrude) == []


def test_without_any_keys_nobody_is_let_in(network: Network) -> None:
    def intrude() -> None:
        with pytest.raises(GvgbotError), client.connect("near", network.endpoint, patience_s=1.0):
            pass

    assert visit(network, intrude) == []


def test_the_lab_file_opens_the_robot_to_the_network() -> None:
    config = session_config({"listen/endpoints": ["tcp/127.0.0.1:1"]}, Path("lab.json5"))
    assert config.get_json("listen/endpoints") == '["tcp/0.0.0.0:7447"]'
    assert config.get_json("scouting/multicast/enabled") == "false"


def test_an_address_that_is_given_replaces_that_of_the_file(tmp_path: Path) -> None:
    file = adapted("client_password.json5", tmp_path / "client.json5")
    with (
        pytest.raises(GvgbotError, match=r"nobody answers at tcp/127\.0\.0\.1:9: .*keys of"),
        client.connect("near", "tcp/127.0.0.1:9", zenoh_file=file, patience_s=0.2),
    ):
        pass


@pytest.mark.parametrize(
    ("text", "says"),
    [("{ listen: ", "is no configuration of zenoh"), ("{ lissen: {} }", "unknown field `lissen`")],
)
def test_a_file_that_zenoh_does_not_understand_is_named(
    text: str, says: str, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.json5"
    file.write_text(text)
    with pytest.raises(UsageError, match=f"wrong.json5.*{says}"):
        Telemetry(TelemetryConfig(zenoh_file=file), "near")
    file.unlink()
    with pytest.raises(UsageError, match=r"cannot read .*wrong\.json5"):
        Telemetry(TelemetryConfig(zenoh_file=file), "near")
