"""The pages of the reference that are made from the program are those that it makes now."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
try:
    import reference
finally:
    sys.path.pop(0)

PAGES = reference.pages()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_page_is_up_to_date(page: Path) -> None:
    now = page.read_text(encoding="utf-8")
    assert now == PAGES[page], "write it anew: python docs/reference.py"
