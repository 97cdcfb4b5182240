"""Images as large as maps of large buildings are."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image


@contextmanager
def opened(path: Path) -> Iterator[Image.Image]:
    """An image, which is no bomb for being large; whatever PIL raises for what is none.

    Raises ValueError if it has more pixels than PIL opens at all.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            image = Image.open(path)
        except Image.DecompressionBombError:
            most = 2 * (Image.MAX_IMAGE_PIXELS or 0) // 1_000_000
            raise ValueError(f"more than {most} million pixels: make it smaller") from None
        with image:
            yield image
