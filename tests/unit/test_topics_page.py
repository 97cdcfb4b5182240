"""The reference page of the network says what the table of topics says."""

import msgspec
import pytest

from docs.make_topics import PAGE, page
from gvgbot.telemetry_config import TelemetryConfig
from gvgbot.topics import (
    SCAN,
    STATE,
    TEAM_PARTS,
    TOPICS,
    LinkHealth,
    Topic,
    alive_key,
    team_key,
)

by_name = pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)


def section(topic: Topic) -> str:
    """What the file says under the heading of a topic."""
    text = PAGE.read_text(encoding="utf-8")
    return text.split(f"\n## `{topic.key('ROBOT')}`")[1].split("\n## ")[0]


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run make pages"


@by_name
def test_every_field_that_travels_has_a_row(topic: Topic) -> None:
    names = [field.name for field in msgspec.structs.fields(topic.payload)]
    table = section(topic).split("\n### ")[0]
    rows = [line.split("|")[1].strip() for line in table.splitlines() if line[:2] == "| "]
    assert rows == ["field", *(f"`{name}`" for name in names)]


@by_name
def test_every_row_says_its_type(topic: Topic) -> None:
    assert "``" not in section(topic), "a field whose source line was not found"


@by_name
def test_every_topic_is_listed_with_its_encoding(topic: Topic) -> None:
    row = next(
        line
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith(f"| `{topic.key('ROBOT')}` |")
    )
    assert f"gvgbot.{topic.payload.__name__}.v{topic.version}" in row


def test_scans_are_said_to_be_as_frequent_as_the_configuration_has_them() -> None:
    (row,) = [
        line
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith(f"| `{SCAN.key('ROBOT')}` |")
    ]
    assert "at most 10 Hz" in row
    assert TelemetryConfig().scan_rate_hz == 10.0


def test_the_liveliness_token_is_listed() -> None:
    assert f"`{alive_key('ROBOT')}`" in PAGE.read_text(encoding="utf-8")


def test_what_robots_of_a_team_tell_each_other_is_listed() -> None:
    for part in TEAM_PARTS:
        assert f"\n| `{team_key('ROBOT', part)}` |" in PAGE.read_text(encoding="utf-8")


def test_what_travels_within_a_payload_is_explained_too() -> None:
    text = section(STATE).split("\n### LinkHealth\n")[1].split("\n### ")[0]
    rows = [line.split("|")[1].strip() for line in text.splitlines() if line[:2] == "| "]
    assert rows == ["field", *(f"`{name}`" for name in LinkHealth.__struct_fields__)]
