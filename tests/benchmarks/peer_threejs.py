"""three.js in Chromium without a window, on SwiftShader, which rasterizes on the processor.

    python peer_threejs.py JOB.npz|JOB.json ... -o FOLDER

See `peer_job` for jobs of arrays, whose light is Lambert's where they have any. One of JSON names a
`file` (.glb), `width`, `height`, `clip_from_camera` and `world_from_camera` (rows one after
another), and `to_light` with its `light`, the color that a white surface that faces it reflects; or
`lights`, as `peer_scenes` has them, and `center` and `radius` of what casts shadows. Needs
Chromium, and npm's `three` in a folder that NODE_PATH or TEXBAKE_NODE_MODULES names, or in a
node_modules folder above this one. Mip levels are SwiftShader's own.

A server on this machine alone hands the page `peer_threejs.html` its jobs and takes the pictures.
"""

from __future__ import annotations

import base64
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
from peer_job import UnavailableError, draw_files, read_job

HERE = Path(__file__).parent
PAGE = HERE / "peer_threejs.html"
# Nothing is loaded from elsewhere; the first picture takes Chromium about two seconds.
TIMEOUT = 120.0  # seconds a picture
FLAGS = [
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--disable-background-networking",
    "--disable-component-update", "--no-first-run",
]  # fmt: skip
TYPES = {".js": "text/javascript", ".html": "text/html; charset=utf-8"}


def find_chromium():
    """Path of Chromium or Chrome."""
    for name in "chromium", "chromium-browser", "google-chrome":
        if path := shutil.which(name):
            return path
    raise UnavailableError("Chromium is not installed")


def find_threejs():
    """Folder of three.js."""
    named = [os.environ.get(name, "") for name in ("NODE_PATH", "TEXBAKE_NODE_MODULES")]
    folders = [Path(part) for value in named for part in value.split(os.pathsep) if part]
    folders += [parent / "node_modules" for parent in HERE.parents]
    for folder in folders:
        if (folder / "three" / "build" / "three.module.js").is_file():
            return folder / "three"
    raise UnavailableError(
        "npm's three is not found; name its node_modules in TEXBAKE_NODE_MODULES"
    )


def _base64(values, dtype):
    return base64.b64encode(np.ascontiguousarray(values, dtype)).decode("ascii")


def _image(image):
    if image is None:
        return None
    assert image.dtype == np.uint8, "the page takes 8-bit images"
    height, width = image.shape[:2]
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :3] = image[::-1]
    return {"width": width, "height": height, "rgba": _base64(rgba, np.uint8)}


def job_of(path):
    """A job as the page takes it; matrices go along their rows."""
    if path.suffix == ".json":
        return json.loads(path.read_text())
    job = read_job(path)
    columns = {"position": job.positions, "normal": job.normals}
    columns |= {"uv": job.uvs, "tangent": job.tangents}
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = job.axes.T
    world_from_camera[:3, 3] = job.eye
    names = "base_color", "to_light", "light", "ambient"
    return {
        "width": job.width,
        "height": job.height,
        "shading": job.shading,
        "filter": job.filter,
        **{name: [float(value) for value in getattr(job, name)] for name in names},
        "world_from_camera": world_from_camera.ravel().tolist(),
        "clip_from_camera": (job.opengl_from_world @ world_from_camera).ravel().tolist(),
        "faces": _base64(job.faces, np.uint32),
        "attributes": {
            name: [column.shape[1], _base64(column, np.float32)]
            for name, column in columns.items()
            if column is not None
        },
        "base_map": _image(job.base_map),
        "normal_map": _image(job.normal_map),
    }


class Desk(ThreadingHTTPServer):
    """Hands out jobs and takes pictures: `answers` gets (place, bytes), or (None, why not)."""

    def __init__(self, jobs, modules):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.jobs = jobs
        self.modules = modules
        self.answers: queue.Queue[tuple[int | None, bytes]] = queue.Queue()

    def content(self, path):
        """Type and bytes of what stands at a path; None where there is nothing."""
        if path == "/jobs":
            start = {"n_jobs": len(self.jobs), "plain": self.jobs[0].get("plain", False)}
            return "application/json", json.dumps(start).encode()
        if path.startswith("/jobs/"):
            return "application/json", json.dumps(self.jobs[int(path.split("/")[2])]).encode()
        if path.startswith("/files/"):
            job = self.jobs[int(path.split("/")[2])]
            return "model/gltf-binary", Path(job["file"]).read_bytes()
        file = PAGE if path == "/" else self.modules / path.removeprefix("/three/")
        if not file.is_file():
            return None
        return TYPES.get(file.suffix, "application/octet-stream"), file.read_bytes()


class _Handler(BaseHTTPRequestHandler):
    server: Desk

    def do_GET(self):
        found = self.server.content(self.path)
        self._answer(200 if found else 404, *(found or ("text/plain", b"")))

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        place = self.path.rpartition("/")[2]
        self.server.answers.put((int(place) if place.isdigit() else None, body))
        self._answer(200, "text/plain", b"")

    def _answer(self, code, kind, content):
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_):
        """Say nothing."""


def draw_all(paths):
    """Draw jobs one after another, in one page."""
    from texbake.texture.encoding import decode_srgb

    chromium = find_chromium()
    jobs = [job_of(path) for path in paths]
    desk = Desk(jobs, find_threejs())
    threading.Thread(target=desk.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        address = f"http://127.0.0.1:{desk.server_port}/"
        command = [chromium, *FLAGS, f"--user-data-dir={profile}", address]
        browser = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        try:
            for job in jobs:
                place, body = desk.answers.get(timeout=TIMEOUT)
                if place is None:
                    raise RuntimeError(f"the page failed: {body.decode()}")
                codes = np.frombuffer(body, np.uint8).reshape(job["height"], job["width"], 4)[::-1]
                picture = np.empty(codes.shape, np.float32)
                picture[..., :3] = decode_srgb(codes[..., :3] / 255.0)
                picture[..., 3] = codes[..., 3] / 255.0
                yield picture
        finally:
            # Chromium starts through a shell script, and its helpers belong to the same group.
            os.killpg(browser.pid, signal.SIGTERM)
            browser.wait()
            desk.shutdown()
            desk.server_close()


if __name__ == "__main__":
    sys.exit(draw_files(__doc__, draw_all))
