"""The layout names what there is: its own panels, and topics and fields of robot and recordings."""

import json
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, get_type_hints

from gvgbot.foxglove import LAYOUT
from gvgbot.recording.messages import CHANNELS
from gvgbot.recording.schemas import TYPES
from gvgbot.ros2.topics import TOPICS

READ: dict[str, Any] = json.loads(LAYOUT.read_text())
PANELS: dict[str, dict[str, Any]] = READ["configById"]
EVENT_FIELDS = {"event", "stamp"}  # the two that every event has


def leaves(node: Any) -> Iterator[str]:
    """The panels that are laid out."""
    if isinstance(node, str):
        yield node
        return
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column")
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def is_recorded(topic: str, path: list[str]) -> bool:
    """Whether a recording has such a field."""
    (channel,) = [channel for channel in CHANNELS if channel.topic == topic]
    if channel.encoding == "json":
        return not path or path[0] in EVENT_FIELDS
    kind = channel.schema
    for name in path:
        found = [field[2] for field in TYPES.get(kind, []) if field[1] == name]
        if not found:
            return False
        kind = found[0]
    return True


def is_live(topic: str, path: list[str]) -> bool:
    """Whether the live view has such a field."""
    (kind,) = [known.message for known in TOPICS if known.name == topic]
    found: Any = kind
    for name in path:
        if name not in {field.name for field in fields(found)}:
            return False
        found = get_type_hints(found)[name]
    return True


def test_every_panel_is_laid_out_once() -> None:
    assert sorted(leaves(READ["layout"])) == sorted(PANELS)


def test_every_path_leads_to_a_field() -> None:
    recorded, live = {c.topic for c in CHANNELS}, {topic.name for topic in TOPICS}
    paths = [one["value"] for panel in PANELS.values() for one in panel.get("paths", [])]
    paths += [panel["topicPath"] for panel in PANELS.values() if "topicPath" in panel]
    paths += [topic for panel in PANELS.values() for topic in panel.get("topics", {})]
    assert len(paths) > 10
    for path in paths:
        topic, *names = path.split(".")
        assert topic in recorded | live, path
        assert topic not in recorded - live or is_recorded(topic, names), path
        assert topic not in live or is_live(topic, names), path


def test_the_3d_panel_shows_all_there_is_to_see() -> None:
    (panel,) = [config for name, config in PANELS.items() if name.startswith("3D!")]
    assert panel["followTf"] == "map"  # a frame of recordings and of the live view
    shown = {topic for topic, how in panel["topics"].items() if how["visible"]}
    assert shown == {"/scan", "/map", "/gvg/markers"}
