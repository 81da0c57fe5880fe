"""Every input of the corpus is read, or refused with one clear error."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from read_corpus import FORMATS, folder_of, wrong_with_inputs


@pytest.mark.parametrize("name", [name for name in FORMATS if folder_of(name).is_dir()])
def test_each_input_is_read_or_refused(name):
    assert list(wrong_with_inputs(name)) == []
