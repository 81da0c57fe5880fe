"""What MkDocs does with links that leave docs/, so that pages read well here and as a site.

Pictures of samples/ are copied into the site. Links to other files of the repository become their
path, because the site does not have them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
_OUTSIDE = re.compile(
    r"(?P<mark>!?)\[(?P<text>[^]]*)\]\((?P<up>(?:\.\./)+)(?P<path>samples/[^)]*|tests/[^)]*|[A-Z]+\.md)\)"
)


def on_files(files: Files, config: Any) -> Files:
    """Add the pictures of samples/ to the site."""
    for path in sorted(ROOT.glob("samples/**/*.png")):
        files.append(
            File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path))
        )
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point links to samples/ into the site, and name files that are not in it."""
    to_top = "../" * page.file.src_uri.count("/")

    def replaced(match: re.Match[str]) -> str:
        if match["mark"]:
            return f"![{match['text']}]({to_top}{match['path']})"
        return f"{match['text']} (`{match['path']}`)"

    return _OUTSIDE.sub(replaced, markdown)
