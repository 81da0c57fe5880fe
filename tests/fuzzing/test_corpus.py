"""Every input of the corpus, and mutants of all, are read, or refused with one clear error."""

import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import read_corpus
from formats import READ, UNREACHED
from read_corpus import bounded_memory, fault_of, folder_of, wrong_with_inputs

from texbake.core import core
from texbake.errors import TexbakeError

N_BYTES = 10_000  # of mutants of a format; of those that a process of its own reads, a fifth
CHILDREN = ("dae", "3mf", "usd")


@pytest.mark.parametrize("name", READ)
def test_each_input_is_read_or_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    n_bytes = N_BYTES // 5 if name.startswith(CHILDREN) else N_BYTES
    assert list(wrong_with_inputs(name, n_bytes=n_bytes)) == []


def test_each_format_but_usd_has_inputs():
    assert [name for name in READ if not any(folder_of(name).glob("*")) and "usd" not in name] == []


def test_functions_that_no_target_calls_are_there_and_have_a_reason():
    assert set(UNREACHED) <= set(core._prototypes) and all(UNREACHED.values())


def many_lines(path):
    raise TexbakeError("two\nlines")


@pytest.mark.parametrize(("read", "fault"), [
    (many_lines, "several lines"),
    (lambda path: 1 / 0, "ZeroDivisionError: division by zero at .*test_corpus.py"),
    (lambda path: warnings.warn("odd", stacklevel=1), "UserWarning: odd"),
    (lambda path: np.ones(1 << 28), "MemoryError"),
    (lambda path: sum(range(10**7)), "it took more than 0.01 s of processor time"),
])  # fmt: skip
def test_what_else_a_reader_does_is_a_fault(read, fault, tmp_path, monkeypatch):
    monkeypatch.setattr(read_corpus, "SECONDS", 0.01)
    with bounded_memory(1 << 30):
        assert fault_of(lambda path: time.sleep(0.0), tmp_path) is None
        found = fault_of(read, tmp_path)
    assert found is not None and fault.split(".*")[0] in found
