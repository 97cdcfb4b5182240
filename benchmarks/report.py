"""One line per measurement, with its target beside it."""


def report(what: str, measured: float, unit: str, *, at_most: float) -> None:
    """Print what was measured, and what it is to be at most."""
    _print(what, measured, f"{unit} (at most {at_most:g})", missed=measured > at_most)


def report_rate(what: str, measured: float, unit: str, *, at_least: float) -> None:
    """Print what was measured, and what it is to be at least."""
    _print(what, measured, f"{unit} (at least {at_least:g})", missed=measured < at_least)


def _print(what: str, measured: float, rest: str, *, missed: bool) -> None:
    print(f"{what:48} {measured:9.5g} {rest}{'  MISSED' if missed else ''}", flush=True)
