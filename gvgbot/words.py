"""Words for people: numbers of things, and what others have said."""


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number and what there is of it; `many` if that is not `one` with an s."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def printable(text: str) -> str:
    """The text without what could play tricks on a terminal."""
    return "".join(c for c in text if c.isprintable())


def shortened(text: str, longest: int) -> str:
    """The text in so many characters, three at least: what is too much is left out of its middle.

    Names and paths that belong together begin or end differently.
    """
    if len(text) <= longest:
        return text
    tail = (longest - 1) // 2
    return f"{text[: longest - 1 - tail]}…{text[-tail:]}"
