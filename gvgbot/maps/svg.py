"""A drawing as an SVG file."""

from base64 import b64encode
from xml.etree import ElementTree as ET

from PIL import Image

from gvgbot.maps.canvas import COLOURS, Ink, palette, png, text_width
from gvgbot.maps.drawing import HALO, MIDDLE, Drawing, Raster, Stroke, Window, Words
from gvgbot.words import printable

_ANCHORS = {"lm": "start", "mm": "middle", "rm": "end"}


def svg(drawing: Drawing) -> bytes:
    """The file; its grid is a PNG inside it, all else are lines and words."""
    size = {"width": str(drawing.width), "height": str(drawing.height)}
    box = f"0 0 {drawing.width} {drawing.height}"
    root = ET.Element("svg", size, xmlns="http://www.w3.org/2000/svg", viewBox=box)
    ET.SubElement(root, "rect", size, fill=_colour(Ink.WHITE))
    for number, shape in enumerate(drawing.shapes):
        if isinstance(shape, Window):
            _add_window(root, shape, f"window{number}")
        elif isinstance(shape, Words):
            _add_words(root, shape)
        else:
            _add_shape(root, shape)
    ET.indent(root, "")
    file: bytes = ET.tostring(root, "utf-8", xml_declaration=True)
    return file


def _add_window(parent: ET.Element, window: Window, name: str) -> None:
    clip = ET.SubElement(parent, "clipPath", id=name)
    ET.SubElement(clip, "rect", _rectangle(window.corner, window.size))
    group = ET.SubElement(parent, "g", {"clip-path": f"url(#{name})"})
    for shape in window.shapes:
        _add_shape(group, shape)


def _add_shape(parent: ET.Element, shape: Stroke | Raster) -> None:
    if isinstance(shape, Raster):
        image = Image.fromarray(shape.shades)
        image.putpalette(palette())
        link = "data:image/png;base64," + b64encode(png(image)).decode()
        attributes = _rectangle(shape.corner, shape.size)
        style = f"image-rendering:{_sampling(shape)}"
        attributes |= {"preserveAspectRatio": "none", "style": style}
        ET.SubElement(parent, "image", attributes, href=link)
        return
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in shape.points.tolist())
    attributes = {
        "points": points,
        "fill": _colour(shape.fill),
        "stroke": _colour(shape.ink),
        "stroke-width": f"{shape.width:g}",
        "stroke-linejoin": "round",
        "stroke-linecap": "round",
    }
    ET.SubElement(parent, "polygon" if shape.is_closed else "polyline", attributes)


def _sampling(raster: Raster) -> str:
    """Square cells, or their mean where they are so small that thin walls would be left out."""
    return "pixelated" if raster.size[0] > raster.shades.shape[1] else "auto"


def _add_words(parent: ET.Element, words: Words) -> None:
    attributes = {
        "x": f"{words.at[0]:.2f}",
        "y": f"{words.at[1] + MIDDLE * words.size:.2f}",
        "textLength": f"{text_width(words.words, words.size):.2f}",  # whatever font there is
        "lengthAdjust": "spacingAndGlyphs",
        "text-anchor": _ANCHORS[words.anchor],
        "font-family": "Helvetica, Arial, sans-serif",
        "font-size": str(words.size),
        "fill": _colour(Ink.BLACK),
        "stroke": _colour(Ink.WHITE),
        "stroke-width": f"{HALO:g}",
        "stroke-linejoin": "round",
        "paint-order": "stroke",
    }
    ET.SubElement(parent, "text", attributes).text = printable(words.words)


def _rectangle(corner: tuple[float, float], size: tuple[float, float]) -> dict[str, str]:
    names = ("x", "y", "width", "height")
    return {name: f"{value:.2f}" for name, value in zip(names, (*corner, *size), strict=True)}


def _colour(ink: Ink | None) -> str:
    return "none" if ink is None else "#{:02x}{:02x}{:02x}".format(*COLOURS[ink])
