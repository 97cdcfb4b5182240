"""HTTP for the page and a WebSocket for each that is open, on one port."""

import asyncio
import contextlib
import errno
import logging
import socket
from collections.abc import Awaitable, Callable
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from gvgbot.errors import GvgbotError
from gvgbot.web.pages import Pages, is_foreign, said
from gvgbot.web.viewers import Audience, Viewer
from gvgbot.web.wire import Reply, Wish, frame, wish

_FOREIGN = "open the page by this machine's address, or by the name given with --host"
_TOO_MANY = "there are too many viewers: close the page where nobody looks at it"
LIVE = "/live"  # where the page asks for its WebSocket
_METHODS = "GET, HEAD"
_MOST_VIEWERS = 32
_LONGEST_WISH = 2000  # bytes
_MOST_WISHES = 4  # of one viewer that have not been answered

Fulfil = Callable[[Wish], Awaitable[Reply]]

_log = logging.getLogger("gvgbot.web")
_log.addHandler(logging.NullHandler())  # a connection that breaks off is nobody's concern here
_log.propagate = False


class Web:
    """The server of one robot's page; `fulfil` asks the robot for things."""

    def __init__(self, host: str, port: int, audience: Audience, fulfil: Fulfil) -> None:
        self._host, self._port = host, port
        self._audience, self._fulfil = audience, fulfil
        self._pages = Pages()

    async def open(self) -> Server:
        """Listen; the server is a context manager that stops. Raises GvgbotError."""
        try:
            return await serve(
                self._attend,
                self._host,
                self._port,
                process_request=self._receive,
                max_size=_LONGEST_WISH,
                close_timeout=1.0,
                logger=_log,
                server_header="gvgbot",
            )
        except (OSError, UnicodeError) as error:  # the latter of a host like a..b
            where = f"{self._host}:{self._port}"
            raise GvgbotError(f"cannot serve at {where}: {_why(error)}") from error

    def _receive(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None lets it become a WebSocket."""
        method = getattr(request, "method", "GET")  # older websockets let nothing else through
        response = self._response(request, method)
        if response is not None and method == "HEAD":
            response.body = b""
        return response

    def _response(self, request: Request, method: str) -> Response | None:
        if is_foreign(request, self._host):
            return said(HTTPStatus.FORBIDDEN, _FOREIGN)
        if method not in ("GET", "HEAD"):
            return said(HTTPStatus.METHOD_NOT_ALLOWED, f"there is only {_METHODS}", Allow=_METHODS)
        if request.path != LIVE:
            return self._pages.answer(request.path)
        if "Upgrade" not in request.headers:
            return said(HTTPStatus.UPGRADE_REQUIRED, "this is for the page, not for people")
        return None

    async def _attend(self, connection: ServerConnection) -> None:
        """Serve one viewer until it leaves; one too many is told so, as its page can read it."""
        if len(self._audience) >= _MOST_VIEWERS:
            await connection.close(CloseCode.TRY_AGAIN_LATER, _TOO_MANY)
            return
        viewer = Viewer()
        self._audience.join(viewer)
        try:
            async with asyncio.TaskGroup() as tasks:
                sending = tasks.create_task(_send(connection, viewer))
                await self._listen(connection, viewer)
                sending.cancel()
        finally:
            self._audience.leave(viewer)

    async def _listen(self, connection: ServerConnection, viewer: Viewer) -> None:
        """Fulfil wishes, until the viewer leaves or says what no page of ours says."""
        unanswered = asyncio.Semaphore(_MOST_WISHES)
        async with asyncio.TaskGroup() as tasks:
            with contextlib.suppress(ConnectionClosed):
                async for text in connection:
                    try:
                        wanted = wish(text)
                    except ValueError as error:
                        await connection.close(CloseCode.POLICY_VIOLATION, str(error)[:100])
                        return
                    await unanswered.acquire()
                    asking = tasks.create_task(self._answer(wanted, viewer))
                    asking.add_done_callback(lambda _: unanswered.release())

    async def _answer(self, wanted: Wish, viewer: Viewer) -> None:
        viewer.put("reply", frame("reply", await self._fulfil(wanted)))


async def _send(connection: ServerConnection, viewer: Viewer) -> None:
    with contextlib.suppress(ConnectionClosed):
        while True:
            await connection.send(await viewer.next())


def _why(error: OSError | UnicodeError) -> str:
    # asyncio says the latter by a number, or without one, as in Python 3.13
    no_address = errno.EADDRNOTAVAIL, None
    if isinstance(error, socket.gaierror | UnicodeError) or error.errno in no_address:
        return "this machine has no such address; choose one of its own with --host"
    if error.errno == errno.EADDRINUSE:
        return "the port is taken, perhaps by another gvgbot web; choose another with --port"
    if error.errno == errno.EACCES:
        return "only root may have that port; choose one from 1024 on with --port"
    return error.strerror or str(error)
