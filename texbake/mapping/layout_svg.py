"""Texture coordinates as SVG: the picture of `draw_layout`, to paint over in other programs.

Faces of one color become one outline, connected lines become one stroke, and coordinates are whole
numbers stored as differences, so that 100,000 triangles take one or two megabytes. The drawing has
layers that can be hidden: `charts`, `mirrored`, `edges`, `outlines`, `seams`, `tiles` and `scale`.

Based on: Scalable Vector Graphics (SVG) 1.1 (Second Edition), W3C, 2011.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas
from texbake.mapping.layout import (
    BACKGROUND,
    EDGE_PX,
    HEAT_RANGE,
    HEAT_TICKS,
    HEAT_WORDS,
    INK,
    MIRRORED,
    OUTLINE_DARKNESS,
    OUTLINE_PX,
    SEAM_DARKNESS,
    LayoutWindow,
    edge_darkness,
    face_colors,
    heat_color,
    legend_size,
)
from texbake.mapping.seams import border_edges, chart_ids, seam_edges
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Int64Array, Mesh
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

Ids = npt.NDArray[np.integer[Any]]

# Units per pixel: whole numbers of these are fine enough to zoom in.
_UNITS = 32
_FARTHEST_PX = 6e7  # fits into an int32 in units
_BAR_STEPS = 16
_FAINTEST = 0.03  # edges below this darkness would be invisible and are left out


def layout_svg(mesh: MeshLike, size: int | tuple[int, int] = 1024, *, heat: bool = False) -> str:
    """Draw the texture coordinates of a mesh as an SVG document."""
    mesh = as_mesh(mesh)
    uvs = measurable_uvs(mesh)
    window = LayoutWindow.around(uvs, size)
    # Faces without area may lie far outside the window.
    pixels = np.clip(window.pixels(uvs), -_FARTHEST_PX, _FARTHEST_PX)
    points = np.rint(pixels * _UNITS).astype(np.int64)
    ends = np.stack([points, np.roll(points, -1, axis=1)], axis=2)
    borders, seams = border_edges(mesh), seam_edges(mesh)
    height, parts = window.height, list(_filled(mesh, points, size, heat))
    darkness = edge_darkness(pixels)
    if darkness >= _FAINTEST:
        parts.append(_strokes("edges", ends[~borders], EDGE_PX, darkness))
    parts.append(_strokes("outlines", ends[borders & ~seams], OUTLINE_PX, OUTLINE_DARKNESS))
    parts.append(_strokes("seams", ends[seams], OUTLINE_PX, SEAM_DARKNESS))
    parts.append(_layer("tiles", _tiles(window)))
    if heat:
        parts.append(_layer("scale", _scale(window)))
        height += 3 * legend_size(window.width)
    title = escape("".join(filter(str.isprintable, mesh.name)), quote=False)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{window.width}" height="{height}" '
        f'viewBox="0 0 {window.width * _UNITS} {height * _UNITS}">\n<title>{title}</title>\n'
        f'<rect width="100%" height="100%" fill="{_hex(BACKGROUND)}"/>\n'
    )
    return head + "".join(parts) + "</svg>\n"


def _filled(
    mesh: Mesh, points: Int64Array, size: int | tuple[int, int], heat: bool
) -> Iterator[str]:
    """Layers of filled faces: by color of the heat map, or by chart and mirrored faces."""
    charts = chart_ids(mesh)
    levels = np.rint(face_colors(mesh, charts, size, heat) * 255.0).astype(np.int64)
    colors = (levels << np.array([16, 8, 0])).sum(axis=1)
    mirrored = signed_areas(mesh.corner_uvs()) < 0.0
    groups: Ids = charts
    if heat:  # mirrored faces in paths of their own, for their edges would cancel those of others
        groups = weld_rows(np.stack([colors, mirrored], axis=1).astype(np.int32))
        mirrored = np.zeros_like(mirrored)
    upright = np.flatnonzero(~mirrored)
    _, firsts, numbers = np.unique(groups[upright], return_index=True, return_inverse=True)
    faces = upright[firsts]
    paths = []
    outlines = _outlines(points[upright], numbers)
    for data, color, chart in zip(
        outlines, colors[faces].tolist(), charts[faces].tolist(), strict=True
    ):
        # A stroke of the same color covers the hairlines that renderers leave between neighbors.
        look = f'stroke="#{color:06x}"' if heat else f'id="chart-{chart}"'
        paths.append(f'<path {look} fill="#{color:06x}" d="{data}"/>\n')
    yield _layer("charts", paths, f'stroke-width="{_UNITS // 2}"' if heat else "")
    if mirrored.any():
        (data,) = _outlines(points[mirrored], np.zeros(int(mirrored.sum()), dtype=np.int64))
        yield _layer("mirrored", [f'<path fill="{_hex(MIRRORED)}" d="{data}"/>\n'])


def _outlines(points: Int64Array, groups: Ids) -> Iterator[str]:
    """Path data of the loops around what the faces of each group cover, by the nonzero rule."""
    ids, tails, heads = _ends(np.stack([points, np.roll(points, -1, axis=1)], axis=2))
    owners = np.repeat(groups, 3)
    rows = np.column_stack([owners, np.minimum(tails, heads), np.maximum(tails, heads)])
    firsts = weld_rows(rows.astype(np.int32))
    turns = np.bincount(firsts, np.where(tails < heads, 1.0, -1.0)).astype(np.int64)
    edges = np.flatnonzero(turns)
    edges = np.repeat(edges, np.abs(turns[edges]))
    edges = edges[np.argsort(owners[edges], kind="stable")]
    along = (turns[edges] > 0) == (tails[edges] < heads[edges])
    # Numbered for each group apart, the loops of all groups are found together.
    numbers = owners[edges].astype(np.int64) * len(ids)
    loops = _Walks.along(
        numbers + np.where(along, tails[edges], heads[edges]),
        numbers + np.where(along, heads[edges], tails[edges]),
        directed=True,
    )
    of_loops, ends = np.divmod(loops.places, max(len(ids), 1))
    of_loops = of_loops[loops.starts]
    texts = loops.of_points(ids[ends], closed=True)
    order = np.argsort(of_loops, kind="stable")
    stops = np.searchsorted(of_loops[order], np.arange(groups.max(initial=-1) + 1), side="right")
    begin = 0
    for stop in stops.tolist():
        yield "".join([texts[loop] for loop in order[begin:stop].tolist()])
        begin = stop


def _strokes(name: str, ends: Int64Array, width: float, darkness: float) -> str:
    """Layer of lines between pairs of points, each drawn once."""
    ids, tails, heads = _ends(ends)
    keys = np.unique(np.minimum(tails, heads) * len(ids) + np.maximum(tails, heads))
    lows, highs = np.divmod(keys, max(len(ids), 1))
    apart = lows != highs
    walks = _Walks.along(lows[apart], highs[apart], directed=False)
    data = "".join(walks.of_points(ids[walks.places], closed=False))
    look = (
        f'fill="none" stroke="{_hex(INK)}" stroke-opacity="{darkness:.2g}" '
        f'stroke-width="{width * _UNITS:.3g}" stroke-linejoin="round" stroke-linecap="round"'
    )
    return _layer(name, [f'<path d="{data}"/>\n'] if data else [], look)


def _ends(ends: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Distinct points, and the numbers of those where each line starts and ends."""
    flat = ends.reshape(-1, 2)
    firsts = weld_rows(flat.astype(np.int32))
    is_first = firsts == np.arange(len(firsts))
    numbers = (np.cumsum(is_first) - 1)[firsts]
    return flat[is_first], numbers[0::2], numbers[1::2]


@dataclass(frozen=True, eq=False)
class _Walks:
    """Walks that together cover each of some lines once."""

    places: Int64Array  # (n,) int64; what the walks lead through, one walk after another
    ends: Int64Array  # (n_walks,) int64; where the places of each walk stop

    @classmethod
    def along(cls, tails: Int64Array, heads: Int64Array, *, directed: bool) -> _Walks:
        """Build walks greedily along lines between numbered places; directed ones form loops."""
        n = len(tails)
        places, numbers = np.unique(np.concatenate([tails, heads]), return_inverse=True)
        froms, tos = (numbers[:n], numbers[n:]) if directed else (numbers, np.roll(numbers, n))
        order = np.argsort(froms, kind="stable")
        counts = np.bincount(froms, minlength=len(places))
        stops = np.cumsum(counts)
        # Where an odd number of lines meet, a walk has to start or end.
        starts = np.argsort(counts % 2 == 0, kind="stable")
        walked = np.empty(2 * n, dtype=np.int64)
        ends = np.empty(n, dtype=np.int64)
        used = np.zeros(n, dtype=np.bool_)
        n_walks = core.find_walks(
            starts, stops - counts, stops, tos[order], order % max(n, 1), used, walked, ends
        )
        ends = ends[:n_walks].copy()
        return cls(places[walked[: ends[-1] if n_walks else 0]], ends)

    @property
    def starts(self) -> Int64Array:
        """(n_walks,) int64: where the places of each walk start."""
        return np.concatenate([[0], self.ends[:-1]])[: len(self.ends)]

    def of_points(self, points: Int64Array, *, closed: bool) -> list[str]:
        """Path data of each walk through points (n, 2) of its places; "z" closes `closed` ones."""
        stops = np.empty(len(self.ends), dtype=np.int64)
        n_bytes = core.write_walks(points, self.ends, closed, None, stops)
        text = np.empty(n_bytes, dtype=np.uint8)
        core.write_walks(points, self.ends, closed, text, stops)
        data = text.tobytes().decode("ascii")
        return [data[begin:stop] for begin, stop in itertools.pairwise([0, *stops.tolist()])]


def _tiles(window: LayoutWindow) -> Iterator[str]:
    """Border and name of each tile if there are several."""
    size = max(10.0, min(window.tile_side / 10.0, 48.0))
    for tile in window.tiles():
        corners = np.array([[tile.column, tile.row + 1.0], [tile.column + 1.0, tile.row]])
        (x, y), (right, bottom) = np.rint(window.pixels(corners) * _UNITS).astype(int).tolist()
        yield (
            f'<rect x="{x}" y="{y}" width="{right - x}" height="{bottom - y}" fill="none" '
            f'stroke="{_hex(INK)}" stroke-opacity="0.5" stroke-width="{_UNITS}"/>\n'
        )
        if window.tile_side > 4.0 * size:
            yield _text(tile.name, x / _UNITS + size / 3.0, bottom / _UNITS - size / 3.0, size)


def _scale(window: LayoutWindow) -> Iterator[str]:
    """Scale of stretch, as `draw_layout` puts it below the picture."""
    size, top = legend_size(window.width), window.height
    left, right = 7.0 * size, window.width - 7.0 * size
    if right - left < 12.0 * size:
        left, right = 1.0 * size, max(window.width - size, size + 1.0)
    shares = [step / _BAR_STEPS for step in range(_BAR_STEPS + 1)]
    stops = "".join(
        f'<stop offset="{share:g}" '
        f'stop-color="{_hex(heat_color(pm.power(HEAT_RANGE, 2.0 * share - 1.0)))}"/>'
        for share in shares
    )
    yield f'<linearGradient id="stretch">{stops}</linearGradient>\n'
    x, y, width, height = (
        round(value * _UNITS) for value in (left, top + size / 2.0, right - left, size)
    )
    yield f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="url(#stretch)"/>\n'
    for stretch, label in HEAT_TICKS:
        share = (pm.log(stretch) / pm.log(HEAT_RANGE) + 1.0) / 2.0
        x_px = left + share * (right - left)
        yield _text(label, x_px, top + 2.6 * size, size, anchor="middle")
    if left > 2.0 * size:
        yield _text(HEAT_WORDS[0], left - size / 2.0, top + 1.3 * size, size, anchor="end")
        yield _text(HEAT_WORDS[1], size / 2.0, top + 2.6 * size, size)
        yield _text(HEAT_WORDS[2], right + size / 2.0, top + 1.3 * size, size)


def _text(words: str, x_px: float, y_px: float, size_px: float, *, anchor: str = "start") -> str:
    x, y, size = (round(value * _UNITS) for value in (x_px, y_px, size_px))
    return (
        f'<text x="{x}" y="{y}" font-size="{size}" font-family="sans-serif" '
        f'text-anchor="{anchor}" fill="{_hex(INK)}">{escape(words, quote=False)}</text>\n'
    )


def _layer(name: str, elements: Iterable[str], look: str = "") -> str:
    inside = "".join(elements)
    return f'<g id="{name}"{look and " " + look}>\n{inside}</g>\n' if inside else ""


def _hex(color: Iterable[float]) -> str:
    return "#" + "".join(f"{round(255.0 * channel):02x}" for channel in color)
