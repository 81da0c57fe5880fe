"""Every input of the corpus is read, or refused with one clear error."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from read_corpus import CORPUS, FORMATS, folder_of, wrong_with_inputs


@pytest.mark.parametrize("name", [name for name in FORMATS if folder_of(name).is_dir()])
def test_each_input_is_read_or_refused(name):
    assert list(wrong_with_inputs(name)) == []


def test_the_corpus_has_every_format_and_nothing_else():
    folders = {path.name for path in CORPUS.iterdir()}
    names = {name.replace(" ", "_") for name in FORMATS if not name.startswith("usd")}
    assert folders == names
    assert all(len(list((CORPUS / name).iterdir())) > 2 for name in names)
