"""Pockets: hidden regions behind a narrow mouth, such as the inside of a mouth or of an eye socket.

Laid flat with the surface around it, a pocket would need a cut from its mouth across what everyone
sees. A loop in its mouth, out of the light, makes it a chart of its own instead.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mapping.atlas.cutting.parts import connected_parts
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.mesh.topology import next_half_edges

_DARK = 0.3  # openness below which a region is hidden
# Longest mouth, in sides of a square as large as the pocket: 2.5 is that of a hemisphere, and 2
# that of a tube that is as deep as wide.
_MOUTH = 2.0
_LEAST_SHARE = 0.003  # of the area of the surface
_MOST_SHARE = 0.5  # of the connected part that a pocket is in
_BAND = 0.1  # width of the band in which mouths become short, in rings of faces per edge


def find_pockets(surface: ChartSurface, weights: FloatArray) -> IntArray:
    """(F,) int32: number of the pocket of each face, from 1; 0 for none.

    `weights` (F, 3): costs of seams along edges.
    """
    corners, solid, opposite = surface.joints
    polygons = np.arange(len(corners)) if surface.polygons is None else surface.polygons
    _, firsts, numbers = np.unique(polygons, return_index=True, return_inverse=True)
    pockets = np.zeros(len(corners), dtype=np.int32)
    if not solid.any():
        return pockets
    is_dark = solid & (surface.openness[corners].mean(axis=1) < _DARK)[firsts][numbers]
    if not is_dark.any():
        return pockets
    areas = surface_areas(surface.points[corners])
    steps = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
    lengths = pm.norm(steps.reshape(-1, 3), axis=1)
    dark = np.repeat(is_dark, 3)
    within = dark & dark[opposite] & (opposite >= 0)
    regions = connected_parts(np.where(within, opposite, np.int32(-1)))
    sizes = np.bincount(regions, areas * is_dark)
    is_mouth = dark & (opposite >= 0) & ~dark[opposite]
    mouths = np.bincount(regions, (lengths * is_mouth).reshape(-1, 3).sum(axis=1))
    parts = connected_parts(opposite)
    wholes = np.bincount(parts, areas)[parts]
    fits = (sizes >= _LEAST_SHARE * float(areas.sum())) & (mouths > 0.0)
    fits &= mouths <= _MOUTH * np.sqrt(sizes)
    is_in = is_dark & fits[regions] & (sizes[regions] <= _MOST_SHARE * wholes)
    if is_in.any():
        pockets[is_in] = np.unique(regions[is_in], return_inverse=True)[1] + 1
        core.straighten_borders(surface.points, corners, opposite, weights, _BAND, pockets)
    return pockets[firsts][numbers]


def close_mouths(
    points: FloatArray, opposite: IntArray, weights: FloatArray, is_mouth: BoolArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Points, `opposite` and weights of faces, and of a fan in each loop of `is_mouth` half-edges.

    No seam runs through a fan. As in `flatten_body`; `is_mouth` (3 m,). Loops that also follow the
    border of the surface stay open.
    """
    border = np.flatnonzero(opposite < 0).astype(np.int32)
    inner = np.flatnonzero(opposite >= 0).astype(np.int32)
    heads = next_half_edges(opposite[inner]).astype(np.int32)
    fans = merged_labels(len(opposite), inner, heads)
    tails, heads = fans[border], fans[next_half_edges(border)]
    loops = merged_labels(len(opposite), tails, heads)[tails]
    is_open = np.bincount(loops, ~is_mouth[border], minlength=len(opposite))[loops] > 0.0
    border, tails, heads, loops = (each[~is_open] for each in (border, tails, heads, loops))
    n = len(border)
    if not n or len(np.unique(tails)) < n:  # loops that touch themselves
        return points, opposite, weights
    after = np.empty(len(opposite), dtype=np.int32)
    after[tails] = np.arange(n, dtype=np.int32)
    starts, ends = (points.reshape(-1, 3)[each] for each in (border, next_half_edges(border)))
    counts = np.bincount(loops)[loops]
    sums = [np.bincount(loops, starts[:, axis])[loops] / counts for axis in range(3)]
    fan = np.stack([ends, starts, np.stack(sums, axis=1)], axis=1)
    # Of face k: from the head to the tail of border k, to the center, and back to the head.
    own = len(opposite) + 3 * np.arange(n, dtype=np.int32)
    across = np.empty((n, 3), dtype=np.int32)
    across[:, 0] = border
    across[:, 2] = own[after[heads]] + 1
    across[after[heads], 1] = own + 2
    opposite = opposite.copy()
    opposite[border] = own
    costs = np.full((n, 3), np.inf)
    costs[:, 0] = weights[border]
    return (
        np.concatenate([points, fan]),
        np.concatenate([opposite, across.ravel()]),
        np.concatenate([weights, costs.ravel()]),
    )
