"""Run a command and print what it took: `launcher.py TIMEOUT COMMAND...`, one JSON object.

A child of a large process inherits the mark of its greatest memory. This small process stands
between, so that the peak it reports is that of the command alone. It ends the command when stdin
ends, so that no command outlives the program that wants its figures.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress


def main(timeout, *command):
    """Run the command, with its output in a temporary file."""
    for name in "SIGINT", "SIGTERM", "SIGHUP":  # whoever sends one also closes stdin
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda number, frame: None)
    with tempfile.TemporaryFile() as output:
        start = time.perf_counter()
        try:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
            )
        except OSError as error:
            answer({"code": 127, "output": str(error)})
            return
        late = threading.Event()

        def end():
            late.set()
            kill(process)

        timer = threading.Timer(float(timeout), end)
        timer.start()
        threading.Thread(target=end_with_stdin, args=(process,), daemon=True).start()
        usage = wait_for(process)
        seconds = time.perf_counter() - start
        timer.cancel()
        output.seek(0)
        text = output.read()[-100_000:].decode("utf-8", "replace")
    report = {"code": process.returncode, "late": late.is_set(), "seconds": seconds, "output": text}
    if usage is not None:
        unit = 1 if sys.platform == "darwin" else 1024
        report["peak_bytes"] = usage.ru_maxrss * unit
    answer(report)


def answer(report):
    """Print the report, unless the program that wants it has ended."""
    try:
        print(json.dumps(report), flush=True)
    except OSError:
        os._exit(1)  # Python would print the error once more


def end_with_stdin(process):
    """End the command with stdin, read without a lock that this thread holds at exit."""
    while os.read(0, 1):
        pass
    kill(process)


def kill(process):
    """Kill a process without waiting for it; `Popen.kill` may take the figures of its end away."""
    if not hasattr(os, "wait4"):
        process.kill()
    elif process.returncode is None:
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL)


def wait_for(process):
    """Wait; return what the process and its children used, None where that is not known."""
    if not hasattr(os, "wait4"):
        process.wait()
        return None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage


if __name__ == "__main__":
    main(*sys.argv[1:])
