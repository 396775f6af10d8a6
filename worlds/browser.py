"""A browser for tests and pictures, Chromium, which is controlled over its DevTools pipe without a driver program."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from types import TracebackType
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
    "--disable-component-update",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
]
SECONDS = 30.0


class Browser:
    """A running browser with one page; use it in a ``with`` statement."""

    def __init__(self) -> None:
        assert CHROMIUM is not None
        self.profile = TemporaryDirectory(ignore_cleanup_errors=True)
        theirs, self.ours = os.pipe()
        self.answers, back = os.pipe()

        def wire() -> None:  # Chromium reads from descriptor 3 and writes to 4
            one, other = os.dup(theirs), os.dup(back)
            os.dup2(one, 3)
            os.dup2(other, 4)

        line = [CHROMIUM, *FLAGS, f"--user-data-dir={self.profile.name}"]
        self.process = subprocess.Popen(
            line, preexec_fn=wire, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(theirs)
        os.close(back)
        self.rest, self.number, self.session, self.faults = b"", 0, "", list[str]()
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Page.enable")
        self.call("Runtime.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.ours)
        os.close(self.answers)
        self.profile.cleanup()

    def call(self, method: str, **parameters: object) -> Any:
        """Return the browser's response to a command; errors of the page are added to `faults`."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.ours, json.dumps(message).encode() + b"\0")
        end = monotonic() + SECONDS
        while True:
            while b"\0" in self.rest:
                line, _, self.rest = self.rest.partition(b"\0")
                told = json.loads(line)
                if told.get("method") == "Runtime.exceptionThrown":
                    details = told["params"]["exceptionDetails"]
                    self.faults.append(details.get("exception", {}).get("description", details["text"]))
                if told.get("id") == self.number:
                    assert "error" not in told, told
                    return told["result"]
            ready, _, _ = select.select([self.answers], [], [], max(0.0, end - monotonic()))
            assert ready, f"the browser doesn't answer {method}"
            self.rest += os.read(self.answers, 1 << 20)

    def open(self, address: str, width: int = 1280, height: int = 900, dark: bool = False) -> None:
        """Open an address in a window of the given size, and wait until the page is loaded."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=address)
        self.wait("document.readyState === 'complete' && location.href !== 'about:blank'")

    def run(self, script: str) -> Any:
        """Return the value of a JavaScript expression in the page, or the result of a promise."""
        found = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script: str) -> Any:
        """Wait until a JavaScript expression is true, and return its value."""
        end = monotonic() + SECONDS
        while not (value := self.run(script)):
            assert monotonic() < end, f"never true: {script}"
            self.run("new Promise((done) => setTimeout(done, 40))")
        return value

    def click(self, selector: str) -> None:
        """Click the middle of an element with the mouse."""
        x, y = self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{ block: 'center' }});"
            " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def choose(self, label: str, value: str) -> None:
        """Choose a value in the selection list with a label."""
        self.run(
            f"(() => {{ const e = document.querySelector('select[aria-label={json.dumps(label)}]'); e.focus();"
            f" e.value = {json.dumps(value)}; e.dispatchEvent(new Event('change')); }})()"
        )

    def type(self, selector: str, text: str) -> None:
        """Click an element, and type text into the element."""
        self.click(selector)
        self.call("Input.insertText", text=text)

    def shot(self, path: str | Path, height: int | None = None) -> None:
        """Save a picture of the whole page, or of its top `height` pixels."""
        if height is None:
            height = int(self.run("document.documentElement.scrollHeight"))
        width = int(self.run("innerWidth"))
        clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)
        Path(path).write_bytes(base64.b64decode(shot["data"]))
