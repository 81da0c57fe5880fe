"""A picture of texture coordinates: charts in colors of their own, outlined, with their triangles.

What is wrong stands out: mirrored faces are red, and the colors of faces that overlap mix.
"""

from __future__ import annotations

import colorsys
import math

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mapping.areas import signed_areas
from texbake.mapping.seams import border_edges, chart_ids
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.parallel import run_bands

_SAMPLES = 4  # a side of a pixel; their square must fit the bits of an outline mask
_BAND = 128  # rows drawn at once
_GAMMA = 2.2  # near enough to sRGB to choose colors by
_BACKGROUND = 0.96
_MIRRORED = (0.86, 0.10, 0.12)
_OUTLINE_PX = 1.4
_OUTLINE_DARKNESS = 0.75
_EDGE_PX = 0.7
_EDGE_DARKNESS = 0.45
_ROOMY_PX = 12.0  # triangles smaller than this get fainter edges, or nothing else would be seen


def draw_layout(
    mesh: Mesh, size: int | tuple[int, int] = 1024, *, threads: int | None = None
) -> npt.NDArray[np.float32]:
    """Draw the texture coordinates of a mesh over the unit square.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates. What lies outside the unit square is not drawn.
    size : int or (int, int)
        Pixels a side, or (width, height).
    threads
        None for every processor.

    Returns
    -------
    (H, W, 3) float32
        Linear colors in [0, 1]; row 0 is the top, where v is 1.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    """
    width, height = (size, size) if isinstance(size, int) else size
    uvs = mesh.corner_uvs()
    # Pixels, with y downwards as rows go.
    pixels = np.ascontiguousarray((uvs * [1, -1] + [0, 1]) * [width, height])
    colors = _face_colors(chart_ids(mesh))
    colors[signed_areas(uvs) < 0.0] = np.array(_MIRRORED) ** _GAMMA
    outlines = np.stack([pixels, np.roll(pixels, -1, axis=1)], axis=2)[border_edges(mesh)]
    edge_light = 1.0 - _edge_darkness(pixels)
    picture = np.empty((height, width, 3), dtype=np.float32)

    def draw_rows(start: int, stop: int) -> None:
        sums = np.zeros((stop - start, width, 4))
        _fill_kernel(pixels - [0, start], colors, _EDGE_PX / 2.0, edge_light, _SAMPLES, sums)
        hits = sums[:, :, 3:]
        covered = np.minimum(hits / _SAMPLES**2, 1.0)
        rows = covered * (sums[:, :, :3] / np.maximum(hits, 1.0))
        rows += (1.0 - covered) * _BACKGROUND**_GAMMA
        masks = np.zeros((stop - start, width), dtype=np.uint16)
        _outline_kernel(outlines - [0, start], _OUTLINE_PX / 2.0, _SAMPLES, masks)
        bits = np.unpackbits(masks.view(np.uint8).reshape(stop - start, width, 2), axis=2)
        inked = bits.sum(axis=2)[:, :, None] / _SAMPLES**2
        picture[start:stop] = rows * (1.0 - _OUTLINE_DARKNESS * inked)

    run_bands(draw_rows, height, band=_BAND, threads=threads)
    return picture


def _face_colors(charts: IntArray) -> FloatArray:
    """(F, 3) float64: linear colors, of unlike hues for charts of successive numbers."""
    palette = [
        # Hues from orange to magenta, since red means mirrored; the golden ratio spreads them.
        colorsys.hls_to_rgb(0.07 + 0.83 * (chart * 0.618034 % 1.0), 0.70 + 0.05 * (chart % 3), 0.55)
        for chart in range(int(charts.max()) + 1)
    ]
    return np.asarray((np.array(palette) ** _GAMMA)[charts])


def _edge_darkness(pixels: FloatArray) -> float:
    """How dark edges are drawn, by the size of a middling triangle."""
    size = math.sqrt(2.0 * float(np.median(np.abs(signed_areas(pixels)))))
    return _EDGE_DARKNESS * min(size / _ROOMY_PX, 1.0)


@kernel
def _fill_kernel(pixels, colors, half_edge, edge_light, n_samples, sums):  # type: ignore[no-untyped-def]
    """Add up the colors of the samples that each face covers, and their number."""
    n_rows, n_columns = sums.shape[:2]
    step = 1.0 / n_samples
    lines = np.empty((3, 3))  # through the edges: the distance inwards is a x + b y + c
    for face in range(len(pixels)):
        x, y = pixels[face, :, 0], pixels[face, :, 1]
        area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
        if area == 0.0:
            continue
        for i in range(3):
            j = (i + 1) % 3
            length = math.copysign(math.hypot(x[j] - x[i], y[j] - y[i]), area)
            lines[i, 0], lines[i, 1] = (y[i] - y[j]) / length, (x[j] - x[i]) / length
            lines[i, 2] = -(lines[i, 0] * x[i] + lines[i, 1] * y[i])
        for row in range(max(int(y.min()), 0), min(int(y.max()) + 1, n_rows)):
            for column in range(max(int(x.min()), 0), min(int(x.max()) + 1, n_columns)):
                for sample in range(n_samples * n_samples):
                    sx = column + (sample % n_samples + 0.5) * step
                    sy = row + (sample // n_samples + 0.5) * step
                    nearest = np.inf
                    for i in range(3):
                        nearest = min(nearest, lines[i, 0] * sx + lines[i, 1] * sy + lines[i, 2])
                    if nearest < 0.0:
                        continue
                    light = edge_light if nearest < half_edge else 1.0
                    for channel in range(3):
                        sums[row, column, channel] += light * colors[face, channel]
                    sums[row, column, 3] += 1.0


@kernel
def _outline_kernel(ends, radius, n_samples, masks):  # type: ignore[no-untyped-def]
    """Set the bit of each sample that lies within `radius` of a line from end to end."""
    n_rows, n_columns = masks.shape
    for i in range(len(ends)):
        x0, y0, x1, y1 = ends[i, 0, 0], ends[i, 0, 1], ends[i, 1, 0], ends[i, 1, 1]
        dx, dy = x1 - x0, y1 - y0
        square = max(dx * dx + dy * dy, 1e-300)  # a point is a line as well
        top, bottom = min(y0, y1) - radius, max(y0, y1) + radius
        left, right = min(x0, x1) - radius, max(x0, x1) + radius
        for row in range(max(int(top), 0), min(int(bottom) + 1, n_rows)):
            for column in range(max(int(left), 0), min(int(right) + 1, n_columns)):
                for sample in range(n_samples * n_samples):
                    sx = column + (sample % n_samples + 0.5) / n_samples - x0
                    sy = row + (sample // n_samples + 0.5) / n_samples - y0
                    t = min(max((sx * dx + sy * dy) / square, 0.0), 1.0)
                    if math.hypot(sx - t * dx, sy - t * dy) <= radius:
                        masks[row, column] |= np.uint16(1 << sample)
