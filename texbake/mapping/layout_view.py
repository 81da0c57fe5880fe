"""What pictures of texture coordinates share: the window, tiles, colors and text."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterator

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import UvError, require_library
from texbake.mapping.corner_uvs import signed_areas, unmeasurable_size
from texbake.mapping.stretch import face_stretch
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.oklch import diverging
from texbake.records import dataclass

# sRGB-coded colors.
BACKGROUND = (0.96, 0.96, 0.96)
INK = (0.12, 0.12, 0.12)
MIRRORED = (0.86, 0.10, 0.12)
UNMEASURED = (0.75, 0.75, 0.75)

# Widths of lines, and their darkness: 1 is black. Seams are darker than the borders of the surface.
EDGE_PX = 0.7
OUTLINE_PX = 1.4
SEAM_DARKNESS = 0.85
OUTLINE_DARKNESS = 0.55
_EDGE_DARKNESS = 0.45
_ROOMY_PX = 12.0  # smaller triangles get fainter edges, which would hide everything else

# The heat map shows L2 stretch from this to its inverse; beyond, the color stays the same.
HEAT_RANGE = 2.0
_HEAT_STEPS = 64  # colors on either side of the middle: more than the eye can distinguish
HEAT_TICKS = (
    (0.5, "0.5"),
    (math.sqrt(0.5), "0.7"),
    (1.0, "1"),
    (math.sqrt(2.0), "1.4"),
    (2.0, "2"),
)
HEAT_WORDS = ("compressed", "stretch L2", "stretched")

_GAMMA = 2.2  # close enough to sRGB for choosing colors
# Coordinates this close to the border of a tile lie on it: the rounding of float32 files.
_ROUNDING = 1e-6
_MOST_TILES = 128  # along a side; the borders of more tiles would cover the picture


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A unit square of texture space, by column and row."""

    column: int
    row: int

    @property
    def name(self) -> str:
        """UDIM number if the tile has one, else column and row."""
        if 0 <= self.column < 10 and 0 <= self.row < 900:
            return str(1001 + self.column + 10 * self.row)
        return f"{self.column}, {self.row}"


@dataclass(frozen=True, kw_only=True)
class LayoutWindow:
    """The part of texture space that a picture shows, and the size of the picture."""

    # low, high: lower left and upper right corner.
    low: tuple[float, float]
    high: tuple[float, float]
    # width, height: in pixels.
    width: int
    height: int

    @classmethod
    def around(cls, uvs: FloatArray, size: int | tuple[int, int]) -> LayoutWindow:
        """Window of the unit square and tiles of faces (F, 3, 2); `size` px for one tile."""
        sides = np.array([size, size] if isinstance(size, int) else size, dtype=np.float64)
        shown = uvs[signed_areas(uvs) != 0.0]
        low, high = np.zeros(2), np.ones(2)
        if len(shown):
            middles = np.floor(shown.mean(axis=1))
            low = np.minimum(low, np.minimum(middles.min(axis=0), _on_tile(shown.min(axis=(0, 1)))))
            high = np.maximum(
                high, np.maximum(middles.max(axis=0) + 1.0, _on_tile(shown.max(axis=(0, 1))))
            )
        extent = high - low
        width, height = np.maximum(np.rint(sides * extent / extent.max()), 1.0).astype(int).tolist()
        return cls(
            low=(float(low[0]), float(low[1])),
            high=(float(high[0]), float(high[1])),
            width=width,
            height=height,
        )

    def pixels(self, uvs: FloatArray) -> FloatArray:
        """(..., 2): coordinates in pixels, x to the right and y down from the upper left corner."""
        low, high = np.array(self.low), np.array(self.high)
        shares = (uvs - low) / (high - low)
        return np.asarray((shares * [1, -1] + [0, 1]) * [self.width, self.height])

    @property
    def tile_side(self) -> float:
        """Pixels of the shorter side of a tile."""
        return min(
            self.width / (self.high[0] - self.low[0]), self.height / (self.high[1] - self.low[1])
        )

    def tiles(self) -> Iterator[Tile]:
        """Tiles in the window, if there are several and not too many to distinguish."""
        left, bottom = (math.floor(value) for value in self.low)
        right, top = (math.ceil(value) for value in self.high)
        if 1 < max(right - left, top - bottom) <= _MOST_TILES:
            for row in range(bottom, top):
                for column in range(left, right):
                    yield Tile(column=column, row=row)


def face_colors(
    mesh: Mesh, charts: IntArray, size: int | tuple[int, int], heat: bool
) -> FloatArray:
    """(F, 3) sRGB colors of faces, by chart or by stretch; mirrored faces are red."""
    colors = _heat_colors(mesh, size) if heat else _chart_palette(int(charts.max()) + 1)[charts]
    colors[signed_areas(mesh.corner_uvs()) < 0.0] = MIRRORED
    return colors


def edge_darkness(pixels: FloatArray) -> float:
    """Darkness of edges inside charts, by the size of the median triangle in pixels."""
    size = math.sqrt(2.0 * float(np.median(np.abs(signed_areas(pixels)))))
    return _EDGE_DARKNESS * min(size / _ROOMY_PX, 1.0)


def legend_size(width: int) -> int:
    """Height of the letters of a legend in pixels; the legend is three times as high."""
    return max(9, min(width // 48, 28))


def heat_color(stretch: float) -> tuple[float, float, float]:
    """The sRGB-coded color of an L2 stretch."""
    red, green, blue = coded(diverging(pm.log(stretch) / pm.log(HEAT_RANGE))).tolist()
    return red, green, blue


def linear(colors: FloatArray | tuple[float, float, float]) -> FloatArray:
    """Linear values of coded colors."""
    return np.asarray(pm.power(np.asarray(colors, dtype=np.float64), _GAMMA))


def coded(colors: FloatArray) -> FloatArray:
    """Coded values of linear colors."""
    return np.asarray(pm.power(colors, 1.0 / _GAMMA))


def _heat_colors(mesh: Mesh, size: int | tuple[int, int]) -> FloatArray:
    colors = np.empty((mesh.n_faces, 3))
    colors[:] = UNMEASURED
    if unmeasurable_size(mesh) is not None:
        return colors
    try:
        found = face_stretch(mesh, size)
    except UvError:  # no face has an area: there is nothing to color
        return colors
    levels = np.clip(pm.log(found.l2) / pm.log(HEAT_RANGE), -1.0, 1.0)
    colors[found.faces] = coded(diverging(np.rint(levels * _HEAT_STEPS) / _HEAT_STEPS))
    return colors


def _chart_palette(n_charts: int) -> FloatArray:
    """(n, 3) float64: distinct hues for consecutive charts."""
    palette = [
        # Hues from orange to magenta, since red means mirrored, spread by the golden ratio.
        colorsys.hls_to_rgb(0.07 + 0.83 * (chart * 0.618034 % 1.0), 0.70 + 0.05 * (chart % 3), 0.55)
        for chart in range(n_charts)
    ]
    return np.array(palette)


def _on_tile(values: FloatArray) -> FloatArray:
    """Coordinates, moved onto the border of a tile where they miss it by rounding alone."""
    borders = np.rint(values)
    return np.where(np.abs(values - borders) <= _ROUNDING * (1.0 + np.abs(values)), borders, values)


def text_coverage(text: str, size: int) -> Float32Array:
    """(h, w) coverage by the glyphs of a line of text, cropped; `size` is the font's, in px."""
    require_library("PIL", "text in pictures")
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox(text)
    room = int(right - left) + 2 * size, int(bottom - top) + 2 * size
    sheet = Image.new("L", room)
    ImageDraw.Draw(sheet).text((size - left, size - top), text, fill=255, font=font)
    box = sheet.getbbox() or (0, 0, 0, 0)
    coverage = np.asarray(sheet.crop(box), np.float32) / np.float32(255.0)
    return coverage.astype(np.float32, copy=False)
