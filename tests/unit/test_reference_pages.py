"""The reference pages say what the program says, and no more."""

import dataclasses
import json
import re
from types import ModuleType
from typing import get_args

import pytest
import yaml

from docs import (
    make_benchmarks,
    make_cli,
    make_client,
    make_configuration,
    make_events,
    make_figures,
)
from docs.make_configuration import unit_of
from gvgbot import client
from gvgbot.autonomy import events
from gvgbot.cli import main
from gvgbot.config import Config, load_config
from gvgbot.maps.run_directory import plain

PAGES = [make_benchmarks, make_cli, make_client, make_configuration, make_events, make_figures]


def rows_of(module: ModuleType) -> dict[str, list[list[str]]]:
    """The rows of the table below each heading of a page, without the head."""
    text = module.PAGE.read_text(encoding="utf-8")
    found = {}
    for section in text.split("\n## ")[1:]:
        lines = [line for line in section.splitlines() if line.startswith("| ")]
        cells = [line[2:-2].split(" | ") for line in lines[1:]]
        found[section.splitlines()[0].strip("`")] = cells
    return found


def keys_of(tree: object, prefix: str = "") -> list[str]:
    """The whole names of the leaves of a configuration as summary.json has it."""
    if not isinstance(tree, dict):
        return [prefix]
    return [name for key, part in tree.items() for name in keys_of(part, f"{prefix}.{key}")]


KEYS = {
    f"{section}.{row[0].strip('`')}".removeprefix("Top level."): row[1:]
    for section, rows in rows_of(make_configuration).items()
    for row in rows
}


@pytest.mark.parametrize("module", PAGES, ids=lambda module: module.PAGE.name)
def test_a_page_is_current(module: ModuleType) -> None:
    assert module.PAGE.read_text(encoding="utf-8") == module.page(), "run make pages"


def test_every_key_of_the_configuration_has_a_row() -> None:
    tree = json.loads(json.dumps(plain(Config())))
    assert sorted(KEYS) == sorted(name.removeprefix(".") for name in keys_of(tree))


def test_every_key_says_what_it_means() -> None:
    assert [key for key, (_, _, meaning) in KEYS.items() if not meaning.strip()] == []


def test_the_defaults_of_the_page_are_those_of_the_program() -> None:
    written = [f"{key}={row[0].strip('`')}" for key, row in KEYS.items()]
    pi = "base.max_turn_rate_radps"
    inexact = [text for text in written if not text.startswith(pi)]
    config = load_config(overrides=inexact)
    assert config == Config()
    assert float(KEYS[pi][0].strip("`")) == pytest.approx(3.14159, abs=1e-5)


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("robot.limits.max_speed_mps", "m/s"),
        ("robot.limits.max_braking_mps2", "m/s²"),
        ("laser.yaw_deg", "degrees"),
        ("laser.rate_hz", "Hz"),
        ("twin.laser.mishaps.reboots_per_h", "per hour"),
        ("autonomy.odometry_noise.turn_rad_per_sqrt_m", "rad/√m"),
        ("autonomy.odometry_noise.along_m_per_sqrt_m", "m/√m"),
        ("twin.base.battery_drain_v_per_h", "V per hour"),
        ("twin.laser.link.baud", "bit/s"),
        ("laser.missed_scans", ""),
        ("robot.name", ""),
    ],
)
def test_the_unit_of_a_key_is_the_end_of_its_name(key: str, unit: str) -> None:
    assert unit_of(key) == unit


@pytest.mark.parametrize("command", list(rows_of(make_cli)))
def test_the_options_of_a_command_are_those_of_its_help(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([*command.split()[1:], "--help"])
    told = set(re.findall(r"^  (--[\w-]+)", capsys.readouterr().out, re.MULTILINE))
    listed = {
        re.split(r"[`<> ]+", row[0])[1 + ("<" in row[0])] for row in rows_of(make_cli)[command]
    }
    assert {option for option in listed if option.startswith("-")} == told


def test_every_command_of_the_help_is_on_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    told = re.findall(r"^    ([a-z][a-z-]*)(?:  |$)", capsys.readouterr().out, re.MULTILINE)
    assert told
    assert {command.split()[1] for command in rows_of(make_cli)} == set(told)


def test_every_event_is_on_the_page_with_its_fields() -> None:
    listed = [[row[0].strip("`") for row in rows] for rows in rows_of(make_events).values()]
    fields = [[f.name for f in dataclasses.fields(event)] for event in get_args(events.Event)]
    assert listed == fields


def test_every_error_that_the_client_is_said_to_raise_can_be_had_from_it() -> None:
    text = make_client.PAGE.read_text(encoding="utf-8")
    assert set(re.findall(r"\w+Error", text)) <= set(client.__all__)


def test_types_are_written_as_in_the_source_and_not_as_python_has_them_inside() -> None:
    text = make_client.PAGE.read_text(encoding="utf-8")
    assert "`T | None`. The newest value" in text
    assert not re.search(r"~|Optional\[", text)


@pytest.mark.parametrize("name", client.__all__)
def test_every_name_of_the_client_is_on_the_page(name: str) -> None:
    assert f"`{name}`" in make_client.PAGE.read_text(encoding="utf-8")


def test_the_navigation_has_no_page_twice() -> None:
    text = (make_cli.PAGE.parents[2] / "mkdocs.yml").read_text(encoding="utf-8")
    nav = yaml.safe_load(text)["nav"]
    pages = re.findall(r"[\w/-]+\.md", json.dumps(nav))
    assert len(pages) == len(set(pages)) > 0
