"""What an experiment found: a verdict in a line, and what it rests on."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """`figure` is a path seen from docs/; `table` has its head first, or is empty."""

    title: str
    claim: str  # what was published, or is to be shown
    verdict: str  # what came out, in a line
    holds: bool
    figure: str
    explained: str  # what the figure shows
    table: tuple[tuple[str, ...], ...] = ()
