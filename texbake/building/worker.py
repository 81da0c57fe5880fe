"""A worker: reads tasks from stdin, a line of JSON each, and writes what came of them to stdout.

It ends when stdin does, at once and whatever it is doing, so that none outlives its build. What
libraries print goes to stderr.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading

from texbake.building.task import run_task


def main() -> None:
    """Do one task after another."""
    # Ctrl-C reaches all processes of a terminal; the build decides what becomes of workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(tasks,), daemon=True).start()
    while True:
        outcome = run_task(json.loads(tasks.get()))
        answers.write(json.dumps(outcome).encode() + b"\n")
        answers.flush()


def _read(tasks: queue.SimpleQueue[bytes]) -> None:
    for line in sys.stdin.buffer:
        tasks.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
