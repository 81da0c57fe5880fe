"""The commands of a page, and the pictures of the tutorials.

    python docs/commands.py                  # run the tutorials, keep their pictures
    python docs/commands.py texture-mapping  # one of them

Every command in a `sh` block is run, in the order of the page, in one folder. A tutorial shows what
its commands have drawn: `![...](../images/PAGE/NAME.png)` is the file NAME.png of that folder.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

WIDTH = 1000  # pixels
DOCS = Path(__file__).parent
_BLOCK = re.compile(r"^```(sh|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r"!\[[^]]*\]\(\.\./images/([\w-]+)/([\w-]+)\.png\)")
_TEXBAKE = "from texbake_cli import run; run()"
_SAVED = re.compile(r"Save this as `([\w.]+)`")


def commands_of(page: Path) -> list[list[str]]:
    """Words of every `texbake` and `mkdir` command in the `sh` blocks of a page."""
    blocks = (body for kind, body in _BLOCK.findall(page.read_text("utf-8")) if kind == "sh")
    lines = [line for body in blocks for line in body.replace("\\\n", " ").splitlines()]
    parts = [part for line in lines for part in line.split("&&")]
    words = [shlex.split(part, comments=True) for part in parts]
    return [line for line in words if line and line[0] in ("texbake", "mkdir")]


def files_of(page: Path) -> dict[str, str]:
    """Files that a page asks its reader to save: the block after "Save this as"."""
    text = page.read_text("utf-8")
    saved = {}
    for match in _SAVED.finditer(text):
        block = _BLOCK.search(text, match.end())
        if block is not None:
            saved[match[1]] = block[2]
    return saved


def pictures_of(page: Path) -> list[str]:
    """Names of the pictures that the commands of a tutorial have drawn."""
    return [
        name for folder, name in _PICTURE.findall(page.read_text("utf-8")) if folder == page.stem
    ]


def run_page(page: Path, folder: Path) -> None:
    """Run the commands of a page in a folder, as its reader would."""
    for name, text in files_of(page).items():
        (folder / name).write_text(text, "utf-8")
    for words in commands_of(page):
        print(shlex.join(words), flush=True)
        if words[0] == "mkdir":
            (folder / words[1]).mkdir()
        else:
            subprocess.run([sys.executable, "-c", _TEXBAKE, *words[1:]], cwd=folder, check=True)


def keep_picture(path: Path, kept: Path) -> None:
    """Write a picture at a page's width, with 256 colors."""
    with Image.open(path) as picture:
        small = picture.convert("RGB")
    small.thumbnail((WIDTH, WIDTH))
    small.quantize(256, dither=Image.Dither.NONE).save(kept, optimize=True)


def main(pages: list[str]) -> None:
    """Run tutorials that have pictures and keep these."""
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        names = pictures_of(page)
        if not names or (pages and page.stem not in pages):
            continue
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            shutil.copytree(DOCS.parent / "samples" / "scenes", folder / "scenes")
            run_page(page, folder)
            images = DOCS / "images" / page.stem
            images.mkdir(parents=True, exist_ok=True)
            for name in names:
                found = sorted(folder.rglob(f"{name}.png"), key=lambda path: len(path.parts))
                keep_picture(found[0], images / f"{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
