"""Damaged files: each is read or refused by one clear error, in bounded time and memory."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import fuzz_files
import numpy as np
import pytest
from fuzz_formats import FORMATS

import texbake
from texbake.errors import FileFormatError

HERE = Path(__file__).parent
FUZZ_MINUTES = float(os.environ.get("TEXBAKE_FUZZ", "0"))  # for each format
# Bytes of mutants per format in a normal run.
N_BYTES = 25_000


@pytest.fixture(scope="module")
def fuzzed(tmp_path_factory):
    """The result of each format, and what was printed beside it."""
    limit = 900.0 + len(FORMATS) * 60.0 * FUZZ_MINUTES
    command = [
        sys.executable, str(HERE / "fuzz_files.py"), "--bytes", str(N_BYTES),
        "--minutes", str(FUZZ_MINUTES), "--folder", str(tmp_path_factory.mktemp("mutants")),
    ]  # fmt: skip
    # Libraries print other text beside it, in any bytes.
    run = subprocess.run(
        command, capture_output=True, text=True, errors="replace", timeout=limit, check=False
    )
    found = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    return {row["format"]: row for row in found}, run.stderr[-2000:]


def test_damaged_files_are_read_or_refused(file_format, fuzzed):
    found, complaint = fuzzed
    assert file_format in found, complaint
    assert found[file_format]["faults"] == []
    assert found[file_format]["bytes"] >= N_BYTES


def test_an_image_whose_complaint_is_no_text_is_refused(tmp_path):
    path = tmp_path / "image.exr"
    texbake.write_image(np.ones((4, 4, 3), np.float32), path, bits=16)
    path.write_bytes(path.read_bytes().replace(b"chlist", b"chl\xffst"))
    with pytest.raises(FileFormatError):
        texbake.read_image(path, color=False)


READERS = """
import os, signal, sys
import numpy as np
sys.path.insert(0, os.environ["HARD_CASES"])
import fuzz_files

def end(path):
    if path.stem == "mutant":
        os.kill(os.getpid(), signal.SIGKILL)

def fill(path):
    if path.stem == "mutant":
        np.ones(fuzz_files.MEMORY // 8 + 1)

for read in end, fill:
    make = lambda path: path.write_text("a file")
    fuzz_files.FORMATS[read.__name__] = (".txt", make, read)
sys.exit(fuzz_files.main())
"""


def test_a_reader_that_ends_the_process_or_fills_the_memory_is_at_fault(tmp_path):
    script = tmp_path / "readers.py"
    script.write_text(READERS)
    command = [sys.executable, str(script), "end", "fill", "--files", "3"]
    environment = {**os.environ, "HARD_CASES": str(HERE)}
    run = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60.0, check=False
    )
    found = [json.loads(line) for line in run.stdout.splitlines()]
    assert run.returncode == 1, run.stderr
    assert [(row["format"], row["files"], len(row["faults"])) for row in found] == [
        ("end", 3, 3),
        ("fill", 3, 3),
    ]
    assert all("ended the process with -9" in fault for fault in found[0]["faults"])
    assert all("MemoryError" in fault for fault in found[1]["faults"])


@pytest.mark.parametrize("hidden", [Exception, BaseException])
def test_a_reader_that_hides_that_it_hangs_is_at_fault(monkeypatch, tmp_path, hidden):
    def read(_path):
        with contextlib.suppress(hidden):
            time.sleep(10.0)

    monkeypatch.setattr(fuzz_files, "SECONDS", 1)
    before = signal.signal(signal.SIGALRM, fuzz_files._hang)
    try:
        assert fuzz_files._fault(read, tmp_path) is not None
    finally:
        signal.signal(signal.SIGALRM, before)
