"""What a robot may be called: its name is a part of keys on the network."""

import re

ROBOT_NAME = r"[A-Za-z0-9_-]+"  # the whole of it


def is_robot_name(text: str) -> bool:
    """Whether the text can be a robot's part of a key."""
    return re.fullmatch(ROBOT_NAME, text) is not None
