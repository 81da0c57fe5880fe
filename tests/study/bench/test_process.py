"""Whole processes: their time, memory, output and faults."""

import os
import subprocess
import sys

import pytest

from texbake.study.bench.programs import RUNNERS, run_process

MB = 1 << 20


def python(code, timeout=60.0):
    return run_process([sys.executable, "-P", "-c", code], timeout=timeout)


def test_a_process_is_timed_from_start_to_end():
    done = python("import time; time.sleep(0.3); print('slept')")
    assert done.seconds > 0.3 and done.fault == "" and done.output == "slept\n"


def test_memory_is_that_of_the_process_and_not_of_its_parent():
    held = bytearray(300 * MB)
    small = python("pass")
    large = python(f"x = bytearray({200 * MB})")
    assert len(held) == 300 * MB
    if small.peak_bytes is not None:
        assert small.peak_bytes < 100 * MB
        assert 200 * MB < large.peak_bytes < 300 * MB


def test_a_fault_is_the_last_line_that_was_printed():
    done = python("import sys; print('why'); sys.exit(3)")
    assert done.fault == "exit code 3: why"
    assert python("import sys; sys.exit(4)").fault == "exit code 4: it printed nothing"


def test_a_process_that_takes_too_long_is_ended():
    done = python("import time; time.sleep(60)", timeout=0.5)
    assert done.fault == "it was ended after 0.5 s" and done.seconds < 30.0


def test_a_command_that_is_not_there():
    done = run_process(["/nowhere/python"], timeout=10.0)
    assert done.fault.startswith("exit code 127") and done.seconds == 0.0


def test_much_output_does_not_block():
    done = python("print('x' * 1_000_000); print('end')")
    assert done.fault == "" and done.output.endswith("end\n") and len(done.output) <= 100_000


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_what_somebody_ends_is_a_fault():
    done = python("import os, signal; os.kill(os.getppid(), signal.SIGKILL)")
    assert done.fault == "it was ended from outside: exit code -9"


def test_a_report_that_nobody_reads_is_no_error():
    launcher = [sys.executable, "-I", str(RUNNERS / "launcher.py"), "60", sys.executable, "-c", ""]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(launcher, stdin=subprocess.PIPE, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert done.stderr == b""
