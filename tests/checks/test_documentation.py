"""The page of the check lists what the check looks for."""

from pathlib import Path

from texbake.checks.kinds import KINDS

PAGE = Path(__file__).parents[2] / "docs" / "check.md"


def test_the_table_is_that_of_the_code() -> None:
    rows = [
        line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")
    ]
    assert rows == [
        f"| `{kind.name}` | {kind.title} | {kind.unit[1]} | {kind.low or '—'} "
        f"| {kind.high or '—'} |"
        for kind in KINDS.values()
    ]
