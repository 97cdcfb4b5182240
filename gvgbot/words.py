"""Numbers of things, in words, and what somebody meant who mistyped a name."""

import difflib
from collections.abc import Iterable


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number and what there is of it; `many` if that is not `one` with an s."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def nearest(typed: str, names: Iterable[str]) -> str | None:
    """The name that somebody may have meant, None if none comes near."""
    near = difflib.get_close_matches(typed, list(names), n=1, cutoff=0.6)
    return near[0] if near else None
