"""Images as large as maps of large buildings are."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image


@contextmanager
def opened(path: Path) -> Iterator[Image.Image]:
    """An image, which is no bomb for being large; whatever PIL raises for what is none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        with Image.open(path) as image:
            yield image
