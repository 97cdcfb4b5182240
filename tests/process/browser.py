"""A headless Chromium, driven over its DevTools protocol."""

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from threading import Event as Flag
from typing import Any
from urllib.request import urlopen

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from websockets.sync.client import ClientConnection, connect

PATIENCE = 40.0  # s, for a busy machine
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--remote-debugging-port=0",
)


def chromium() -> str | None:
    """The program, if this machine has it."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Page:
    """One tab."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket, self._number = socket, 0
        self.complaints: list[str] = []  # exceptions and errors of the page
        self.do("Runtime.enable")
        self.do("Log.enable")
        self.do("Page.enable")

    def do(self, method: str, **parameters: object) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=PATIENCE))
            if message.get("id") == self._number:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.complaints.append(str(message["params"]["exceptionDetails"]))
            case "Log.entryAdded" if message["params"]["entry"]["level"] == "error":
                self.complaints.append(message["params"]["entry"]["text"])

    def look(self, expression: str) -> Any:
        """The value of an expression of JavaScript."""
        done = self.do(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def until(self, expression: str, *, patience_s: float = PATIENCE) -> Any:
        """The value of an expression as soon as it is true."""
        end = time.perf_counter() + patience_s
        while not (value := self.look(expression)):
            assert time.perf_counter() < end, (expression, self.text(), self.complaints)
            Flag().wait(0.05)
        return value

    def text(self) -> str:
        """What there is to read."""
        return str(self.look("document.body.innerText"))

    def open(self, address: str, width: int, height: int, *, phone: bool, dark: bool) -> None:
        self.do(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if phone else 1,
            mobile=phone,
        )
        self.do("Emulation.setTouchEmulationEnabled", enabled=phone)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.do("Emulation.setEmulatedMedia", features=[scheme])
        for url in ("about:blank", address):
            self.complaints.clear()
            self.do("Page.navigate", url=url)
            self.until(f"location.href === {json.dumps(url)} && document.readyState === 'complete'")

    def middle(self, selector: str) -> tuple[float, float]:
        """The middle of an element, in pixels of the window."""
        x, y = self.look(
            f"(() => {{ const r = document.querySelector({json.dumps(selector)})"
            ".getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2] })()"
        )
        return x, y

    def mouse(self, kind: str, x: float, y: float, **more: object) -> None:
        self.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, selector: str) -> None:
        x, y = self.middle(selector)
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, button="left", clickCount=1)

    def touch(self, kind: str, *fingers: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(fingers)]
        self.do("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def png(self) -> bytes:
        """A picture of the window."""
        return base64.b64decode(self.do("Page.captureScreenshot", format="png")["data"])

    def pixels(self) -> NDArray[np.uint8]:
        """The same (rows, columns, 3)."""
        return np.asarray(Image.open(BytesIO(self.png())).convert("RGB"))


@contextmanager
def browser(program: str, folder: Path) -> Iterator[Page]:
    """A browser with one tab; `folder` is for its own files."""
    command = [program, *_FLAGS, f"--user-data-dir={folder}", "about:blank"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            with connect(_tab(folder, process), max_size=None) as socket:
                yield Page(socket)
        finally:
            process.kill()


def _tab(folder: Path, process: "subprocess.Popen[bytes]") -> str:
    """The address of the debugger of the one tab."""
    end = time.perf_counter() + PATIENCE
    told = folder / "DevToolsActivePort"
    while not (told.exists() and "\n" in told.read_text()):
        assert process.poll() is None, "the browser has ended"
        assert time.perf_counter() < end, "the browser does not start"
        Flag().wait(0.05)
    port = int(told.read_text().split()[0])
    with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
        tabs = json.load(answer)
    return str(next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page"))
