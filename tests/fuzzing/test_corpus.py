"""Every input of the corpus is read, or refused with one clear error."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from core_targets import READ, UNREACHED
from read_corpus import folder_of, wrong_with_inputs

from texbake.core.declarations import split_prototypes
from texbake.core.library import FOLDER


@pytest.mark.parametrize("name", [name for name in READ if folder_of(name).is_dir()])
def test_each_input_is_read_or_refused(name):
    assert list(wrong_with_inputs(name)) == []


def test_functions_that_no_target_calls_have_a_reason_and_are_there():
    declared = split_prototypes((FOLDER / "core.h").read_text())
    assert set(UNREACHED) <= set(declared) and all(UNREACHED.values())
