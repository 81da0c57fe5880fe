"""Commands that are started, stopped at some moment, and run again; what each leaves is compared.

Three of four are forked from a process that has imported what they need, which takes a fifth of the
time. The others are processes of their own, from the start of Python to its end.
"""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from PIL import Image
from texbake_cli import run
from texbake_cli.signals import end_cleanly_on_signals
from writing_commands import LINES, contents, make_inputs

from texbake import unfinished, write_mesh
from texbake.building.task import Task, TaskOutcome, run_task
from texbake.mesh.shapes import grid_sphere, uv_sphere

MARK = "TEXBAKE_STOPPED"  # in the environment of all processes of a command
PROCESS = [sys.executable, "-P", "-c", "from texbake_cli import run; run()"]
# Warnings, and the progress of long work.
MEASURING = {"bench", "build", "study", "watch"}  # whose reports differ by more than times
WITH_CHILDREN = {"bench", "build", "convert usd", "unwrap xatlas", "watch"}
_KNOWN_LINE = re.compile(
    r"texbake: (warning: .*|.*: \d[\d.]* (s|min)|.*: \d+ % in .* left|.* takes .*)"
)
_NUMBER = re.compile(rb"-?\d[\d.,e+-]*")


@dataclass
class Running:
    """A command that was started, in a process group of its own."""

    process: int
    folder: Path
    began: float
    code: int | None = None

    def ended(self) -> bool:
        """Whether it has ended; then `code` has its exit code, negative for a signal."""
        if self.code is None:
            found, status = os.waitpid(self.process, os.WNOHANG)
            if found:
                self.code = os.waitstatus_to_exitcode(status)
        return self.code is not None

    def wait(self, seconds: float) -> bool:
        """Wait for its end; whether it came in time."""
        until = time.monotonic() + seconds
        while not self.ended():
            if time.monotonic() > until:
                return False
            time.sleep(0.002)
        return True

    def kill(self) -> None:
        """End its whole group."""
        with suppress(ProcessLookupError):
            os.killpg(self.process, signal.SIGKILL)
        self.wait(5.0)

    def said(self) -> list[str]:
        """Return the lines on stderr but for warnings and progress."""
        text = (self.folder / "stderr").read_text(errors="replace")
        return [line for line in text.splitlines() if not _KNOWN_LINE.fullmatch(line)]

    def children(self) -> list[int]:
        """Return the processes that it has started, and theirs."""
        return _children(self.process)


def _children(process: int) -> list[int]:
    found: list[int] = []
    with suppress(OSError, ValueError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            for child in map(int, (thread / "children").read_text().split()):
                found += [child, *_children(child)]
    return found


def orphans(folder: Path) -> list[int]:
    """Return the processes of commands in a folder that still live."""
    mark = f"{MARK}={folder}".encode()
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with suppress(OSError):
                if mark in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
    return found


def start(
    folder: Path,
    words: list[str],
    *,
    forked: bool,
    before: Sequence[str] = (),
    in_process: bool = False,
) -> Running:
    """Start a command.

    Parameters
    ----------
    folder
        It has the folders `work`, to run in, and `tmp`, for temporary files.
    words
        Its name and arguments.
    forked
        From this process, which has imported most modules already.
    before
        A program that starts it, and its arguments.
    in_process
        A forked build runs its steps itself, without workers.
    """
    sys.stdout.flush()
    began = time.monotonic()
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    process = os.fork()
    if process:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        return Running(process, folder, began)
    code = 70
    try:
        _enter(folder)
        line = [*before, *PROCESS, *words]
        if forked:
            unfinished._LOOKED_THROUGH.clear()  # by the process that made the inputs
            end_cleanly_on_signals()
        if in_process:
            vars(import_module("texbake.building.build"))["local_workers"] = lambda _: _InProcess()
        if not forked:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        if not forked:
            os.execvp(line[0], line)
        sys.argv = ["texbake", *words]
        run()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 0
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(BaseException):
            if listed := os.environ.get("TEXBAKE_MODULES"):
                Path(listed).write_text(json.dumps(sorted(sys.modules)))
            sys.stderr.flush()
        os._exit(code)


class _InProcess:
    """Runs the steps of a build in its own process."""

    slots = threads = 1

    def __init__(self) -> None:
        self._tasks: list[tuple[int, Task]] = []

    def submit(self, number: int, task: Task) -> None:
        self._tasks.append((number, task))

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        done = [(number, TaskOutcome(**run_task(task.to_json()))) for number, task in self._tasks]
        self._tasks.clear()
        return done

    def close(self) -> None:
        pass


def _enter(folder: Path) -> None:
    """Become a process of its own group, in a folder, without a terminal."""
    os.setsid()
    os.chdir(folder / "work")
    for number, path in enumerate((os.devnull, str(folder / "stdout"), str(folder / "stderr"))):
        opened = os.open(
            path, os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        )
        os.dup2(opened, number)
        os.close(opened)
    os.environ.update({MARK: str(folder), "TMPDIR": str(folder / "tmp")})
    tempfile.tempdir = None


State = dict[str, bytes]


@dataclass
class Case:
    """A command in a folder of its own, and what it writes undisturbed.

    Attributes
    ----------
    name : str
    folder : Path
    words : list of str
    again : list of str
        What finishes the work; `build` for `watch`, which has no end.
    starts : dict of str to State
        Files before it: `new` without its outputs, `older` with older ones.
    ends : dict of str to State
        Files after it, by the same names.
    folders : dict of str to set
        Folders after it.
    varying : set of str
        Files with times in them.
    seconds : dict of bool to float
        How long it takes, by whether it is forked.
    has_children : bool
        Whether it starts other processes.
    """

    name: str
    folder: Path
    words: list[str]
    again: list[str]
    starts: dict[str, State] = field(default_factory=dict)
    ends: dict[str, State] = field(default_factory=dict)
    folders: dict[str, set[str]] = field(default_factory=dict)
    varying: set[str] = field(default_factory=set)
    seconds: dict[bool, float] = field(default_factory=dict)
    has_children: bool = False

    @property
    def work(self) -> Path:
        """The folder that the command runs in."""
        return self.folder / "work"

    @property
    def outputs(self) -> list[str]:
        """Files that it writes for its user."""
        inputs = self.starts["new"]
        return [name for name in self.ends["new"] if name not in inputs and not is_inside(name)]

    def reset(self, state: str) -> None:
        """Put the files before the command in place."""
        for folder in (self.work, self.folder / "tmp"):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        write(self.work, self.starts[state])

    def run(self, words: list[str] | None = None, *, in_process: bool = False) -> Running:
        """Run to the end."""
        running = start(self.folder, words or self.again, forked=True, in_process=in_process)
        if not running.wait(300.0):
            running.kill()
        return running

    def sets(self) -> list[list[str]]:
        """Return the outputs that belong together."""
        if self.words[0] not in ("build", "watch"):
            return [self.outputs]
        groups: dict[str, list[str]] = {}
        for name in self.outputs:
            if "_" in name and not name.endswith("_low.obj"):
                groups.setdefault(name.rsplit("_", 1)[0], []).append(name)
        return list(groups.values())


def is_inside(name: str) -> bool:
    """Whether a file is not for users but for the next build."""
    return ".texbake/" in name


def write(folder: Path, state: State) -> None:
    """Write files and their folders."""
    for name, content in state.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def folders_in(folder: Path) -> set[str]:
    """Return the folders below a folder."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_dir()}


def same(name: str, one: bytes, other: bytes, case: Case) -> bool:
    """Whether two contents of a file are the same, but for times; files of times must be whole."""
    if one == other:
        return True
    if name not in case.varying:
        return False
    if name.endswith(".html"):
        return one.rstrip().endswith(b"</html>")
    if name.endswith(".json") and case.words[0] in MEASURING:
        return isinstance(json.loads(one), dict)
    if name.endswith(".png"):  # a plot of times
        return all(Image.open(io.BytesIO(content)).load() for content in (one, other))
    if name.endswith(".npz"):
        return zipfile.ZipFile(io.BytesIO(one)).testzip() is None
    if name.endswith((".csv", ".md")):
        return one.endswith(b"\n")
    return _NUMBER.sub(b"0", one) == _NUMBER.sub(b"0", other)


def prepared(name: str, root: Path, *, in_process: bool = False) -> Case:
    """Make the folder of a command, and run it undisturbed."""
    *before, line = LINES[name]
    words = line.split()
    again = ["build", *words[1:]] if words[0] == "watch" else words
    case = Case(name, root / name.replace(" ", "_"), words, again)
    case.starts["new"] = {}
    case.reset("new")
    make_inputs(case.work)
    write_mesh(grid_sphere(12, 20), case.work / "high.ply")
    write_mesh(uv_sphere(8, 8), case.work / "low.obj")
    for prepare in before:
        _must(case.run(prepare.split()))
    case.starts["new"] = contents(case.work)
    modules = case.folder / "modules.json"
    os.environ["TEXBAKE_MODULES"] = str(modules)
    for state in ("new", "older"):
        running = case.run(in_process=in_process)
        _must(running)
        # The first of them imports modules, like a process of its own.
        case.seconds[state == "older"] = time.monotonic() - running.began
        case.ends[state] = contents(case.work)
        case.folders[state] = folders_in(case.work)
        if state == "new":
            del os.environ["TEXBAKE_MODULES"]
            for module in json.loads(modules.read_text()):
                with suppress(Exception):
                    import_module(module)
            case.starts["older"] = _older(case, in_process)
            case.reset("older")
    new, older = case.ends["new"], case.ends["older"]
    case.varying = {file for file in new if file in older and new[file] != older[file]}
    case.has_children = name in WITH_CHILDREN
    return case


def _older(case: Case, in_process: bool) -> State:
    """Return the files before a command that has older outputs."""
    after = contents(case.work)
    if case.again[0] != "build":
        return {**dict.fromkeys(after, b"older"), **case.starts["new"]}
    text = case.starts["new"]["pipeline.toml"]
    case.reset("new")
    (case.work / "pipeline.toml").write_bytes(text.replace(b"[24, 16]", b"[20, 12]"))
    _must(case.run(in_process=in_process))
    return {**contents(case.work), "pipeline.toml": text}


def _must(running: Running) -> None:
    if running.code or running.said():
        raise SystemExit(f"{running.folder}: {running.code}: {running.said()}")
