"""The page of a layout, which `unwrap` writes as its `html` file: the texture beside the mesh.

Both show charts, a checker or stretch as heat, with the seams on top. Pointing at a chart, in
either of them or in the table, shows it in all three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import UvError
from texbake.files import PathLike
from texbake.mapping.corner_uvs import selected
from texbake.mapping.distortion import ChartDistortion, distortion
from texbake.mapping.layout import HEAT_RANGE, HEAT_TICKS, face_colors, heat_color
from texbake.mapping.overlap import StackedIslands
from texbake.mapping.seams import chart_ids, seam_edges
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.pages.page import as_json, asset, page_html, render, write_page
from texbake.pages.pictures import data_uri, picture_codes
from texbake.pages.viewer import pack, packed_mesh, shown_mesh, view_settings
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render as render_mesh
from texbake.texture.image_files import encode_image

_MOST_ROWS = 200  # of the table: the largest charts
_CELLS = 16  # of the checker, along the longer side of a tile
_LEGEND_STEPS = 16


def write_layout_page(
    path: PathLike,
    mesh: MeshLike,
    size: int | tuple[int, int] = 1024,
    *,
    figures: Sequence[tuple[str, str]] = (),
    shares: bool = False,
    up: str = RenderOptions.up,
) -> None:
    """Write the page of a mesh's texture coordinates, a single file that works offline.

    With `shares`, mirrored halves share texels on purpose: both make one chart.
    """
    mesh = as_mesh(mesh)
    sides = (size, size) if isinstance(size, int) else size
    shown = shown_mesh(mesh, keeps_uvs=True)
    charts, stacked = _charts(shown, shares)
    options = RenderOptions(width=480, height=480, exposure="auto", up=up)
    settings = view_settings((mesh,), [], options) | {
        "sides": list(sides),
        "cells": _CELLS,
        "low": np.floor(shown.corner_uvs().min(axis=(0, 1))).tolist(),
        "high": np.ceil(shown.corner_uvs().max(axis=(0, 1))).tolist(),
    }
    rows = _rows(shown, charts, stacked, sides)
    still = encode_image(picture_codes(render_mesh(shown, options=options).color), "jpeg")
    data = {
        "mesh-low": packed_mesh(shown, LocalFrame.around(mesh)),
        "view-settings": as_json(settings),
        "layout-faces": pack(
            {
                "chart": charts[:, None],
                "colors": _codes(face_colors(shown, charts, sides, False, stacked)),
                "heat": _codes(face_colors(shown, charts, sides, heat=True)),
                "seams": (seam_edges(shown) * np.array([[1, 2, 4]], np.int32)).sum(
                    axis=1, keepdims=True, dtype=np.int32
                ),
            },
            {},
        ),
    }
    body = render(
        "layout.html",
        mesh=mesh,
        shown=shown,
        n_charts=len(np.unique(charts)),
        rows=rows[:_MOST_ROWS],
        n_rows=len(rows),
        figures=figures,
        total=sum(row.area for row in rows),
        still=data_uri(still, "image/jpeg"),
        colors=_legend(),
        ticks=[label for _, label in HEAT_TICKS],
    )
    html = page_html(
        f"{mesh.name}: layout",
        body,
        styles=[asset("controls.css"), asset("asset.css"), asset("layout.css")],
        scripts=[asset("three.min.js"), asset("page.js"), asset("layout.js")],
        data=data,
    )
    write_page(path, html)


def _charts(mesh: Mesh, shares: bool) -> tuple[IntArray, BoolArray]:
    """(F,) charts, one for both halves if these share texels; (F,) mirrored faces on others."""
    charts = chart_ids(mesh)
    if not shares:
        return charts, np.zeros(mesh.n_faces, dtype=np.bool_)
    found = StackedIslands.of(mesh)
    mirrored = found.mirrored(mesh)
    of_stack = np.zeros_like(charts)
    of_stack[found.stacks[~mirrored]] = charts[~mirrored]
    return of_stack[found.stacks], mirrored


def _rows(
    mesh: Mesh, charts: IntArray, stacked: BoolArray, sides: tuple[int, int]
) -> list[ChartDistortion]:
    """Figures of charts without `stacked` faces, the largest first; none if no face has an area."""
    mesh, charts = selected(mesh, ~stacked), charts[~stacked]
    try:
        measured = distortion(mesh, sides)
    except UvError:
        return []
    firsts = np.unique(chart_ids(mesh), return_index=True)[1]
    rows = [replace(row, chart=int(charts[firsts[row.chart]])) for row in measured.charts]
    return sorted(rows, key=lambda row: -row.area)


def _codes(colors: FloatArray) -> IntArray:
    """(F, 1) int32: sRGB colors (F, 3) as 24-bit numbers."""
    levels = np.rint(colors * 255.0).astype(np.int32)
    return np.asarray((levels << np.array([16, 8, 0])).sum(axis=1, keepdims=True), np.int32)


def _legend() -> list[str]:
    """CSS colors of the stretch, from the least to the greatest in even steps of its logarithm."""
    shares = [step / _LEGEND_STEPS for step in range(_LEGEND_STEPS + 1)]
    colors = [heat_color(pm.power(HEAT_RANGE, 2.0 * share - 1.0)) for share in shares]
    return ["#" + "".join(f"{round(255.0 * channel):02x}" for channel in color) for color in colors]
