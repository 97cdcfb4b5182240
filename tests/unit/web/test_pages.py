"""The files of the page, and whose requests are answered."""

import re
from importlib import resources

import pytest
from websockets.datastructures import Headers
from websockets.http11 import Request

from gvgbot.web.pages import Pages, is_foreign

STATIC = resources.files("gvgbot.web") / "static"


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/", "text/html"),
        ("/index.html", "text/html"),
        ("/main.js?v=1", "text/javascript"),
        ("/style.css", "text/css"),
        ("/icon.svg", "image/svg+xml"),
    ],
)
def test_the_page_is_served_with_its_types(path: str, kind: str) -> None:
    answer = Pages().answer(path)
    assert answer.status_code == 200
    assert answer.headers["Content-Type"].startswith(kind)
    assert int(answer.headers["Content-Length"]) == len(answer.body) > 0


@pytest.mark.parametrize("path", ["/nothing", "/../app.py", "/static/main.js", "//etc/passwd", ""])
def test_there_is_nothing_else(path: str) -> None:
    assert Pages().answer(path).status_code == 404


def test_the_page_needs_no_other_host() -> None:
    for file in STATIC.iterdir():
        found = re.findall(r"(?:https?:)?//[\w.-]+\.\w+|@import|url\(", file.read_text())
        assert [name for name in found if name != "http://www.w3.org"] == [], file.name


def test_every_file_that_the_page_names_is_there() -> None:
    files = {file.name: file.read_text() for file in STATIC.iterdir()}
    named = re.findall(r'(?:from "\./|src="|href=")([\w.-]+)"', "\n".join(files.values()))
    assert set(named) == files.keys() - {"index.html"}


def luminance(colour: str) -> float:
    """Of #rrggbb, as WCAG 2 has it."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = (p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_every_colour_stands_out_as_the_web_s_guidelines_want() -> None:
    """WCAG 2.1: 4.5 to 1 for text, 3 to 1 for the parts of a picture."""
    themes = (STATIC / "style.css").read_text().split("--paper: ")[1:]
    assert len(themes) == 3  # light, dark by the system, dark by choice
    for theme in themes:
        colours = dict(re.findall(r"--(\w+): (#\w{6})", "--paper: " + theme.split("}")[0]))
        text, back = ("ink", "faint", "good", "warning", "bad"), ("card", "paper")
        drawn = ("wall", "edge", "vertex", "ellipse", "frontier", "plan", "trail", "scan", "robot")
        wanted = [(one, on, 4.5) for one in text for on in back]
        wanted += [(one, on, 3.0) for one in drawn for on in ("floor", "paper")]
        for one, on, least in wanted:
            dark, light = sorted(luminance(colours[name]) for name in (one, on))
            assert (light + 0.05) / (dark + 0.05) >= least, (one, on)


def request(host: str | None, origin: str | None) -> Request:
    fields = {"Host": host, "Origin": origin}
    return Request("/", Headers({name: text for name, text in fields.items() if text is not None}))


@pytest.mark.parametrize(
    ("host", "origin", "expected"),
    [
        pytest.param("127.0.0.1:8080", None, False, id="a browser that opens the page"),
        pytest.param("127.0.0.1:8080", "http://127.0.0.1:8080", False, id="the page itself"),
        pytest.param("localhost:8080", "http://localhost:8080", False, id="by name"),
        pytest.param("[::1]:8080", "http://[::1]:8080", False, id="IPv6"),
        pytest.param("192.168.1.7", "http://192.168.1.7", False, id="the usual port"),
        pytest.param("[::1]", "http://[::1]", False, id="IPv6, the usual port"),
        pytest.param("robot.lab:8080", "http://robot.lab:8080", False, id="as --host names it"),
        pytest.param("127.0.0.1:8080", "https://example.com", True, id="a page from elsewhere"),
        pytest.param("127.0.0.1:8080", "http://127.0.0.1:9000", True, id="another port"),
        pytest.param("127.0.0.1:8080", "null", True, id="a page without an origin"),
        pytest.param("example.com:8080", "http://example.com:8080", True, id="a name made to fit"),
        pytest.param("example.com:8080", None, True, id="a name made to fit, page"),
        pytest.param(None, None, True, id="nobody"),
    ],
)
def test_only_the_page_itself_is_let_in(
    host: str | None, origin: str | None, expected: bool
) -> None:
    assert is_foreign(request(host, origin), "robot.lab") is expected
