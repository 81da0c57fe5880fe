"""Every example in a docstring gives what it says."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import texbake

ROOT = Path(texbake.__file__).parent


def modules_with_examples():
    for path in sorted(ROOT.rglob("*.py")):
        if ">>> " in path.read_text(encoding="utf-8"):
            name = ".".join(["texbake", *path.relative_to(ROOT).with_suffix("").parts])
            yield name.removesuffix(".__init__")


@pytest.mark.parametrize("name", list(modules_with_examples()))
def test_examples_of_docstrings(name):
    failed, tried = doctest.testmod(import_module(name))
    assert tried > 0
    assert failed == 0


def test_most_packages_have_examples():
    assert {name.split(".")[1] for name in modules_with_examples() if "." in name} >= {
        "baking", "mapping", "mesh", "texture",
    }  # fmt: skip
