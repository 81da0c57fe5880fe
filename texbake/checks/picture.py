"""A picture of where in the texture the findings are.

Each finding gets a pale UV layout with its faces colored.

Faces too small to be seen get a dot, and the worst ones a ring.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from texbake.baking.texels import NO_FACE, SampleGrid, rasterize_uv, snap_uvs
from texbake.checks.checked_mesh import N_WORST, Finding
from texbake.core import portable_math as pm
from texbake.errors import UvError
from texbake.mapping.layout import BACKGROUND, INK, LayoutWindow, linear, text_coverage
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh

if TYPE_CHECKING:
    from texbake.checks.check import CheckReport


# sRGB-encoded: red, amber, blue.
COLORS = {"error": (0.85, 0.10, 0.12), "warning": (0.90, 0.55, 0.00), "note": (0.15, 0.40, 0.85)}
_SAMPLES = 2  # along each side of a pixel

# Grays, sRGB-encoded: the inside of charts, edges of triangles, outlines of charts.
_FILL, _EDGE, _OUTLINE = 0.90, 0.86, 0.55
_DOT_PX = 2.0  # faces with less area than a square of this side get a dot
_RING_PX = (9.0, 1.3)  # radius and half the width of a ring
_FRAME_DARKNESS = 0.3
_COLUMNS = 3


def draw_findings(report: CheckReport, size: int) -> Float32Array:
    """Draw findings in the texture of the low-poly mesh; see `CheckReport.picture`."""
    mesh = report.low
    if mesh is None or not report.has_layout:
        raise UvError(
            "check: no low-poly mesh has texture coordinates near the tile that could be drawn; "
            "make some with: texbake unwrap"
        )
    window = LayoutWindow.around(mesh.corner_uvs(), _shape(report, size))
    owners = _pixel_owners(mesh, window, report.options.threads)
    base = _pale_layout(owners, chart_ids(mesh))
    pixels = window.pixels(mesh.corner_uvs())
    shown = [f for f in report.findings if f.mesh == "low" and len(f.faces)]
    if not shown:
        return _captioned(base, "nothing to show in the texture", INK)
    panels = [
        _captioned(
            _panel(base, finding, owners, pixels),
            f"{finding.counted}: {finding.kind.title}",
            COLORS[finding.severity],
        )
        for finding in shown
    ]
    return tiled(panels)


def tiled(panels: list[Float32Array]) -> Float32Array:
    """Arrange pictures of equal size in rows and columns on a white background."""
    columns = min(_COLUMNS, len(panels))
    n_rows = math.ceil(len(panels) / columns)
    height, width = panels[0].shape[:2]
    gap = max(4, width // 40)
    sheet = np.empty((n_rows * (height + gap) + gap, columns * (width + gap) + gap, 3), np.float32)
    sheet[:] = linear(BACKGROUND)
    for i, panel in enumerate(panels):
        top, left = gap + i // columns * (height + gap), gap + i % columns * (width + gap)
        sheet[top : top + height, left : left + width] = panel
    return sheet


def ring(picture: Float32Array, x: float, y: float, color: FloatArray) -> None:
    """Draw a ring about a point, in pixels from the upper left corner, clipped to the picture."""
    radius, half = _RING_PX
    extent = int(radius + half) + 2
    height, width = picture.shape[:2]
    rows = slice(max(int(y) - extent, 0), max(min(int(y) + extent + 1, height), 0))
    columns = slice(max(int(x) - extent, 0), max(min(int(x) + extent + 1, width), 0))
    part = picture[rows, columns]
    if part.size == 0:
        return
    ys, xs = np.mgrid[rows, columns] + 0.5
    distances = np.abs(pm.hypot(xs - x, ys - y) - radius)
    ink = np.clip(half + 0.5 - distances, 0.0, 1.0)[:, :, None].astype(np.float32)
    part += ink * (color.astype(np.float32) - part)


def _shape(report: CheckReport, size: int) -> tuple[int, int]:
    """Width and height of a picture of one tile, in the proportions of the texture."""
    width, height = report.options.width_px, report.options.height_px
    longer = max(width, height)
    return max(1, round(size * width / longer)), max(1, round(size * height / longer))


def _pale_layout(owners: IntArray, charts: IntArray) -> Float32Array:
    """Draw gray charts, with their outlines and faint triangles, from the owners of samples."""
    chart_of = np.where(owners == NO_FACE, NO_FACE, charts[owners])
    shades = np.where(owners == NO_FACE, BACKGROUND[0], _FILL)
    for ids, shade in ((owners, _EDGE), (chart_of, _OUTLINE)):
        shades[:, 1:][ids[:, 1:] != ids[:, :-1]] = shade
        shades[1:][ids[1:] != ids[:-1]] = shade
    height, width = (length // _SAMPLES for length in owners.shape)
    samples = linear(shades).reshape(height, _SAMPLES, width, _SAMPLES)
    gray = samples.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return np.repeat(gray[:, :, None], 3, axis=2)


def _pixel_owners(mesh: Mesh, window: LayoutWindow, threads: int | None) -> IntArray:
    """Face at each sample of the picture's pixels, `NO_FACE` for none."""
    assert mesh.uvs is not None
    low, high = np.array(window.low), np.array(window.high)
    grid = SampleGrid(window.width, window.height, _SAMPLES)
    try:
        faces = snap_uvs(mesh.replace(uvs=(mesh.uvs - low) / (high - low)), grid)
    except UvError:  # no face has an area: dots are enough
        return np.full((grid.n_rows, grid.n_columns), NO_FACE, dtype=np.int32)
    return rasterize_uv(faces, grid, threads=threads)[0]


def _panel(
    base: Float32Array, finding: Finding, owners: IntArray, pixels: FloatArray
) -> Float32Array:
    """Draw the faces of one finding over the layout."""
    height, width = base.shape[:2]
    flagged = np.zeros(len(pixels) + 1, dtype=np.float32)  # NO_FACE is -1, and so the last entry
    flagged[finding.faces] = 1.0
    coverage = flagged[owners].reshape(height, _SAMPLES, width, _SAMPLES).mean(axis=(1, 3))
    corners = pixels[finding.faces]
    # Clipped far outside of any picture, so that no integer overflows.
    middles = np.clip(corners.mean(axis=1), -1e6, 1e6)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0
    small = areas < _DOT_PX**2
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            columns, rows = np.floor(middles[small] + (dx, dy)).astype(int).T
            there = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
            coverage[rows[there], columns[there]] = 1.0
    color = linear(COLORS[finding.severity])
    picture: Float32Array = base + coverage[:, :, None] * (color.astype(np.float32) - base)
    for x, y in middles[:N_WORST].tolist():
        ring(picture, x, y, linear(INK))
    for side in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        side *= 1.0 - _FRAME_DARKNESS
    return picture


def _captioned(
    picture: Float32Array, caption: str, color: tuple[float, float, float]
) -> Float32Array:
    """Put a line of text above a picture."""
    height, width = picture.shape[:2]
    size = max(11, min(width // 26, 28))
    ink = text_coverage(caption, size)
    while ink.shape[1] > width and size > 8:
        size -= 1
        ink = text_coverage(caption, size)
    line = max(11, min(width // 26, 28)) * 2
    sheet = np.empty((height + line, width, 3), np.float32)
    sheet[:line] = linear(BACKGROUND)
    sheet[line:] = picture
    top = (line - len(ink)) // 2
    ink = ink[:, :width, None]
    part = sheet[top : top + len(ink), : ink.shape[1]]
    part += ink * (linear(color).astype(np.float32) - part)
    return sheet
