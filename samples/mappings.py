"""Draw every mapping on three shapes under a numbered checker, and all sixteen two-part pairs.

python mappings.py [OUT.png]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import texbake

OUT = Path(__file__).parent / "mappings.png"
CELL = 200  # pixels
GAP = 6
TEXT = 15
LABELS = 150  # pixels to the left of the rows of pairs
VASE = "0 0\n0.55 0\n0.7 0.3\n0.72 0.6\n0.5 1.1\n0.3 1.45\n0.28 1.6\n0.42 1.8\n"

METHODS = {
    "planar": {"method": "planar"},
    "planar, sides": {"method": "planar", "sides": True},
    "cylindrical": {"method": "cylindrical"},
    "with caps": {"method": "cylindrical", "caps": True},
    "spherical": {"method": "spherical"},
    "box": {"method": "box"},
    "box, overlap": {"method": "box", "overlap": True},
    "projector": {"method": "projector", "camera": (15.0, 20.0)},
    "its unseen aside": {"method": "projector", "camera": (80.0, 20.0)},
    "spherical, twirled": {"method": "spherical", "warp": ("twirl", 120.0)},
    "atlas": {"method": "atlas"},
    "parametric": {"method": "parametric"},
}
SURFACES = ("plane", "cylinder", "sphere", "box")
VIAS = ("surface-normal", "object-normal", "centroid", "reflection")


def shapes() -> list[texbake.Mesh]:
    """Return a vase, a torus and a pebble, all with coordinates of their own."""
    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder) / "vase.txt"
        profile.write_text(VASE)
        vase = texbake.make("revolution", profile=profile, resolution=(96, 12), crease=90.0)
    torus = texbake.make("torus", minor_radius=0.45, resolution=(96, 48))
    ball = texbake.make("sphere", resolution=(128, 96))
    x, y, z = ball.positions.T
    bumps = 1.0 + 0.18 * np.sin(3.1 * x + 1.0) * np.cos(2.7 * y) + 0.1 * np.sin(5.0 * z + x)
    pebble = ball.replace(
        positions=ball.positions * bumps[:, None], normals=None, normal_faces=None
    )
    return [vase, torus, pebble]


def picture(mesh: texbake.Mesh, checker: np.ndarray, *, bordered: bool = False) -> Image.Image:
    """Draw a mesh with the checker repeated, or with gray in the tile to its left."""
    options = texbake.RenderOptions(
        width=CELL, height=CELL, supersampling=4, view=(25.0, 25.0), background=(1, 1, 1)
    )
    if bordered:
        checker = np.concatenate([np.full_like(checker, 0.2), checker], axis=1)
        mesh = mesh.replace(uvs=mesh.uvs * [0.5, 1.0] + np.array([0.5, 0.0]))
    color = texbake.render(mesh, albedo=checker, options=options).color[:, :, :3]
    with tempfile.TemporaryDirectory() as folder:
        texbake.write_image(color, Path(folder) / "cell.png", color=True)
        return Image.open(Path(folder) / "cell.png").convert("RGB")


class Sheet:
    """A picture that takes cells and captions."""

    def __init__(self, width: int, height: int) -> None:
        self.image = Image.new("RGB", (width, height), (255, 255, 255))
        self._draw = ImageDraw.Draw(self.image)

    def text(self, x: int, y: int, words: str, size: int = TEXT) -> None:
        """Write a line with its upper left corner there."""
        self._draw.text((x, y), words, (30, 30, 30), ImageFont.load_default(size))


def main(out: Path) -> None:
    """Draw both parts, one above the other."""
    meshes = shapes()
    checker = texbake.checker_image(1024, 8)
    step, line = CELL + GAP, 2 * TEXT
    # Methods go from left to right, six a row, with a row for each shape.
    rows = -(-len(METHODS) // 6)
    width = LABELS + 12 * (CELL * 2 // 3 + GAP)
    top = rows * (3 * step + line)
    sheet = Sheet(max(width, 6 * step + GAP), top + line + 4 * (CELL * 2 // 3 + GAP) + 2 * line)
    left = (sheet.image.width - 6 * step) // 2
    for i, (name, options) in enumerate(METHODS.items()):
        x, y = left + i % 6 * step, i // 6 * (3 * step + line)
        sheet.text(x + 4, y + TEXT // 2, name)
        for j, mesh in enumerate(meshes):
            mapped = texbake.unwrap(mesh, size=1024, **options)
            cell = picture(mapped, checker, bordered=options["method"] == "projector")
            sheet.image.paste(cell, (x, y + line + j * step))
    draw_pairs(sheet, meshes, checker, top)
    sheet.image.quantize(256, dither=Image.Dither.NONE).save(out, optimize=True)


def draw_pairs(sheet: Sheet, meshes: list[texbake.Mesh], checker: np.ndarray, top: int) -> None:
    """Draw a table of surfaces and ways, three shapes a cell."""
    small = CELL * 2 // 3
    sheet.text(8, top + TEXT, "two-part", TEXT + 3)
    for column, via in enumerate(VIAS):
        sheet.text(LABELS + column * 3 * (small + GAP), top + TEXT, f"via {via}")
        for row, surface in enumerate(SURFACES):
            y = top + 3 * TEXT + row * (small + GAP)
            if column == 0:
                sheet.text(8, y + small // 2, surface)
            for j, mesh in enumerate(meshes):
                mapped = texbake.unwrap(
                    mesh,
                    method="two-part",
                    surface=surface,
                    via=via,
                    eye=(2.0, 2.0, 5.0) if via == "reflection" else None,
                )
                cell = picture(mapped, checker).resize((small, small), Image.Resampling.LANCZOS)
                sheet.image.paste(cell, (LABELS + (column * 3 + j) * (small + GAP), y))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUT)
