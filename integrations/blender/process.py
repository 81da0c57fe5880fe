# SPDX-License-Identifier: GPL-3.0-or-later
"""The separate process that does the work: started, watched, and ended with Blender."""

import importlib.util
import json
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

WORKER = Path(__file__).with_name("worker.py")
_WAIT = 5.0  # seconds that a process has to end after it is asked to
_MOST_LINES = 20  # of what a process printed before it failed

RUNNING: set["Work"] = set()


class WorkError(Exception):
    """One line for the user."""


def folder_of(package: str) -> str | None:
    """Return the folder that a package is imported from; None if it is not installed."""
    found = importlib.util.find_spec(package)
    return None if found is None or found.origin is None else str(Path(found.origin).parents[1])


def command_for(folder: Path) -> list[str]:
    """Return the command that starts the worker on the files in a folder."""
    if Path(sys.executable).name.lower().startswith("python"):
        return [sys.executable, "-I", str(WORKER), str(folder)]
    # A Blender without a Python program of its own.
    options = ["--background", "--factory-startup", "--python", str(WORKER)]
    return [bpy.app.binary_path, *options, "--", str(folder)]


class Work:
    """A task that runs in a process of its own."""

    def __init__(
        self,
        task: str,
        options: dict[str, Any],
        prepare: Callable[[Path], None] | None = None,
        **meshes: Sequence[dict[str, Any]],
    ) -> None:
        """Start a task on lists of the arrays of objects, by their roles.

        `prepare` is called with the folder of the task before it starts.
        """
        paths = {name: folder_of(name) for name in ("texbake", "numpy")}
        # Where Blender has OpenImageIO, which decodes JPEG images.
        python = bpy.utils.system_resource("PYTHON")
        if paths["texbake"] is None:
            raise WorkError(
                "the package texbake is missing: install the zip file of the extension for this "
                "platform"
            )
        try:
            self.folder = Path(tempfile.mkdtemp(prefix="texbake-"))
        except OSError as error:
            raise WorkError(f"texbake could not start: {error}") from error
        self.stage, self.fraction = "start", None
        self.warnings, self.done, self._error, self._printed = [], None, None, []
        counts = {}
        try:
            if prepare is not None:
                prepare(self.folder)
            for role, given in meshes.items():
                counts[role] = len(given)
                for number, arrays in enumerate(given):
                    np.savez(self.folder / f"{role}{number}.npz", **arrays)
            found = [*paths.values(), *map(str, Path(python).rglob("site-packages"))]
            job = {"task": task, "options": options, "meshes": counts, "paths": found}
            (self.folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
            self.process = subprocess.Popen(
                command_for(self.folder),
                stdin=subprocess.PIPE,  # the worker ends when this closes, as it does with Blender
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                encoding="utf-8",
                errors="replace",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except Exception as error:
            shutil.rmtree(self.folder, ignore_errors=True)
            if isinstance(error, OSError | RuntimeError):
                raise WorkError(f"texbake could not start: {error}") from error
            raise
        RUNNING.add(self)
        self._lines = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def poll(self, *, wait: bool = False) -> bool:
        """Read what the process has printed; return whether it has ended.

        Raises
        ------
        WorkError
            It failed.
        """
        while True:
            try:
                line = self._lines.get(block=wait)
            except queue.Empty:
                return False
            if line is None:
                break
            self._told(line)
        self.process.wait()
        RUNNING.discard(self)
        if self._error is None and self.done is None:
            last = next((line for line in reversed(self._printed) if line.strip()), "no message")
            print(*self._printed, sep="\n", file=sys.stderr)
            self._error = f"texbake stopped (code {self.process.returncode}): {last.strip()}"
        if self._error is not None:
            raise WorkError(self._error)
        return True

    def _told(self, line: str) -> None:
        try:
            told = json.loads(line)
        except ValueError:
            told = None
        if not isinstance(told, dict):
            self._printed = [*self._printed[1 - _MOST_LINES :], line.rstrip()]
            return
        self.stage = told.get("stage", self.stage)
        self.fraction = told.get("fraction") if "stage" in told else self.fraction
        self.done = told.get("done", self.done)
        self._error = told.get("error", self._error)
        self.warnings += told.get("warnings", [])

    def result(self, name: str) -> dict[str, Any]:
        """Return arrays that the process has written."""
        with np.load(self.folder / f"{name}.npz", allow_pickle=False) as arrays:
            return dict(arrays)

    def close(self) -> None:
        """End the process if it still runs, and remove its files."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(_WAIT)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.process.stdin.close()
        RUNNING.discard(self)
        shutil.rmtree(self.folder, ignore_errors=True)


def close_all() -> None:
    """End all processes, because Blender closes or the extension is disabled."""
    for work in tuple(RUNNING):
        work.close()
