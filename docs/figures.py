"""The table of figures in the README, made by the commands below it.

    python docs/figures.py            # run the commands, and write the table into the README
    python docs/figures.py --quick    # run them on small meshes, and print the table

Blender is run as the variable TEXBAKE_BLENDER_PYTHON says. Close other programs first.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
_FIGURES = re.compile(
    r"(<!-- Made by docs/figures.py. -->\n\n)(.*?)(\n\n```sh\n)(.*?)(```\n)", re.DOTALL
)
_TEXBAKE = "from texbake_cli import run; run()"


def commands_of(page: str) -> list[list[str]]:
    """Words of the commands below the table."""
    found = _FIGURES.search(page)
    assert found is not None, "the README has no table of figures"
    return [shlex.split(line) for line in found[4].replace("\\\n", " ").splitlines()]


def summary_of(text: str) -> tuple[str, list[str]]:
    """Return what the Markdown of the bench says about its machine, and its first table."""
    head, _, rest = text.partition("\n\n")
    return head, rest.partition("\n\n")[0].splitlines()


def with_figures(page: str, texts: list[str]) -> str:
    """Return the page with the tables of several runs as one."""
    found = [summary_of(text) for text in texts]
    (head, table), *others = found
    rows = [row for _, lines in others for row in lines[2:]]
    block = "\n".join([head, "", *table, *rows])
    return _FIGURES.sub(lambda old: old[1] + block + old[3] + old[4] + old[5], page)


def main(words: list[str]) -> None:
    """Run the commands and write, or print, the table."""
    page, texts = README.read_text("utf-8"), []
    with tempfile.TemporaryDirectory() as folder:
        for number, command in enumerate(commands_of(page)):
            out = Path(folder) / str(number)
            line = [*command[1:], *words, "-o", str(out)]
            print(shlex.join(["texbake", *line]), flush=True)
            subprocess.run([sys.executable, "-P", "-c", _TEXBAKE, *line], check=True)
            texts.append((out / "bench.md").read_text("utf-8"))
    page = with_figures(page, texts)
    if words:
        print(_FIGURES.search(page)[2])  # type: ignore[index]
    else:
        README.write_text(page, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
