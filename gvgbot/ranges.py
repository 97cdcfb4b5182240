"""The range of values that a configuration key allows."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Range:
    """Inclusive bounds, for use in `typing.Annotated`; None leaves a side open."""

    minimum: float | None = None
    maximum: float | None = None
