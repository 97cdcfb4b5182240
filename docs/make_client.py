"""Writes reference/client.md, the Python API of gvgbot.client, from signatures and docstrings.

python -m docs.make_client
"""

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from gvgbot import client
from gvgbot.client.event_stream import EventStream
from gvgbot.client.newest import Newest

PAGE = Path(__file__).parent / "reference" / "client.md"
HEAD = """\
# Python: gvgbot.client

<!-- Written by docs/make_client.py from gvgbot/client: change the docstrings there, not here. -->

```python
from gvgbot import client

with client.connect("sim") as robot:
    for state in robot.state():  # the newest one each time, however slow this loop is
        print(robot.presence.word, state.phase, state.pose)
```

Everything here works with `with` and `for` in a plain program, and with `async with`, `async for`
and `await` in one that has an event loop. Values that a robot sends (`State`, `Map` and others)
are listed with their fields under [Topics](../topics.md).
"""
WIDEST = 100  # of a signature in one line
INTERNAL = {"put", "swap"}  # public for this package only
CLASSES = (
    *(client.Robot, client.Asking, client.GvgbotError, client.UsageError, client.Refused),
    client.Presence,
    *(Newest, EventStream, client.Raster),
)


def page() -> str:
    """The whole page, Markdown."""
    functions = [_function(getattr(client, name)) for name in client.__all__ if name.islower()]
    sent = (name for name in client.__all__ if _is_sent(getattr(client, name)))
    values = ", ".join(f"`{name}`" for name in sent)
    also = f"## Values\n\nFrom `gvgbot.client` come also the types of what is sent: {values}.\n"
    constant = f"## `DEFAULT_ENDPOINT`\n\n`{client.DEFAULT_ENDPOINT}`: a robot on this machine.\n"
    return "\n".join([HEAD, *functions, constant, *map(_class, CLASSES), also])


def _is_sent(thing: object) -> bool:
    return isinstance(thing, type) and issubclass(thing, msgspec.Struct)


def _function(function: Callable[..., Any]) -> str:
    return f"## `{function.__name__}`\n\n{_described(function)}"


def _class(cls: type) -> str:
    parts = [f"## `{cls.__name__}`\n\n{inspect.getdoc(cls)}\n"]
    parts += [f"### `{name}`\n\n{_described(member)}" for name, member in _members(cls)]
    return "\n".join(parts)


def _members(cls: type) -> Iterator[tuple[str, Any]]:
    """The public methods and properties of its own, in the order of the source."""
    for name, member in vars(cls).items():
        is_public = not name.startswith("_") and name not in INTERNAL
        if is_public and (inspect.isfunction(member) or isinstance(member, property)):
            yield name, member


def _described(thing: Any) -> str:
    """The signature, and the docstring."""
    text = inspect.getdoc(thing) or ""
    if isinstance(thing, property):
        assert thing.fget is not None
        returns = inspect.signature(thing.fget).return_annotation
        return f"A property: `{_short(inspect.formatannotation(returns))}`. {text}\n"
    return f"```py\n{_signature(thing)}\n```\n\n{text}\n"


def _signature(function: Callable[..., Any]) -> str:
    signature = inspect.signature(function)
    unbound = [p for name, p in signature.parameters.items() if name != "self"]
    whole = _short(f"{function.__name__}{signature.replace(parameters=unbound)}")
    return (
        whole
        if len(whole) < WIDEST
        else whole.replace("(", "(\n    ", 1).replace(", *, ", ",\n    *, ")
    )


def _short(text: str) -> str:
    """Without the modules that types come from, and as types are written in the source."""
    text = re.sub(r"Optional\[~(\w+)\]", r"\1 | None", text)
    return re.sub(r"\b(?:[a-z_]+\.)+(?=[A-Z])|'(?=[A-Z])|(?<=[a-z])'(?=$)", "", text)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
