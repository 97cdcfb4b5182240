"""A robot's grid, put together from the tiles that it sends; zenoh's threads come and go here."""

import threading
from collections.abc import Callable

import msgspec

from gvgbot.client.newest import Newest
from gvgbot.tiles import Grid, Tile


class Tiles:
    """All tiles that are known; those that were missed are asked for."""

    def __init__(self, newest: Newest[Grid], ask: Callable[[], None]) -> None:
        """`newest` gets the whole grid each time that it has grown; `ask` asks for all of it."""
        self._newest, self._ask = newest, ask
        self._gate = threading.Lock()
        self._tiles: dict[tuple[int, int], Tile] = {}
        self._began: float | None = None  # of the grid that the tiles belong to
        self._number = 0  # of the last message that is among them
        self._heard = 0  # the highest number that was heard of
        self._is_asking = False

    def take(self, changed: Grid) -> None:
        """Add what has changed, and ask for all if something is missing before it."""
        with self._gate:
            if changed.began != self._began:
                self._forget(changed.began)
            self._heard = max(self._heard, changed.number)
            if changed.number == self._number + 1:
                self._add(changed)
            must_ask = self._heard > self._number and not self._is_asking
            self._is_asking |= must_ask
        if must_ask:
            self._ask()

    def give_up(self) -> None:
        """Ask no more until something is heard again: the answer could not be read."""
        with self._gate:
            self._is_asking = False

    def take_all(self, whole: Grid) -> None:
        """The answer to what was asked."""
        with self._gate:
            self._is_asking = False
            if whole.began == self._began and whole.number <= self._number:
                return
            if whole.began != self._began:
                self._forget(whole.began)
            self._add(whole)
            must_ask = self._is_asking = self._heard > self._number
        if must_ask:
            self._ask()

    def _forget(self, began: float) -> None:
        self._tiles.clear()
        self._began, self._number, self._heard = began, 0, 0

    def _add(self, sent: Grid) -> None:
        self._tiles.update({(tile.row, tile.column): tile for tile in sent.tiles})
        self._number = sent.number
        known = msgspec.structs.replace(sent, tiles=tuple(self._tiles.values()))
        self._newest.put(lambda: known)
