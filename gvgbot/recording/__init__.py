"""What a run was given and what it made of it, in MCAP files; and what such files give back.

Needs the `record` extra, which nothing else does: modules are imported when they are needed.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from gvgbot.autonomy.loop import Cycle
from gvgbot.errors import ExtraMissing
from gvgbot.hal.messages import Battery, Scan

Lived = Scan | Cycle | Battery
"""What a robot is given, and only has to be given again to leave the same map."""


@contextmanager
def extra_needed() -> Iterator[None]:
    """Turns a missing package into an ExtraMissing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in ("mcap", "google", "zstandard"):
            raise
        raise ExtraMissing("recordings need mcap and protobuf", "record") from error
