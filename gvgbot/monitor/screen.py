"""What the terminal shows: a headline, the map beside all facts, and what happened."""

from dataclasses import dataclass, field

from rich.console import Console
from rich.style import Style
from rich.text import Text

from gvgbot.client import Event, Health, State
from gvgbot.monitor.chart import LAYERS, Chart, Layer, Scene, chart
from gvgbot.monitor.facts import Fact, Tone, facts, told
from gvgbot.words import printable, shortened

_FACTS_WIDTH, _NAME_WIDTH = 31, 10
_LEAST_MAP_WIDTH = 20
_NO_MAP = f"the map needs {_FACTS_WIDTH + 1 + _LEAST_MAP_WIDTH} columns"
_COLOURS: dict[Layer, str] = {
    "empty": "default",
    "wall": "white",
    "trail": "yellow",
    "edge": "cyan",
    "plan": "magenta",
    "frontier": "bold magenta",
    "vertex": "bold green",
    "mate": "bold yellow",
    "robot": "bold red",
}
_FLOOR = " on grey15"
_TONES: dict[Tone, str] = {
    "plain": "default",
    "good": "green",
    "warning": "yellow",
    "bad": "bold red",
    "faint": "bright_black",
}
_LEGEND: tuple[tuple[Layer, str, str], ...] = (
    ("robot", "→", "robot"),
    ("vertex", "●", "meetpoint"),
    ("vertex", "○", "endpoint"),
    ("frontier", "?", "frontier"),
    ("edge", "⠒", "edge"),
    ("trail", "⠒", "way"),
    ("plan", "⠒", "plan"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """All that is to be shown at a moment, for a terminal of any size.

    `is_fresh` is False for values that may be wrong by now; they are drawn faintly.
    """

    headline: Fact
    state: State | None = None
    scene: Scene = field(default_factory=Scene)
    events: tuple[Event, ...] = ()
    health: Health | None = None
    is_fresh: bool = True

    def lines(self, width: int, height: int) -> list[Text]:
        """So many lines, each as wide as the terminal."""
        listed = max(0, min(10, (height - 4) // 4))
        middle = max(0, height - listed - 3)
        map_width = width - _FACTS_WIDTH - 1
        if map_width < _LEAST_MAP_WIDTH:  # too narrow for both
            body, scale = self._facts(middle), None
        else:
            drawn = chart(self.scene, map_width, max(1, middle))
            beside = self._facts(middle)
            body = [_joined(a, b) for a, b in zip(self._map(drawn), beside, strict=False)]
            scale = drawn.scale
        lines = [self._head(width), *body[:middle], _ruled("events, how long ago", width)]
        lines = [*lines, *self._events(listed), _foot(scale, width)][:height]
        for line in lines:
            line.truncate(width, overflow="ellipsis", pad=True)
        return lines

    def _head(self, width: int) -> Text:
        name = shortened(self.headline.name, max(3, width // 2))
        text = Text(f" {name} ", "reverse bold")
        return text.append(f" {self.headline.text}", _TONES[self.headline.tone])

    def _map(self, drawn: Chart) -> list[Text]:
        lines = [
            _coloured(text, layers.tolist(), floor.tolist())
            for text, layers, floor in zip(drawn.text(), drawn.layers, drawn.floor, strict=True)
        ]
        return lines if self.is_fresh else [Text(line.plain, "bright_black") for line in lines]

    def _facts(self, height: int) -> list[Text]:
        known: list[Fact] = []
        if self.state is not None:
            known = list(facts(self.state, self.scene.plan, self.health))
        lines = [_line(fact, faint=not self.is_fresh) for fact in known[:height]]
        return lines + [Text()] * (height - len(lines))

    def _events(self, count: int) -> list[Text]:
        now = 0.0 if self.state is None else self.state.stamp
        said = [fact for event in self.events if (fact := told(event, now)) is not None]
        lines = [_line(fact, faint=False) for fact in said[-count:]] if count else []
        return lines + [Text()] * (count - len(lines))


class Screen:
    """Draws pictures on a console; sends only those lines that have changed."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._size = (0, 0)
        self._shown: list[str] = []

    def show(self, picture: Picture) -> None:
        """Replace the picture before; on a terminal that has been resized, all of it."""
        width, height = self._console.size
        if (width, height) != self._size:
            self._size, self._shown = (width, height), [""] * height
        lines = [self._rendered(line) for line in picture.lines(width, height)]
        changed = [
            f"\x1b[{row};1H{new}"
            for row, (new, old) in enumerate(zip(lines, self._shown, strict=True), start=1)
            if new != old
        ]
        self._shown = lines
        self._console.file.write("".join(changed))
        self._console.file.flush()

    def _rendered(self, line: Text) -> str:
        with self._console.capture() as capture:
            self._console.print(line, end="", no_wrap=True, crop=False)
        return capture.get()


def _joined(left: Text, right: Text) -> Text:
    return Text.assemble(left, " ", right)


def _line(fact: Fact, *, faint: bool) -> Text:
    tone = "bright_black" if faint else _TONES[fact.tone]
    name = f"{printable(fact.name):<{_NAME_WIDTH - 1}} "  # what a robot tells, whoever it is
    return Text.assemble((name, "bright_black"), (printable(fact.text), tone))


def _coloured(text: str, layers: list[int], floor: list[bool]) -> Text:
    """A line of the map, equal neighbours in one stretch."""
    line, start = Text(), 0
    for at in range(1, len(text) + 1):
        if at == len(text) or (layers[at], floor[at]) != (layers[start], floor[start]):
            style = _COLOURS[LAYERS[layers[start]]] + (_FLOOR if floor[start] else "")
            line.append(text[start:at], Style.parse(style))
            start = at
    return line


def _ruled(title: str, width: int) -> Text:
    return Text(f"── {title} ".ljust(width, "─")[:width], "bright_black")


def _foot(scale: float | None, width: int) -> Text:
    """What the signs mean, or why there are none, how large a character is, and how to leave."""
    right = ("" if scale is None else f"{scale:.2f} m per sign  ") + "q quit"
    text = Text()
    if scale is None:
        text.append(_NO_MAP, "yellow").truncate(max(0, width - len(right) - 1), overflow="ellipsis")
    for layer, sign, name in _LEGEND if scale is not None else ():
        if len(text) + len(f"{sign} {name}  ") > width - len(right):
            break
        text.append(sign, _COLOURS[layer]).append(f" {name}  ", "bright_black")
    text.pad_right(max(0, width - len(text) - len(right)))
    return text.append(right, "bright_black")
