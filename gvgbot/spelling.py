"""What somebody meant who mistyped a name."""

import difflib
from collections.abc import Iterable


def nearest(typed: str, names: Iterable[str]) -> str | None:
    """The name that somebody may have meant, None if none comes near."""
    near = difflib.get_close_matches(typed, list(names), n=1, cutoff=0.6)
    return near[0] if near else None
