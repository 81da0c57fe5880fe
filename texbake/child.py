"""Child processes that answer requests one after another, and are replaced when they end.

A compiled library may crash or never return on a hostile file. Each process answers many requests,
because starting one costs more than most answers.

A child is a module that calls `serve`. A request or an answer is a value as `messages` packs it,
after its length: eight bytes, little-endian.
"""

from __future__ import annotations

import ctypes
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from texbake.files import new_scratch_folder
from texbake.messages import Classes, MessageError, pack, unpack
from texbake.parallel import module_path

_MOST_ATTEMPTS = 2
_PATIENCE = 2.0  # seconds for a process to end by itself
_LAST_WORDS = 1 << 16  # bytes at the end of the output, in which the last line is looked for
_PARENT_DEATH = 1  # PR_SET_PDEATHSIG of Linux
_GIB = 1 << 30
# A reader that waits takes no computing time; by the clock, it may take this many times as long.
_WAITING = 6

_SENT_BY_OTHERS = {
    -getattr(signal, name)
    for name in ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP")
    if hasattr(signal, name)
}


class ChildError(Exception):
    """A child gave no answer."""

    def __init__(
        self, reason: str, code: int | None = None, said: str = "", *, timed_out: bool = False
    ) -> None:
        # The reason is such as "crashed (SIGSEGV)"; the code is None if the child was ended here.
        super().__init__(reason, code, said)
        self.reason, self.code, self.said, self.timed_out = reason, code, said, timed_out

    @property
    def is_from_others(self) -> bool:
        """Whether something other than the request ended the process, such as the system."""
        return self.code in _SENT_BY_OTHERS and not self.timed_out

    @property
    def how(self) -> str:
        """The signal or the exit code with which it ended."""
        with suppress(ValueError):
            return signal.Signals(-(self.code or 0)).name
        return f"exit code {self.code}"


class Child:
    """A process that answers requests of one thread, and another one once it has ended."""

    def __init__(
        self, module: str, *, threads: int = 1, environment: Mapping[str, str] | None = None
    ) -> None:
        self.attempts = 0  # of the last request
        self._module = module
        names = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
        self._environment = {**dict.fromkeys(names, str(threads)), **(environment or {})}
        self._process: _Process | None = None
        self._is_closed = False
        self._lock = threading.Lock()

    @property
    def id(self) -> int | None:
        """Id of the process; None if none runs."""
        process = self._process
        return None if process is None else process.popen.pid

    def ask(
        self, request: Any, *, classes: Classes | None = None, timeout: float | None = None
    ) -> Any:
        """Return the answer, asking twice if others ended the process; else raise `ChildError`."""
        for self.attempts in range(1, _MOST_ATTEMPTS + 1):
            process = self._started()
            try:
                return process.ask(request, classes or {}, timeout)
            except BaseException as error:  # after an interrupt, too, nobody waits for the answer
                self.end()
                if not isinstance(error, ChildError) or not error.is_from_others:
                    raise
                if self._is_closed or self.attempts == _MOST_ATTEMPTS:
                    raise
        raise AssertionError

    def end(self) -> None:
        """End the process and remove its temporary files."""
        process, self._process = self._process, None
        if process is not None:
            process.end()

    def close(self) -> None:
        """End the process, busy or not, and let no other start."""
        with self._lock:
            self._is_closed = True
            process = self._process  # `end` may take it away meanwhile
            if process is not None:
                process.popen.kill()

    def _started(self) -> _Process:
        with self._lock:
            if self._is_closed:
                raise ChildError("was closed")
            if self._process is None:
                self._process = _Process(self._module, self._environment)
            return self._process


class _Process:
    """One process of a child."""

    def __init__(self, module: str, environment: Mapping[str, str]) -> None:
        # A process that is killed cannot remove its temporary files itself.
        self._scratch = new_scratch_folder()
        # The last output of libraries is the only hint on why a process died.
        self._said: IO[bytes] = tempfile.TemporaryFile(dir=self._scratch)  # noqa: SIM115
        self._timed_out = False
        try:
            self.popen = subprocess.Popen(
                # -P: files in the current folder are not imported as modules.
                [sys.executable, "-P", "-m", module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                env={
                    **os.environ,
                    **environment,
                    "PYTHONPATH": module_path(),
                    "TMPDIR": str(self._scratch),
                },
            )
        except BaseException:  # an interrupt, too
            self._release()
            raise

    def ask(self, request: Any, classes: Classes, timeout: float | None) -> Any:
        """Send a request and read its answer."""
        assert self.popen.stdin is not None and self.popen.stdout is not None
        timer = None if timeout is None else threading.Timer(timeout, self._expire)
        if timer is not None:
            timer.start()
        answer = None
        try:
            _send(request, self.popen.stdin)
            answer = _receive(self.popen.stdout)
        except OSError:  # it closed its end
            pass
        except (OverflowError, MemoryError):  # an impossible length
            raise ChildError("gave an invalid answer") from None
        finally:
            if timer is not None:
                timer.cancel()
        if answer is None:
            if self._timed_out:
                raise ChildError(f"took longer than {timeout:g} s", timed_out=True)
            raise self._ending()
        try:
            return unpack(answer, classes)
        except MessageError:
            raise ChildError("gave an invalid answer") from None

    def end(self) -> None:
        """End the process, and release what it had."""
        self.popen.kill()
        self.popen.wait()
        for pipe in (self.popen.stdin, self.popen.stdout):
            assert pipe is not None
            with suppress(OSError):  # data that could not be sent
                pipe.close()
        self._release()

    def _release(self) -> None:
        self._said.close()
        shutil.rmtree(self._scratch, ignore_errors=True)

    def _expire(self) -> None:
        self._timed_out = True
        self.popen.kill()

    def _ending(self) -> ChildError:
        """Return how the process ended, which may take a moment after its pipes are closed."""
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(_PATIENCE)
        self._said.seek(max(self._said.seek(0, os.SEEK_END) - _LAST_WORDS, 0))
        lines = self._said.read().decode("utf-8", "replace").splitlines()
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")[:200]
        error = ChildError("crashed", self.popen.poll(), last)
        reasons = [error.how] * (error.code is not None) + [last] * bool(last)
        error.reason += f" ({', '.join(reasons)})" * bool(reasons)
        return error


def serve(answer: Callable[[Any], Any]) -> None:
    """Answer the parent's requests, and end with it; what libraries print goes to stderr."""
    # Ctrl-C reaches all processes of a terminal; the parent decides what happens to its children.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":  # also while a library holds the interpreter
        ctypes.CDLL(None).prctl(_PARENT_DEATH, signal.SIGKILL)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    received = os.fdopen(os.dup(0), "rb")
    threading.Thread(target=_listen, args=(received, requests), daemon=True).start()
    try:
        while True:
            _send(answer(requests.get()), answers)
    except BaseException:
        traceback.print_exc()
        os._exit(1)  # the thread that listens would keep Python from ending


def _listen(received: IO[bytes], requests: queue.SimpleQueue[Any]) -> None:
    try:
        while (request := _receive(received)) is not None:
            requests.put(unpack(request, {}))
    except BaseException:  # such as a request that does not fit into memory
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


def _send(value: Any, file: IO[bytes]) -> None:
    parts = pack(value)
    file.write(sum(len(part) for part in parts).to_bytes(8, "little"))
    for part in parts:
        file.write(part)
    file.flush()


def _receive(file: IO[bytes]) -> bytes | None:
    """Read a message; None if the other side has ended."""
    head = file.read(8)
    n_bytes = int.from_bytes(head, "little")
    message = file.read(n_bytes)
    return message if len(head) == 8 and len(message) == n_bytes else None


def seconds_allowed(n_bytes: int) -> int:
    """Return the computing time that files of a size may take: 10 s, and 1 s per 4 MB."""
    return 10 + n_bytes // 4_000_000


def memory_allowed(n_bytes: int) -> int:
    """Return the memory that reading files may take: 1 GiB, or 64 times their size."""
    return max(_GIB, 64 * n_bytes)


class _Limits:
    """Limits of this process; none until `start` is called."""

    def __init__(self) -> None:
        self._n_bytes: int | None = None
        self._used = 0

    def start(self) -> None:
        """Limit what this process takes from now on."""
        self._n_bytes = 0
        self._used = _memory_in_use()

    def allow(self, n_bytes: int) -> None:
        """Allow what reading this many further bytes may take, if there are limits."""
        if self._n_bytes is None:
            return
        self._n_bytes += n_bytes
        seconds = seconds_allowed(self._n_bytes)
        with suppress(ImportError, ValueError, OSError):  # Windows; a lower limit of the system
            import resource

            memory = self._used + memory_allowed(self._n_bytes)
            for kind, limit in (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory):
                resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _WAITING * seconds)


def _memory_in_use() -> int:
    """Bytes of address space of this process; 0 where the system does not say."""
    with suppress(OSError, ValueError, AttributeError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return pages * os.sysconf("SC_PAGE_SIZE")
    return 0


LIMITS = _Limits()
