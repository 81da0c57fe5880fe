"""glTF files as three.js shows them, in Chromium without a window.

    python peer_gltf_threejs.py JOB.json ... -o FOLDER

A job names a `file` (.glb), `width`, `height`, `clip_from_camera` and `world_from_camera` (rows one
after another), and `to_light` with its `light`, the color that a white surface that faces it
reflects; or `lights`, as `peer_scenes` has them, and `center` and `radius` of what casts
shadows. Each becomes FOLDER/JOB.npy: (H, W, 4) float32, linear, row 0 at the top. Exits with 3, and
says why, where three.js or Chromium is missing; see `peer_threejs` for how they are found.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
from peer_job import UnavailableError
from peer_threejs import FLAGS, TIMEOUT, TYPES, find_chromium, find_threejs

UNAVAILABLE = 3
PAGE = Path(__file__).with_name("peer_gltf_threejs.html")


class Desk(ThreadingHTTPServer):
    """Serves the page, three.js, the files and the jobs; `answers` gets (place, bytes)."""

    def __init__(self, jobs: list[dict], three: Path) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.jobs, self.three = jobs, three
        self.answers: queue.Queue[tuple[int | None, bytes]] = queue.Queue()

    def content(self, path: str) -> tuple[str, bytes] | None:
        """Type and bytes of what stands at a path; None where there is nothing."""
        if path == "/jobs":
            return "application/json", json.dumps(self.jobs).encode()
        if path.startswith("/files/"):
            job = self.jobs[int(path.split("/")[2])]
            return "model/gltf-binary", Path(job["file"]).read_bytes()
        file = PAGE if path == "/" else self.three / path.removeprefix("/three/")
        if not file.is_file():
            return None
        return TYPES.get(file.suffix, "application/octet-stream"), file.read_bytes()


class Handler(BaseHTTPRequestHandler):
    server: Desk

    def do_GET(self) -> None:
        found = self.server.content(self.path)
        self.send_response(200 if found else 404)
        kind, content = found or ("text/plain", b"")
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        place = self.path.rpartition("/")[2]
        self.server.answers.put((int(place) if place.isdigit() else None, body))
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def draw(jobs: list[dict]) -> list[np.ndarray]:
    """Pictures of all jobs, in one page."""
    from texbake.texture.encoding import decode_srgb

    desk = Desk(jobs, find_threejs().parent)
    chromium = find_chromium()
    threading.Thread(target=desk.serve_forever, daemon=True).start()
    pictures = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = subprocess.Popen(
            [chromium, *FLAGS, f"--user-data-dir={profile}",
             f"http://127.0.0.1:{desk.server_port}/"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        try:
            for job in jobs:
                place, body = desk.answers.get(timeout=TIMEOUT)
                if place is None:
                    raise RuntimeError(f"the page failed: {body.decode()}")
                codes = np.frombuffer(body, np.uint8).reshape(job["height"], job["width"], 4)[::-1]
                color = decode_srgb(codes[..., :3] / 255.0)
                alpha = codes[..., 3:] / 255.0
                pictures.append(np.concatenate([color, alpha], axis=2).astype(np.float32))
        finally:
            # Chromium starts through a shell script, and its helpers belong to the same group.
            os.killpg(browser.pid, signal.SIGTERM)
            browser.wait()
            desk.shutdown()
            desk.server_close()
    return pictures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("jobs", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    try:
        pictures = draw([json.loads(job.read_text()) for job in arguments.jobs])
    except UnavailableError as error:
        print(error, file=sys.stderr)
        return UNAVAILABLE
    for job, picture in zip(arguments.jobs, pictures, strict=True):
        np.save(arguments.output / f"{job.stem}.npy", picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
