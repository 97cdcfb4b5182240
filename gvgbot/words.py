"""Numbers of things, in words."""


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number and what there is of it; `many` if that is not `one` with an s."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"
