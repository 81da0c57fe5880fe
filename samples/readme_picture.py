"""Make the picture at the top of the project's README: the demo's preview, a little smaller.

python readme_picture.py [OUT.png]
"""

import sys
import tempfile
from pathlib import Path

import texbake
from texbake.verbs.whole_jobs import demo_files

OUT = Path(__file__).parent / "orange.png"


def main(out: Path) -> None:
    """Run the demo and put its preview in place."""
    with tempfile.TemporaryDirectory() as folder:
        files = demo_files(folder).files
        picture = texbake.read_image(files["preview"], color=True).pixels
    height, width = (length // 2 * 2 for length in picture.shape[:2])
    halves = picture[:height, :width].reshape(height // 2, 2, width // 2, 2, -1)
    texbake.write_image(halves.mean(axis=(1, 3)), out, color=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUT)
