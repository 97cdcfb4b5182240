"""What a run was given and what it made of it, in MCAP files; and what such files give back.

Needs the `record` extra, which nothing else does: modules are imported when they are needed.
"""

from contextlib import AbstractContextManager

from gvgbot.autonomy.loop import Cycle
from gvgbot.errors import extra_for
from gvgbot.hal.messages import Battery, Scan

Lived = Scan | Cycle | Battery
"""What a robot is given, and only has to be given again to leave the same map."""


def extra_needed() -> AbstractContextManager[None]:
    """Turns a missing package into an ExtraMissing."""
    packages = "mcap", "google", "zstandard"
    return extra_for("recordings need mcap and protobuf", "record", *packages)
