"""Headless Chromium, driven through a pipe; tests that need it are skipped where it is absent."""

import base64
import io
import itertools
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time

import numpy as np
import pytest
from PIL import Image

from texbake import BakeOptions, bake
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.pages.asset_page import write_bake_page

TIMEOUT = 60.0  # seconds for any answer; the first picture on SwiftShader takes about two
FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--disable-background-networking",
    "--disable-component-update", "--no-first-run", "--remote-debugging-pipe",
    "--hide-scrollbars", "--force-device-scale-factor=1",
)  # fmt: skip


class Browser:
    """The DevTools protocol over file descriptors 3 and 4: JSON, each message ended by a 0."""

    def __init__(self, program, profile):
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()

        def hand_over():
            # Not below 5, so that neither is overwritten before it is copied.
            fds = [os.dup(fd) for fd in (to_browser, from_browser, to_browser, from_browser)][2:]
            os.dup2(fds[0], 3)
            os.dup2(fds[1], 4)

        self.process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            close_fds=False, preexec_fn=hand_over,
        )  # fmt: skip
        os.close(to_browser)
        os.close(from_browser)
        self._ids = itertools.count(1)
        self._messages = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self._events = []
        found = self.call("Target.getTargets")["targetInfos"]
        target = next(item["targetId"] for item in found if item["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in "Page", "Runtime", "Network", "Log":
            self.call(f"{domain}.enable")
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    _session = None

    def _read(self):
        left = b""
        while data := os.read(self._in, 1 << 16):
            *whole, left = (left + data).split(b"\0")
            for message in whole:
                self._messages.put(json.loads(message))

    def call(self, method, **params):
        """Send a command and return its answer; events that come before are kept."""
        number = next(self._ids)
        message = {"id": number, "method": method, "params": params}
        if self._session and not method.startswith(("Target.", "Browser.")):
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        while True:
            answer = self._messages.get(timeout=TIMEOUT)
            if answer.get("id") == number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self._events.append(answer)

    def value(self, expression):
        """Value of an expression in the page, awaited if it is a promise."""
        found = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, condition):
        end = time.monotonic() + TIMEOUT
        while not self.value(condition):
            assert time.monotonic() < end, f"{condition} did not become true"
            time.sleep(0.02)

    def open(self, path, *, width=900, height=700, dark=False):
        """Open a file in a window of a size, and forget what was logged before."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height,
            deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url="about:blank")
        self.value("0")
        self._events.clear()
        self.call("Page.navigate", url=path.as_uri())
        self.wait("document.readyState === 'complete' && location.protocol === 'file:'")

    def settle(self):
        self.value(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"
        )

    def picture(self, selector=None):
        """(H, W, 3) uint8: the page, or one element of it, as the screen would show it."""
        self.settle()
        clip = {}
        if selector is not None:
            box = self.value(
                f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
                "return [b.x + scrollX, b.y + scrollY, b.width, b.height]; })()"
            )
            clip = {"clip": dict(zip(("x", "y", "width", "height"), box, strict=True), scale=1)}
        found = self.call("Page.captureScreenshot", captureBeyondViewport=True, **clip)
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(found["data"]))).convert("RGB"))

    def set(self, selector, value):
        self.value(
            f"(() => {{ const c = document.querySelector({selector!r});"
            f"if (c.type === 'checkbox' || c.type === 'radio') c.checked = {json.dumps(value)};"
            f"else c.value = {json.dumps(value)};"
            "c.dispatchEvent(new Event('input', { bubbles: true })); })()"
        )

    def picture_with(self, selector, law):
        """The picture of an element as soon as a law holds for it: a frame may come late."""
        end = time.monotonic() + TIMEOUT
        while not law(shown := self.picture(selector)):
            assert time.monotonic() < end, f"{selector} does not show it"
        return shown

    def press(self, key, **more):
        for kind in "keyDown", "keyUp":
            self.call("Input.dispatchKeyEvent", type=kind, key=key, **more)

    def complaints(self):
        """What the page logged, what failed in it, and what it wanted from elsewhere."""
        self.settle()
        found = []
        for event in self._events:
            method, params = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                found.append(params["exceptionDetails"])
            elif method == "Runtime.consoleAPICalled":
                found.append([item.get("value") for item in params["args"]])
            elif method == "Log.entryAdded":
                found.append(params["entry"]["text"])
            elif method == "Network.requestWillBeSent":
                url = params["request"]["url"]
                if (
                    not url.startswith(("data:", "blob:", "about:"))
                    and params["type"] != "Document"
                ):
                    found.append(url)
        return found

    def close(self):
        """End Chromium, which starts through a shell script, with its helpers."""
        os.killpg(self.process.pid, signal.SIGTERM)
        self.process.wait()
        os.close(self._out)


@pytest.fixture(scope="session")
def browser():
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next(filter(None, map(shutil.which, names)), None)
    if program is None:
        pytest.skip("Chromium is not installed")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        found = Browser(program, profile)
        yield found
        found.close()


@pytest.fixture(scope="session")
def pair():
    """A rough sphere, and a smooth one with texture coordinates."""

    def radius_at(theta, phi):
        return 1.0 + 0.02 * np.sin(8 * theta) * np.sin(8 * phi)

    high = grid_sphere(58, 100, radius_at).replace(name="high.ply")
    return high, uv_sphere(12, 12).replace(name="low.obj")


@pytest.fixture(scope="session")
def baked(pair):
    """Of the pair, with rays so short that some of them miss."""
    return bake(*pair, BakeOptions(maps=("normal", "displacement"), size=96, front=0.05, back=0.03))


@pytest.fixture(scope="session")
def page(pair, baked, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "asset.html"
    assert baked.missed.any()
    write_bake_page(path, *pair, baked, asked=("normal",), command="texbake bake 'a b' c")
    return path
