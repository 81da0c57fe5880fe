"""Fixtures shared by all tests."""

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest

# For embreex_oracle and displaced_mesh.
sys.path[:0] = [str(Path(__file__).parent / room) for room in (".", "rendering")]


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real meshes; the test is skipped where it is absent."""
    folder = Path(
        os.environ.get("TEXBAKE_DATA", Path(__file__).parents[2] / "shared" / "data")
    ).resolve()
    if not (folder / "INDEX.md").is_file():
        pytest.skip(f"the real meshes are not here ({folder}); name their folder in TEXBAKE_DATA")
    return folder


@pytest.fixture(scope="session")
def meshoptimizer() -> ModuleType:
    """The library that codes views of glTF files; the test is skipped where it is not installed.

    PyPI has no wheels of it, so that it takes a compiler, and the extra `test` goes without it.
    """
    library: ModuleType = pytest.importorskip(
        "meshoptimizer",
        reason="meshoptimizer is not installed: pip install 'texbake[meshoptimizer]'",
        exc_type=ImportError,
    )
    return library
