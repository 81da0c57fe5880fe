"""Mutations of valid files through every reader, in a child process with bounded time and memory.

    python tests/hard_cases/fuzz_files.py [FORMAT ...] [--bytes 1000000] [--files 0] [--minutes 0]
        [--seed 0] [--skip FORMAT]

Each mutant must be read, or refused with a TexbakeError of one line, within `SECONDS` and `MEMORY`.
A mutant that ends the child is a fault as well, and a new child goes on with the next one. Files at
fault are kept in the folder given. Prints a line of JSON for each format, with its result.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_formats import FORMATS, Reader
from mutants import mutant, zip_mutant

from texbake.errors import ReadWarning

SECONDS = 5  # for one file of a few kilobytes, on a machine that does other things as well
USD_SECONDS = 15  # the process that reads a USD file may take 10 s before it is ended
MEMORY = 2 << 30  # bytes of address space beyond those of the process with all readers loaded
MAX_FAULTS = 5
STATE = "state.json"


class HangError(BaseException):
    """A file took longer than `SECONDS`; no reader that catches any `Exception` may hide it."""


def fault_of(read: Reader, path: Path) -> str | None:
    """Read one file, however long it takes; return what went wrong, or None."""
    from texbake import TexbakeError

    try:
        read(path)
    except TexbakeError as error:
        if "\n" in str(error):
            return f"several lines: {error!r}"
    except BaseException as error:  # any other exception is a fault
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = f"{frame.tb_frame.f_code.co_filename}:{frame.tb_lineno}" if frame else "?"
        return f"{type(error).__name__}: {str(error)[:200]} at {where}"
    return None


def _fault(read: Reader, path: Path) -> str | None:
    """Read one file in the time allowed; return what went wrong, or None."""
    start = time.monotonic()
    allowed = USD_SECONDS if path.suffix.startswith(".usd") else SECONDS
    signal.alarm(allowed)
    try:
        fault = fault_of(read, path)
    except HangError:  # between the reader and the end of the alarm
        fault = None
    finally:
        signal.alarm(0)
    # A library that catches everything may have swallowed the alarm.
    taken = time.monotonic() - start
    return fault or (f"took {taken:.1f} s" if taken > allowed else None)


def _hang(*_: object) -> None:
    raise HangError


def fuzz(name: str, options: argparse.Namespace, home: Path, state: dict[str, Any]) -> None:
    """Read mutants of a format, after those that the state counts, until enough are read.

    The state is kept in the folder before each mutant, so that another process can go on.
    """
    suffix, make, read = FORMATS[name]
    folder = home / name.replace(" ", "_")
    folder.mkdir(exist_ok=True)
    path = folder / f"seed{suffix}"
    make(path)
    content = path.read_bytes()
    read(path)  # loads all that is needed, and shows that the seed is valid
    bound_memory(MEMORY)
    candidate = folder / f"mutant{suffix}"
    faults = state["faults"]
    end = time.monotonic() + 60.0 * options.minutes
    while (
        state["bytes"] < options.bytes or state["files"] < options.files or time.monotonic() < end
    ) and len(faults) < MAX_FAULTS:
        rng = np.random.default_rng([options.seed, state["files"], *name.encode()])
        # Checksums keep most damage from the readers of the files in an archive.
        inside = content.startswith(b"PK") and rng.random() < 0.5
        data = zip_mutant(content, rng) if inside else mutant(content, rng)
        candidate.write_bytes(data)
        state["files"] += 1
        state["bytes"] += len(data)
        (home / STATE).write_text(json.dumps(state))
        _bound_time()
        fault = _fault(read, candidate)
        if fault is not None:
            keep_fault(candidate, f"mutant {state['files'] - 1}: {fault}", faults)


def keep_fault(candidate: Path, fault: str, faults: list[str]) -> None:
    """Put a file at fault aside and list what is wrong with it."""
    faults.append(fault)
    shutil.copy(candidate, candidate.with_stem(f"fault{len(faults)}"))


def _bound_time() -> None:
    """End this process if it goes on in compiled code, which Python does not interrupt."""
    limit = int(time.process_time()) + 2 * SECONDS + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))


def bound_memory(more: int) -> None:
    """Bound the address space by what is there now, the readers loaded, and so many bytes more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))


def work(options: argparse.Namespace, home: Path) -> None:
    """Fuzz formats one after the other, going on from the state in the folder; in the child."""
    faulthandler.enable()
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ReadWarning)
    signal.signal(signal.SIGALRM, _hang)
    left = json.loads((home / STATE).read_text())
    for name in options.format:
        state = left if left.get("format") == name else new_state(name)
        fuzz(name, options, home, state)
        print(json.dumps(state), flush=True)


def new_state(name: str) -> dict[str, Any]:
    return {"format": name, "files": 0, "bytes": 0, "faults": []}


def run(options: argparse.Namespace, home: Path) -> int:
    """Let children fuzz all formats, a new one after each that a mutant ends; count the faults."""
    home.mkdir(parents=True, exist_ok=True)
    (home / STATE).write_text("{}")
    n_faults = 0
    while options.format:
        command = [sys.executable, *sys.argv, "--child", "--folder", str(home)]
        command += ["--format", *options.format]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, errors="replace"
        ) as child:
            assert child.stdout is not None
            for line in child.stdout:
                if line.startswith('{"format"'):  # libraries print other text beside it
                    print(line, end="", flush=True)
                    n_faults += len(json.loads(line)["faults"])
                    options.format = options.format[1:]
        if child.returncode == 0:
            continue
        state = json.loads((home / STATE).read_text())
        if not options.format or state.get("format") != options.format[0]:
            raise RuntimeError(f"the child ended with {child.returncode} before any mutant")
        name = options.format[0]
        candidate = home / name.replace(" ", "_") / f"mutant{FORMATS[name][0]}"
        line = f"mutant {state['files'] - 1}: it ended the process with {child.returncode}"
        keep_fault(candidate, line, state["faults"])
        (home / STATE).write_text(json.dumps(state))
    return n_faults


def main() -> int:
    """Parse the command line and print what was found; return 1 if that is any fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", help=", ".join(FORMATS))
    parser.add_argument("--bytes", type=int)
    parser.add_argument("--files", type=int)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--skip", action="append", default=[], help="a format to leave out")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--format", nargs="*", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bytes is None:
        options.bytes = 0 if options.files else 1_000_000
    options.files = options.files or 0
    home = options.folder or Path(tempfile.mkdtemp())
    if options.child:
        work(options, home)
        return 0
    options.format = [name for name in options.formats or FORMATS if name not in options.skip]
    return 1 if run(options, home) else 0


if __name__ == "__main__":
    sys.exit(main())
