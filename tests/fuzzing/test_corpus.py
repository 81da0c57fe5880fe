"""Every input of the corpus is read, or refused with one clear error; all of the core is called."""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from core_targets import READ, UNREACHED
from read_corpus import folder_of

from texbake.core import core


def test_each_input_is_read_or_refused_and_each_function_of_the_core_called():
    command = [sys.executable, "-P", str(Path(__file__).with_name("read_corpus.py"))]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stdout


def test_each_format_but_usd_has_inputs():
    assert [name for name in READ if not any(folder_of(name).glob("*")) and "usd" not in name] == []


def test_functions_that_no_target_calls_are_there_and_have_a_reason():
    assert set(UNREACHED) <= set(core._prototypes) and all(UNREACHED.values())
