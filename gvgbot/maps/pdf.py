"""A drawing as a PDF file of one page (ISO 32000-1)."""

import zlib
from collections.abc import Iterator, Sequence

import numpy as np

from gvgbot.maps.canvas import COLOURS, Ink, Point, palette, text_width
from gvgbot.maps.drawing import HALO, MIDDLE, Drawing, Raster, Stroke, Window, Words

_POINTS = 0.4  # of a page (1/72 inch) per pixel: a map 1400 pixels wide fits on A4
_SHARES = {"lm": 0.0, "mm": 0.5, "rm": 1.0}  # of the words that stand left of where they are put
_FIRST_IMAGE = 6  # number of its object
_FONT = b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>"


def pdf(drawing: Drawing) -> bytes:
    """The file; its grid is an image, all else are lines, and words in Helvetica."""
    page = _Page()
    for shape in drawing.shapes:
        page.add(shape)
    width, height = drawing.width * _POINTS, drawing.height * _POINTS
    names = range(_FIRST_IMAGE, _FIRST_IMAGE + len(page.images))
    images = " ".join(f"/I{number} {number} 0 R" for number in names)
    upright = f"{_POINTS} 0 0 {-_POINTS} 0 {height:.2f} cm 1 J 1 j\n"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.2f} {height:.2f}] /Contents 4 0 R "
        f"/Resources << /Font << /F 5 0 R >> /XObject << {images} >> >> >>".encode(),
        _stream("", (upright + "\n".join(page.lines)).encode("cp1252", "replace")),
        _FONT,
        *(_image(raster) for raster in page.images),
    ]
    return _file(objects)


class _Page:
    """Lines of the page's content, in pixels with y downwards."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.images: list[Raster] = []

    def add(self, shape: Window | Stroke | Raster | Words) -> None:
        if isinstance(shape, Window):
            self._add_window(shape)
        elif isinstance(shape, Raster):
            self._add_raster(shape)
        elif isinstance(shape, Words):
            self.lines += _words(shape)
        else:
            self.lines += _stroke(shape)

    def _add_window(self, window: Window) -> None:
        (x, y), (width, height) = window.corner, window.size
        self.lines.append(f"q {x:.2f} {y:.2f} {width:.2f} {height:.2f} re W n")
        for shape in window.shapes:
            self.add(shape)
        self.lines.append("Q")

    def _add_raster(self, raster: Raster) -> None:
        (x, y), (width, height) = raster.corner, raster.size
        number = _FIRST_IMAGE + len(self.images)
        self.images.append(raster)
        placed = f"{width:.2f} 0 0 {-height:.2f} {x:.2f} {y + height:.2f} cm"
        self.lines.append(f"q {placed} /I{number} Do Q")


def _stroke(stroke: Stroke) -> Iterator[str]:
    """The path, and what is done with it: filled, drawn, or both."""
    if stroke.fill is not None:
        yield f"{_colour(stroke.fill)} rg"
    if stroke.ink is not None:
        yield f"{_colour(stroke.ink)} RG {stroke.width:.2f} w"
    (first, *others) = stroke.points.tolist()
    yield f"{_at(first)} m " + " ".join(f"{_at(point)} l" for point in others)
    paint = {(False, True): "S", (True, False): "f", (True, True): "B"}
    close = "h " if stroke.is_closed else ""
    yield close + paint[stroke.fill is not None, stroke.ink is not None]


def _words(words: Words) -> Iterator[str]:
    """First the halo, then the words; the font has y upwards."""
    x = words.at[0] - _SHARES[words.anchor] * text_width(words.words, words.size)
    place = f"1 0 0 -1 {_at((x, words.at[1] + MIDDLE * words.size))} Tm"
    escaped = words.words.translate({ord(sign): f"\\{sign}" for sign in "\\()"})
    yield f"{_colour(Ink.WHITE)} RG {_colour(Ink.BLACK)} rg {HALO:.2f} w"
    yield f"BT /F {words.size} Tf {place} 1 Tr ({escaped}) Tj {place} 0 Tr ({escaped}) Tj ET"


def _at(point: Point | Sequence[float]) -> str:
    return f"{point[0]:.2f} {point[1]:.2f}"


def _colour(ink: Ink) -> str:
    return " ".join(f"{level / 255:.3f}" for level in COLOURS[ink])


def _image(raster: Raster) -> bytes:
    rows, columns = raster.shades.shape
    colours = palette()
    head = (
        f"/Type /XObject /Subtype /Image /Width {columns} /Height {rows} /BitsPerComponent 8 "
        f"/ColorSpace [/Indexed /DeviceRGB {len(colours) // 3 - 1} <{bytes(colours).hex()}>] "
    )
    return _stream(head, np.ascontiguousarray(raster.shades).tobytes())


def _stream(head: str, content: bytes) -> bytes:
    packed = zlib.compress(content)
    return (
        f"<< {head}/Filter /FlateDecode /Length {len(packed)} >>\nstream\n".encode()
        + packed
        + b"\nendstream"
    )


def _file(objects: Sequence[bytes]) -> bytes:
    """Objects from number 1 on, and the table of where they are."""
    file, offsets = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", []
    for number, content in enumerate(objects, start=1):
        offsets.append(len(file))
        file += f"{number} 0 obj\n".encode() + content + b"\nendobj\n"
    count = len(objects) + 1
    entries = "".join(f"{offset:010} 00000 n \n" for offset in offsets)
    table = f"xref\n0 {count}\n0000000000 65535 f \n{entries}"
    trailer = f"trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{len(file)}\n%%EOF\n"
    return file + (table + trailer).encode()
