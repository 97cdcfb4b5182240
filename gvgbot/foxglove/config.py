"""Where Foxglove can watch the robot."""

from dataclasses import dataclass
from typing import Annotated

from gvgbot.ranges import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveConfig:
    """A live view for the Foxglove app, over its WebSocket protocol; who connects only watches."""

    enabled: bool = False  # true: serve it; needs the foxglove extra
    host: str = "127.0.0.1"  # 0.0.0.0 lets everybody in
    port: Annotated[int, Range(0, 65535)] = 8765  # 0 takes any that is free
