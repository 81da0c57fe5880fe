"""Texture coordinates as SVG: the picture of `draw_layout`, to paint over in other programs.

Faces of one color become one outline, connected lines become one stroke, and coordinates are whole
numbers stored as differences, so that 100,000 triangles take one or two megabytes. The drawing has
layers that can be hidden: `charts`, `mirrored`, `edges`, `outlines`, `seams`, `tiles` and `scale`.

Based on: Scalable Vector Graphics (SVG) 1.1 (Second Edition), W3C, 2011.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from html import escape
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.mapping.areas import measurable_uvs, signed_areas
from texbake.mapping.layout_view import (
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
from texbake.mesh.mesh import Mesh
from texbake.mesh.weld import weld_rows

Points = npt.NDArray[np.int64]
Ids = npt.NDArray[np.integer[Any]]

# Units per pixel: whole numbers of these are fine enough to zoom in.
_UNITS = 32
_FARTHEST_PX = 1e9
_BAR_STEPS = 16
_FAINTEST = 0.03  # edges below this darkness would be invisible and are left out


def layout_svg(mesh: MeshLike, size: int | tuple[int, int] = 1024, *, heat: bool = False) -> str:
    """Draw the texture coordinates of a mesh as an SVG document.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    size : int or (int, int)
        Width and height at which one tile is shown, as for `draw_layout`.
    heat
        Color faces by L2 stretch, as `draw_layout` does. Otherwise each chart is a path of its own,
        with the id `chart-` and its number in `chart_ids`.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or some are too far out to be measured.
    """
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


def _filled(mesh: Mesh, points: Points, size: int | tuple[int, int], heat: bool) -> Iterator[str]:
    """Layers of filled faces: by chart or by color of the heat map, and mirrored faces."""
    charts = chart_ids(mesh)
    colors = np.rint(face_colors(mesh, charts, size, heat) * 255.0).astype(np.int64)
    mirrored = signed_areas(mesh.corner_uvs()) < 0.0
    groups: Ids = charts
    if heat:
        groups = weld_rows(colors.astype(np.int32))
    upright = np.flatnonzero(~mirrored)
    _, firsts, numbers = np.unique(groups[upright], return_index=True, return_inverse=True)
    paths = []
    ends, outlines = _outlines(points[upright], numbers)
    for first, loops in zip(firsts, outlines, strict=True):
        face = upright[first]
        color = _hex(colors[face] / 255.0)
        # A stroke of the same color covers the hairlines that renderers leave between neighbors.
        look = f'stroke="{color}"' if heat else f'id="chart-{charts[face]}"'
        paths.append(f'<path {look} fill="{color}" d="{_data(loops, ends, "z")}"/>\n')
    yield _layer("charts", paths, f'stroke-width="{_UNITS // 2}"' if heat else "")
    if mirrored.any():
        ends, (loops,) = _outlines(points[mirrored], np.zeros(int(mirrored.sum()), dtype=np.int64))
        data = _data(loops, ends, "z")
        yield _layer("mirrored", [f'<path fill="{_hex(MIRRORED)}" d="{data}"/>\n'])


def _outlines(points: Points, groups: Ids) -> tuple[_Ends, list[list[list[int]]]]:
    """Loops around the area that the faces of each group cover, by the nonzero rule.

    Faces of a group have the same orientation. An edge that two of them run along in opposite
    directions lies inside; the remaining edges form the loops.
    """
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
    loops: list[list[list[int]]] = [[] for _ in range(int(groups.max(initial=-1)) + 1)]
    for walk in _walks(
        numbers + np.where(along, tails[edges], heads[edges]),
        numbers + np.where(along, heads[edges], tails[edges]),
        directed=True,
    ):
        group = walk[0] // len(ids)
        before = group * len(ids)
        loops[group].append([number - before for number in walk])
    return _Ends.of(ids), loops


def _strokes(name: str, ends: Points, width: float, darkness: float) -> str:
    """Layer of lines between pairs of points, each drawn once."""
    ids, tails, heads = _ends(ends)
    keys = np.unique(np.minimum(tails, heads) * len(ids) + np.maximum(tails, heads))
    lows, highs = np.divmod(keys, max(len(ids), 1))
    apart = lows != highs
    walks = _walks(lows[apart], highs[apart], directed=False)
    data = _data(walks, _Ends.of(ids), "")
    look = (
        f'fill="none" stroke="{_hex(INK)}" stroke-opacity="{darkness:.2g}" '
        f'stroke-width="{width * _UNITS:.3g}" stroke-linejoin="round" stroke-linecap="round"'
    )
    return _layer(name, [f'<path d="{data}"/>\n'] if data else [], look)


def _ends(ends: Points) -> tuple[Points, Points, Points]:
    """Distinct points, and the numbers of those where each line starts and ends."""
    flat = ends.reshape(-1, 2)
    firsts = weld_rows(flat.astype(np.int32))
    is_first = firsts == np.arange(len(firsts))
    numbers = (np.cumsum(is_first) - 1)[firsts]
    return flat[is_first], numbers[0::2], numbers[1::2]


def _walks(tails: Points, heads: Points, *, directed: bool) -> Iterator[list[int]]:
    """Walks that together cover each line once, built greedily.

    Directed lines form closed loops if as many lead to each point as away from it.
    """
    lines = np.arange(len(tails))
    froms = tails if directed else np.concatenate([tails, heads])
    tos = heads if directed else np.concatenate([heads, tails])
    lines = lines if directed else np.concatenate([lines, lines])
    places, numbers = np.unique(froms, return_inverse=True)
    order = np.argsort(numbers, kind="stable")
    counts = np.bincount(numbers)
    stops = np.cumsum(counts).tolist()
    nexts = [0, *stops[:-1]]
    # Where an odd number of lines meet, a walk has to start or end.
    starts = np.argsort(counts % 2 == 0, kind="stable").tolist()
    number_of = dict(zip(places.tolist(), range(len(places)), strict=True))
    leads_to, line_of = tos[order].tolist(), lines[order].tolist()
    used = bytearray(len(tails))
    for start in starts:
        while True:
            at: int | None = start
            walk = [int(places[start])]
            while at is not None:
                while nexts[at] < stops[at] and used[line_of[nexts[at]]]:
                    nexts[at] += 1
                if nexts[at] == stops[at]:
                    break
                slot = nexts[at]
                used[line_of[slot]] = 1
                walk.append(leads_to[slot])
                at = number_of.get(leads_to[slot])
            if len(walk) == 1:
                break
            yield walk


class _Ends(NamedTuple):
    """Coordinates of points by their numbers; most walks are too short for arrays."""

    xs: list[int]
    ys: list[int]

    @classmethod
    def of(cls, points: Points) -> _Ends:
        return cls(points[:, 0].tolist(), points[:, 1].tolist())


def _data(walks: Iterable[list[int]], points: _Ends, end: str) -> str:
    """Path data of walks through points; "z" for `end` closes each of them."""
    xs, ys = points
    parts = []
    for walk in walks:
        x, y = xs[walk[0]], ys[walk[0]]
        parts.append(f"M{x} {y}l")
        steps = []
        for at in walk[1:-1] if end else walk[1:]:  # "z" draws the last step
            steps.append(f"{xs[at] - x} {ys[at] - y}")
            x, y = xs[at], ys[at]
        parts.append(" ".join(steps).replace(" -", "-") + end)
    return "".join(parts)


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
        f'stop-color="{_hex(heat_color(HEAT_RANGE ** (2.0 * share - 1.0)))}"/>'
        for share in shares
    )
    yield f'<linearGradient id="stretch">{stops}</linearGradient>\n'
    x, y, width, height = (
        round(value * _UNITS) for value in (left, top + size / 2.0, right - left, size)
    )
    yield f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="url(#stretch)"/>\n'
    for stretch, label in HEAT_TICKS:
        share = (math.log(stretch, HEAT_RANGE) + 1.0) / 2.0
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
