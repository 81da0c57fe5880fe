"""The README's table of figures is made by the commands below it."""

import sys
from pathlib import Path

from texbake.study.options import TASK_NAMES

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
try:
    import figures
finally:
    sys.path.remove(str(DOCS))

TEXT = """Measured on 2026-11-27, on {0}.

| case | task |
|---|---|
| {1} | bake |
"""


def test_tables_of_all_commands_become_one():
    page = figures.README.read_text("utf-8")
    commands = figures.commands_of(page)
    assert [words[:2] for words in commands] == [["texbake", "bench"]] * 3
    tasks = [word for words in commands for word in words if word in TASK_NAMES]
    assert sorted(tasks) == sorted(TASK_NAMES)  # each once
    texts = [TEXT.format("a", "sphere"), TEXT.format("a", "two-parts")]
    made = figures.with_figures(page, texts)
    table = "| case | task |\n|---|---|\n| sphere | bake |\n| two-parts | bake |\n\n```sh\n"
    assert f"Measured on 2026-11-27, on a.\n\n{table}" in made
    assert figures.commands_of(made) == commands
    assert figures.with_figures(made, texts) == made
    before, after = page.split("<!-- Made by docs/figures.py. -->")
    assert made.startswith(before) and made.endswith(after[after.index("```sh") :])
