"""Write the lists of cases into the page about hard cases: python tests/hard_cases/table.py."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from catalog.geometry import GEOMETRY
from catalog.images import IMAGES
from catalog.mappings import MAPPINGS
from catalog.pairs import PAIRS
from catalog.rays import RAYS
from catalog.scenes import SCENES
from catalog.texture_space import TEXTURE_SPACE

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "hard-cases.md"
CATALOG = {
    "Geometry": GEOMETRY, "Pairs to bake": PAIRS, "Rays": RAYS,
    "Texture space and tangents": TEXTURE_SPACE, "Mappings": MAPPINGS, "Images": IMAGES,
    "Scenes": SCENES,
}  # fmt: skip
HEAD = "\n## The catalog\n"


def document():
    """Return the page with the current lists."""
    lines = [PAGE.read_text(encoding="utf-8").partition(HEAD)[0] + HEAD]
    for title, cases in CATALOG.items():
        lines += [
            f"### {title}\n",
            "| case | what goes wrong in naive code | refused, by one clear error |",
        ]
        lines += ["|---|---|---|"]
        lines += [f"| {case.name} | {case.wrong} | {', '.join(case.refused)} |" for case in cases]
        lines += [""]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(document(), encoding="utf-8")
