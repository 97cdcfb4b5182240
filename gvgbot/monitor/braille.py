"""Dots as characters: each braille pattern is two dots wide and four high."""

import numpy as np
from numpy.typing import NDArray

DOTS_WIDE, DOTS_HIGH = 2, 4  # of a character
_FIRST = 0x2800  # the empty pattern
# Dots of a pattern are numbered down the left side, then the right, but the lowest two come last.
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.uint32)

Dots = NDArray[np.bool_]


def patterns(dots: Dots) -> NDArray[np.uint32]:
    """Code points (rows, columns) of the characters that show dots (4 rows, 2 columns).

    Row 0 is the top one.
    """
    rows, columns = dots.shape[0] // DOTS_HIGH, dots.shape[1] // DOTS_WIDE
    cells = dots.reshape(rows, DOTS_HIGH, columns, DOTS_WIDE)
    codes: NDArray[np.uint32] = np.einsum("ryxc,yc->rx", cells, _BITS, dtype=np.uint32)
    return codes + np.uint32(_FIRST)


def lit(dots: Dots) -> NDArray[np.bool_]:
    """Which characters (rows, columns) have a dot at all."""
    return patterns(dots) > _FIRST
