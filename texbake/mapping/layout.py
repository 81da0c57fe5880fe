"""A picture of texture coordinates: charts in different colors, with outlines and triangles.

What is wrong stands out: mirrored faces are red, and the colors of overlapping faces mix. Seams are
darker than the borders of the surface itself.

Kernel: `core/scanline_coverage.c`.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterator

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import UvError, require_library
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas, unmeasurable_size
from texbake.mapping.seams import border_edges, chart_ids, seam_edges
from texbake.mapping.stretch import face_stretch
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.oklch import diverging
from texbake.parallel import run_bands
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
    mesh: Mesh,
    charts: IntArray,
    size: int | tuple[int, int],
    heat: bool,
    stacked: BoolArray | None = None,
) -> FloatArray:
    """(F, 3) sRGB colors of faces: by stretch, or by chart with mirrored faces in red.

    `stacked` (F,) faces lie on others on purpose and are not red.
    """
    if heat:
        return _heat_colors(mesh, size)
    colors = _chart_palette(int(charts.max()) + 1)[charts]
    mirrored = signed_areas(mesh.corner_uvs()) < 0.0
    colors[mirrored if stacked is None else mirrored & ~stacked] = MIRRORED
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


SAMPLES = 4  # along each side of a pixel, as in `core/scanline_coverage.c`

_BAND = 128  # rows drawn by one thread at a time
_TILE_PX = 1.0
_TILE_DARKNESS = 0.5
_LEAST_TILE_PX = 8.0  # side of the smallest tile whose border is drawn
_LEAST_NUMBERED_PX = 48.0


def draw_layout(
    mesh: MeshLike,
    size: int | tuple[int, int] = 1024,
    *,
    heat: bool = False,
    threads: int | None = None,
) -> Float32Array:
    """Draw the texture coordinates of a mesh.

    The picture shows the unit square and whatever lies outside it. If there are several tiles,
    their borders and UDIM numbers are drawn.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    size : int or (int, int)
        Pixels along each side, or (width, height), of one tile. A picture of several tiles has the
        same longer side.
    heat
        Color faces by L2 stretch relative to the mean of the mesh: blue where the texture is
        compressed, amber where it is stretched, with a scale below the picture.
    threads
        None for every processor.

    Returns
    -------
    (H, W, 3) float32
        Linear colors in [0, 1]; row 0 is the top.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or some are too far out to be measured.
    """
    mesh = as_mesh(mesh)
    uvs = measurable_uvs(mesh)
    window = LayoutWindow.around(uvs, size)
    pixels = np.ascontiguousarray(window.pixels(uvs))
    colors = linear(face_colors(mesh, chart_ids(mesh), size, heat))
    seams = seam_edges(mesh)
    ends = np.stack([pixels, np.roll(pixels, -1, axis=1)], axis=2)
    edge_light = 1.0 - edge_darkness(pixels)
    borders = _tile_borders(window)
    inks = (
        (borders, _TILE_PX, _TILE_DARKNESS),
        (ends[border_edges(mesh) & ~seams], OUTLINE_PX, OUTLINE_DARKNESS),
        (ends[seams], OUTLINE_PX, SEAM_DARKNESS),
    )
    picture = np.empty((window.height, window.width, 3), dtype=np.float32)

    def draw_rows(start: int, stop: int) -> None:
        shape = stop - start, window.width
        sums = np.zeros((*shape, 4))
        core.cover_faces(pixels, colors, start, EDGE_PX / 2.0, edge_light, sums)
        hits = sums[:, :, 3:]
        covered = np.minimum(hits / SAMPLES**2, 1.0)
        rows = covered * (sums[:, :, :3] / np.maximum(hits, 1.0))
        rows += (1.0 - covered) * linear(BACKGROUND)
        for lines, width, darkness in inks:
            rows *= 1.0 - darkness * _inked(lines, width, start, shape)
        picture[start:stop] = rows

    run_bands(draw_rows, window.height, band=_BAND, threads=threads)
    if len(borders):
        _write_tile_names(picture, window)
    return np.concatenate([picture, _legend(window.width)]) if heat else picture


def _tile_borders(window: LayoutWindow) -> FloatArray:
    """(N, 2, 2) float64: ends of the borders of tiles, in pixels; none for a single tile."""
    if window.tile_side < _LEAST_TILE_PX:
        return np.zeros((0, 2, 2))
    corners = np.array([(tile.column, tile.row) for tile in window.tiles()], dtype=np.float64)
    corners = corners.reshape(-1, 2)
    square = np.array([[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 1]], [[0, 1], [0, 0]]])
    ends = corners[:, None, None, :] + square
    return np.ascontiguousarray(window.pixels(ends.reshape(-1, 2, 2)))


def _inked(lines: FloatArray, width: float, top: int, shape: tuple[int, int]) -> FloatArray:
    """(H, W, 1) float64: share of each pixel, from row `top` on, that is on a line."""
    masks = np.zeros(shape, dtype=np.uint16)
    core.cover_lines(lines, top, width / 2.0, masks)
    bits = np.unpackbits(masks.view(np.uint8).reshape(*shape, 2), axis=2)
    return np.asarray(bits.sum(axis=2)[:, :, None] / SAMPLES**2)


def _write_tile_names(picture: Float32Array, window: LayoutWindow) -> None:
    """Draw the name of each tile into its lower left corner."""
    if window.tile_side < _LEAST_NUMBERED_PX:
        return
    size = max(10, min(round(window.tile_side / 10.0), 48))
    for tile in window.tiles():
        x, y = window.pixels(np.array([tile.column, tile.row], dtype=np.float64))
        ink = text_coverage(tile.name, size)
        margin = size // 3
        plate = np.full((len(ink) + 2 * margin, ink.shape[1] + 2 * margin), 0.7, dtype=np.float32)
        left, top = round(x) + 2, round(y) - 2 - len(plate)
        _stamp(picture, plate, left, top, linear(BACKGROUND))
        _stamp(picture, ink, left + margin, top + margin)


def _legend(width: int) -> Float32Array:
    """Scale of stretch for below the picture: a bar, with figures under it and words beside it."""
    size = legend_size(width)
    strip = np.empty((3 * size, width, 3), dtype=np.float32)
    strip[:] = linear(BACKGROUND)
    words = [text_coverage(word, size) for word in HEAT_WORDS]
    room = max(words[0].shape[1], words[2].shape[1]) + 2 * size
    has_words = width > 2 * room + 12 * size
    left, right = (room, width - room) if has_words else (size, max(width - size, size + 1))
    levels = np.linspace(-1.0, 1.0, right - left)
    bar = linear(np.array([heat_color(pm.power(HEAT_RANGE, level)) for level in levels.tolist()]))
    strip[size // 2 : size // 2 + size, left:right] = bar[: max(width - left, 0)]
    for stretch, label in HEAT_TICKS:
        ink = text_coverage(label, size)
        x = left + (pm.log(stretch) / pm.log(HEAT_RANGE) + 1.0) / 2.0 * (right - left)
        _stamp(strip, ink, round(x - ink.shape[1] / 2.0), 2 * size - size // 4)
    if has_words:
        middle = size - len(words[0]) // 2
        _stamp(strip, words[0], left - words[0].shape[1] - size // 2, middle)
        _stamp(strip, words[2], right + size // 2, middle)
        _stamp(strip, words[1], size // 2, 2 * size - size // 4)
    return strip


def _stamp(
    picture: Float32Array, ink: Float32Array, left: int, top: int, color: FloatArray | None = None
) -> None:
    """Blend ink into a picture, clipped to it; dark unless a color is given."""
    height, width = picture.shape[:2]
    top_cut, left_cut = max(-top, 0), max(-left, 0)
    ink = ink[top_cut : max(height - top, 0), left_cut : max(width - left, 0), None]
    rows = slice(top + top_cut, top + top_cut + ink.shape[0])
    columns = slice(left + left_cut, left + left_cut + ink.shape[1])
    color = linear(INK) if color is None else color
    picture[rows, columns] += ink * (color.astype(np.float32) - picture[rows, columns])
