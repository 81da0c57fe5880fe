"""Damaged files: each is read or refused by one clear error, in bounded time and memory."""

import contextlib
import json
import signal
import subprocess
import sys
import time

import fuzz_files
import numpy as np
import pytest
from fuzz_files import FORMATS

import texbake

# Bytes of mutants per format in a normal run; TEXBAKE_FUZZ=minutes fuzzes each for that long.
N_BYTES = 1_000_000


@pytest.fixture(scope="module")
def fuzzed(hard_cases_dir, fuzz_minutes, tmp_path_factory):
    """The result of each format, all in one process, and the output of that if it ended early.

    Its last mutant, in the folder of the first format that is missing, is what ended it.
    """
    limit = 300.0 + len(FORMATS) * 60.0 * fuzz_minutes
    command = [
        sys.executable, str(hard_cases_dir / "fuzz_files.py"), "--bytes", str(N_BYTES),
        "--minutes", str(fuzz_minutes), "--folder", str(tmp_path_factory.mktemp("mutants")),
    ]  # fmt: skip
    # Libraries print other text beside it, in any bytes.
    run = subprocess.run(
        command, capture_output=True, text=True, errors="replace", timeout=limit, check=False
    )
    found = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    return {row["format"]: row for row in found}, run.stderr[-2000:]


def test_a_million_bytes_of_mutations(file_format, fuzzed):
    found, complaint = fuzzed
    assert file_format in found, complaint
    assert found[file_format]["faults"] == []
    assert found[file_format]["bytes"] >= N_BYTES


def test_an_image_whose_complaint_is_no_text_is_refused(tmp_path):
    path = tmp_path / "image.exr"
    texbake.write_image(np.ones((4, 4, 3), np.float32), path, bits=16)
    path.write_bytes(path.read_bytes().replace(b"chlist", b"chl\xffst"))
    with pytest.raises(texbake.FileFormatError):
        texbake.read_image(path, color=False)


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
