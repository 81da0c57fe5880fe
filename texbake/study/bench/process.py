"""Whole processes, timed: seconds by the clock from their start to their end, and peak memory."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

RUNNERS = Path(__file__).with_name("runners")
_LAUNCHER = RUNNERS / "launcher.py"


@dataclass(frozen=True, kw_only=True)
class Finished:
    """What a process took."""

    seconds: float = 0.0  # from its start to its end; 0 if it could not be started
    processor_seconds: float | None = None  # of all its threads; None where the system does not say
    # Greatest resident memory of it or one of its children; None where the system does not say.
    peak_bytes: int | None = None
    output: str = ""  # the end of what it printed
    fault: str = ""  # why it failed; empty if it did not


def run_process(command: Sequence[str], *, timeout: float) -> Finished:
    """Run a command to its end, or until `timeout` seconds have passed."""
    line = [sys.executable, "-I", str(_LAUNCHER), str(timeout), *command]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as launched:
        assert launched.stdin is not None and launched.stdout is not None
        try:
            answer = launched.stdout.read()
        finally:
            launched.stdin.close()  # it ends its command, unless that has ended
    if launched.returncode:  # somebody ended it
        return Finished(fault=f"it was ended from outside: exit code {launched.returncode}")
    report = json.loads(answer)
    return Finished(
        seconds=report.get("seconds", 0.0),
        processor_seconds=report.get("processor_seconds"),
        peak_bytes=report.get("peak_bytes"),
        output=report["output"],
        fault=_fault(report, timeout),
    )


def _fault(report: dict[str, object], timeout: float) -> str:
    if report.get("late"):
        return f"it was ended after {timeout:g} s"
    code = report["code"]
    if code == 0:
        return ""
    lines = [line for line in str(report["output"]).splitlines() if line.strip()]
    last = lines[-1].strip() if lines else "it printed nothing"
    return f"exit code {code}: {last}"
