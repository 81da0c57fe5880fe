"""Questions about USD files, answered by a process of its own.

usd-core, Pixar's library, is written for files that one trusts: some damaged files end the process
that reads them, or keep it busy without an end. So a child process reads them, with limits of time
and memory, and whatever happens to it becomes an error of one line.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from typing import IO, Any

from texbake import errors
from texbake.errors import FileFormatError, TexbakeError, warn_of
from texbake.files import PathLike, require_file
from texbake.mesh.files.answers import AnswerError, Classes, receive
from texbake.parallel import module_path

_CHILD = "texbake.mesh.files.usd_child"
# One thread reads as fast as several here, and its memory can be limited.
_ONE_THREAD = {
    "PXR_WORK_THREAD_LIMIT": "1", "OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "1",
}  # fmt: skip
# The system, when it is short of memory, or a person ends a process so; the file is not at fault.
_SENT_BY_OTHERS = {-getattr(signal, name, signal.SIGTERM) for name in ("SIGKILL", "SIGTERM")}
_LOST = ("lost", None)


def ask_usd(path: PathLike, question: str, classes: Classes) -> Any:
    """Return what a USD file says to a question, and pass on the warnings of its reader."""
    require_file(path)
    asked: tuple[str, Any] | None = _asked(path, question, classes)
    kind, answer = asked or _asked(path, question, classes) or _LOST
    if (kind, answer) == _LOST:
        raise FileFormatError(f"{path}: the process that reads it was ended twice; read it again")
    if kind == "bug":
        raise RuntimeError(f"{path}: {answer}")
    if kind != "answer":
        raise _error(kind, answer)
    found, heard = answer or (None, ())
    for line in heard:
        warn_of(path, str(line).removeprefix(f"{os.fspath(path)}: "))
    return found


def _asked(path: PathLike, question: str, classes: Classes) -> tuple[str, Any] | None:
    """Return the kind of an answer and the answer; None if somebody ended the process."""
    with subprocess.Popen(
        # -P: files in the current folder are not imported as modules.
        [sys.executable, "-P", "-m", _CHILD, question, os.fspath(path), str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **_ONE_THREAD, "PYTHONPATH": module_path()},
    ) as child:
        assert child.stdout is not None
        try:
            return _answer(child.stdout, classes)
        except AnswerError:
            if child.wait() in _SENT_BY_OTHERS:
                return None
            raise FileFormatError(f"{path}: {_ending(child)}") from None
        finally:
            # The child answers or it is not needed; a signal that ends this process comes here too.
            child.kill()


def _answer(file: IO[bytes], classes: Classes) -> tuple[str, Any]:
    """Return the kind of an answer and the answer."""
    answer = receive(file, classes)
    if not isinstance(answer, tuple) or len(answer) != 2 or not isinstance(answer[0], str):
        raise AnswerError("it is not an answer")
    return answer


def _error(kind: str, message: Any) -> TexbakeError:
    """Return the error of a name."""
    found = getattr(errors, kind, None)
    if isinstance(found, type) and issubclass(found, TexbakeError):
        return found(str(message))
    return FileFormatError(str(message))


def _ending(child: subprocess.Popen[bytes]) -> str:
    """Return why a child gave no answer."""
    code = child.wait()
    if code in (-getattr(signal, "SIGXCPU", 0), -getattr(signal, "SIGALRM", 0)) and code:
        return (
            "reading it takes longer than a file of its size may; export it again, or, if you "
            "trust it, read it with texbake --allow-outside"
        )
    how = f"exit code {code}"
    with suppress(ValueError):
        how = signal.Signals(-code).name
    return f"the library that reads it stopped ({how}); the file is damaged; export it again"
