"""One line per measurement, with its target beside it, and all of them for who keeps them."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measured:
    """A figure, and what it is to be at most or at least; None where there is no target."""

    what: str
    value: float
    unit: str
    at_most: float | None = None
    at_least: float | None = None

    @property
    def is_missed(self) -> bool:
        """Whether it is beyond its target."""
        too_much = self.at_most is not None and self.value > self.at_most
        return too_much or (self.at_least is not None and self.value < self.at_least)

    @property
    def target(self) -> str:
        """In words; empty where there is none."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}"
        return "" if self.at_least is None else f"at least {self.at_least:g}"

    @property
    def ratio(self) -> float | None:
        """By its target."""
        target = self.at_least if self.at_most is None else self.at_most
        return self.value / target if target else None


measured: list[Measured] = []  # in this process so far


def report(what: str, value: float, unit: str, *, at_most: float) -> None:
    """Print what was measured, and what it is to be at most."""
    _note(Measured(what, value, unit, at_most=at_most))


def report_rate(what: str, value: float, unit: str, *, at_least: float) -> None:
    """Print what was measured, and what it is to be at least."""
    _note(Measured(what, value, unit, at_least=at_least))


def report_fact(what: str, value: float, unit: str) -> None:
    """Print what was measured, of which nothing is demanded."""
    _note(Measured(what, value, unit))


def _note(figure: Measured) -> None:
    measured.append(figure)
    target = f" ({figure.target})" if figure.target else ""
    missed = "  MISSED" if figure.is_missed else ""
    print(f"{figure.what:48} {figure.value:9.5g} {figure.unit}{target}{missed}", flush=True)
