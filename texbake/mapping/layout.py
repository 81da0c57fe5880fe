"""A picture of texture coordinates: charts in different colors, with outlines and triangles.

What is wrong stands out: mirrored faces are red, and the colors of overlapping faces mix. Seams are
darker than the borders of the surface itself.

Kernel: `core/scanline_coverage.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mapping.corner_uvs import measurable_uvs
from texbake.mapping.layout_view import (
    BACKGROUND,
    EDGE_PX,
    HEAT_RANGE,
    HEAT_TICKS,
    HEAT_WORDS,
    INK,
    OUTLINE_DARKNESS,
    OUTLINE_PX,
    SEAM_DARKNESS,
    LayoutWindow,
    edge_darkness,
    face_colors,
    heat_color,
    legend_size,
    linear,
    text_coverage,
)
from texbake.mapping.seams import border_edges, chart_ids, seam_edges
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands

LayoutPixels = npt.NDArray[np.float32]

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
) -> LayoutPixels:
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


def _write_tile_names(picture: LayoutPixels, window: LayoutWindow) -> None:
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


def _legend(width: int) -> LayoutPixels:
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
    picture: LayoutPixels, ink: LayoutPixels, left: int, top: int, color: FloatArray | None = None
) -> None:
    """Blend ink into a picture, clipped to it; dark unless a color is given."""
    height, width = picture.shape[:2]
    top_cut, left_cut = max(-top, 0), max(-left, 0)
    ink = ink[top_cut : max(height - top, 0), left_cut : max(width - left, 0), None]
    rows = slice(top + top_cut, top + top_cut + ink.shape[0])
    columns = slice(left + left_cut, left + left_cut + ink.shape[1])
    color = linear(INK) if color is None else color
    picture[rows, columns] += ink * (color.astype(np.float32) - picture[rows, columns])
