"""The files of the page, and who may have them."""

import socket
from http import HTTPStatus
from importlib import resources
from ipaddress import ip_address

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
_EVERY_TIME = {
    "Cache-Control": "no-cache",
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Pages:
    """The page, read from the package once."""

    def __init__(self) -> None:
        folder = resources.files("gvgbot.web") / "static"
        self._files = {f"/{file.name}": file.read_bytes() for file in folder.iterdir()}
        self._files["/"] = self._files["/index.html"]

    def answer(self, path: str) -> Response:
        """The file at a path, or that there is none."""
        path = path.partition("?")[0]
        body = self._files.get(path)
        if body is None:
            return said(HTTPStatus.NOT_FOUND, f"there is no {path[:80]} here")
        name = "index.html" if path == "/" else path
        return _response(HTTPStatus.OK, _TYPES[name.rpartition(".")[2]], body)


def said(status: HTTPStatus, text: str, **more: str) -> Response:
    """A line of text; `more` are further fields of its head."""
    return _response(status, "text/plain; charset=utf-8", f"{text}\n".encode(), **more)


def _response(status: HTTPStatus, kind: str, body: bytes, **more: str) -> Response:
    fields = {"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"}
    return Response(status, status.phrase, Headers(fields | _EVERY_TIME | more), body)


def is_foreign(request: Request, own_host: str) -> bool:
    """Whether the request was made by, or under the name of, another site than this page.

    A page from anywhere can make a browser connect here; its name is then in Origin, or, if it has
    its name point to this machine, in Host.
    """
    hosts = request.headers.get_all("Host")
    if len(hosts) != 1 or not _is_ours(_name(hosts[0]), own_host):
        return True
    origins = request.headers.get_all("Origin")
    return any(origin.partition("://")[2] != hosts[0] for origin in origins)


def _name(host: str) -> str:
    """A Host field without its port, and an address without its brackets."""
    name, _, port = host.rpartition(":")
    return (name if name and port.isdecimal() else host).strip("[]").lower()


def _is_ours(name: str, own_host: str) -> bool:
    """Whether the name is an address, which nobody else can give to this machine, or our own."""
    machine = socket.gethostname().lower()
    if name in ("localhost", own_host.lower(), machine, f"{machine}.local"):
        return True
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
