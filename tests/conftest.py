"""Fixtures shared by all tests."""

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

# The same examples in every run. None is too slow: machines are busy.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# For embreex_oracle and displaced_mesh.
sys.path[:0] = [str(Path(__file__).parent / room) for room in (".", "rendering")]


# Long ones first, so that no process works alone at the end.
_FIRST = ("study", "docs", "goldens", "pages", "samples", "building", "cli")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep what shares a fixture in one process: the tests of a file, and those of one study."""
    for item in items:
        shared = "quick_study" if "quick_study" in item.fixturenames else str(item.path)
        item.add_marker(pytest.mark.xdist_group(shared))
    rooms = Path(__file__).parent
    order = dict(zip(_FIRST, range(len(_FIRST)), strict=True))
    items.sort(key=lambda item: order.get(item.path.relative_to(rooms).parts[0], len(order)))


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
