"""The robot in Foxglove: a live view, and a layout for it and for recordings."""

from pathlib import Path

LAYOUT = Path(__file__).with_name("layout.json")
