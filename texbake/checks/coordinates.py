"""Checks of texture coordinates, at any size and at the size and padding of the bake.

Which face owns which texel is decided by the rasterizer of the bake, with one sample per texel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from texbake.baking.texels import NO_FACE, SampleGrid, rasterize_uv, snap_uvs
from texbake.checks.checked_mesh import CheckedMesh, Finding, Look
from texbake.core import portable_math as pm
from texbake.errors import UvError
from texbake.mapping.stretch import face_stretch
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, Int64Array, IntArray
from texbake.texture.padding import nearest_owner

# Rounding of float32 files, for coordinates on the border of the tile; the same as in a bake.
_ROUNDING = 1e-6


def outside_tile(checked: CheckedMesh) -> Finding | None:
    """Faces that are baked and extend outside the unit square; the farthest are the worst."""
    faces = np.flatnonzero(outside(checked))
    distances = np.abs(checked.uvs[faces] - 0.5).max(axis=(1, 2))
    return checked.finding("outside-tile", len(faces), faces, distances)


def overlapping_coordinates(checked: CheckedMesh) -> Finding | None:
    """Faces that share a part of the texture with another face; the largest are the worst."""
    overlaps = checked.overlaps
    n_unsure = int(overlaps.unsure.sum())
    unsure = ""
    if n_unsure:
        unsure = f" {n_unsure:,} more faces were not decided: too many others lie near them."
    flagged = overlaps.overlapping & ~checked.shares_texture
    return checked.flag("overlapping-coordinates", flagged, np.abs(checked.uv_areas), unsure=unsure)


def stacked_coordinates(checked: CheckedMesh) -> Finding | None:
    """Islands that share the texels of others, on which they lie exactly; the largest first."""
    stacked = checked.stacked
    faces = np.flatnonzero(stacked.shares)
    areas = np.abs(checked.uv_areas[faces])
    return checked.finding("stacked-coordinates", stacked.n_sharing, faces, areas)


def outside(checked: CheckedMesh) -> BoolArray:
    """(F,) bool: faces that extend outside the unit square, other than stacked islands."""
    beyond = (np.abs(checked.uvs - 0.5) > 0.5 + _ROUNDING).any(axis=(1, 2))
    return np.asarray(beyond & ~checked.stacked.stacked)


# Where a check only selects faces, the largest of them are the worst.
CHECKS: tuple[Look, ...] = (
    outside_tile,
    overlapping_coordinates,
    # Faces that share a part of the texture with other groups only.
    lambda mesh: mesh.flag("shared-coordinates", mesh.shares_texture, np.abs(mesh.uv_areas)),
    stacked_coordinates,
    # Faces that run clockwise in the texture.
    lambda mesh: mesh.flag(
        "mirrored-coordinates",
        (mesh.uv_areas < 0.0) & mesh.has_area & ~mesh.stacked.stacked,
        -mesh.uv_areas,
    ),
    # Faces with an area in space but none in the texture.
    lambda mesh: mesh.flag(
        "collapsed-coordinates", (mesh.uv_areas == 0.0) & mesh.has_area, mesh.areas
    ),
)

# Share of the mean density: a face with a quarter of the texels per unit looks blurred.
_LEAST_DENSITY = 0.25


def texel_owners(checked: CheckedMesh) -> IntArray:
    """(H, W) int32: face that owns each texel's center, `NO_FACE` for none."""
    options = checked.options
    grid = SampleGrid(options.width_px, options.height_px, 1)
    try:
        faces = snap_uvs(checked.baked, grid)
    except UvError:  # no face covers anything
        return np.full((options.height_px, options.width_px), NO_FACE, dtype=np.int32)
    return rasterize_uv(faces, grid, threads=options.threads)[0]


def thin_charts(checked: CheckedMesh) -> Finding | None:
    """Charts thinner than the padding, by area and perimeter; the thinnest are the worst."""
    padding = checked.options.padding
    widths = chart_widths(checked)
    thin = np.isfinite(widths) & (widths < padding)
    faces = np.flatnonzero(thin[checked.charts])
    return checked.finding(
        "thin-charts",
        thin.sum(),
        faces,
        -widths[checked.charts[faces]],
        padding=padding,
        least=widths[thin].min(initial=np.inf),
    )


def chart_widths(checked: CheckedMesh) -> FloatArray:
    """(n_charts,) float64: widths in texels; NaN for a chart without area."""
    options, charts = checked.options, checked.charts
    n_charts = int(charts.max()) + 1
    sides = np.array([options.width_px, options.height_px], dtype=np.float64)
    areas = np.bincount(charts, np.abs(checked.uv_areas), n_charts) * sides.prod()
    used_once = np.bincount(checked.texture_edges.ravel())[checked.texture_edges] == 1
    steps = (np.roll(checked.uvs, -1, axis=1) - checked.uvs) * sides
    lengths = np.where(used_once, pm.hypot(steps[..., 0], steps[..., 1]), 0.0).sum(axis=1)
    outlines = np.bincount(charts, lengths, n_charts)
    # w l = area, 2 (w + l) = outline; what is rounder than a square counts as one.
    roots = np.sqrt(np.maximum(outlines**2 - 16.0 * areas, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        widths = 4.0 * areas / (outlines + roots)  # the lesser root, without cancellation
    return np.where(areas > 0.0, widths, np.nan)


def close_charts(checked: CheckedMesh, owners: IntArray) -> Finding | None:
    """Pairs of charts whose padding meets, and the faces where it does."""
    padding, threads = checked.options.padding, checked.options.threads
    covered = owners != NO_FACE
    chart_of = np.where(covered, checked.charts[owners], -1).astype(np.int32)
    nearest = nearest_owner(chart_of, padding, threads=threads)
    pairs = [_meeting(nearest.indices, chart_of, padding, axis) for axis in (0, 1)]
    texels = np.concatenate(pairs, axis=1)
    # Overlapping faces are reported as that.
    overlapping = checked.overlaps.overlapping[owners.ravel()[texels]]
    texels = texels[:, ~overlapping.all(axis=0)]
    groups = checked.mesh.face_groups
    if groups is not None and checked.shares_texture.any():  # each group has a texture of its own
        of_ends = groups[owners.ravel()[texels]]
        texels = texels[:, of_ends[0] == of_ends[1]]
    between = np.sort(chart_of.ravel()[texels], axis=0)
    n_pairs = len(np.unique(between[0].astype(np.int64) << 32 | between[1]))
    faces, counts = np.unique(owners.ravel()[texels], return_counts=True)
    return checked.finding(
        "close-charts", n_pairs, faces, counts, texels=nearest.n_meeting, padding=padding
    )


def _meeting(indices: IntArray, chart_of: IntArray, padding: int, axis: int) -> Int64Array:
    """(2, n): owners of neighboring texels along an axis that differ, both within the padding."""
    width = chart_of.shape[1]
    first = indices[:-1] if axis == 0 else indices[:, :-1]
    second = indices[1:] if axis == 0 else indices[:, 1:]
    flat = chart_of.ravel()
    rows, columns = np.nonzero((first >= 0) & (second >= 0) & (flat[first] != flat[second]))
    owners = np.stack([first[rows, columns], second[rows, columns]]).astype(np.int64)
    next_rows, next_columns = rows + (axis == 0), columns + (axis == 1)

    def near(owner: AnyArray, row: AnyArray, column: AnyArray) -> Any:
        return (owner // width - row) ** 2 + (owner % width - column) ** 2 <= padding**2

    meets = near(owners[1], rows, columns) | near(owners[0], next_rows, next_columns)
    return np.asarray(owners[:, meets])


def faces_without_texel(checked: CheckedMesh, owners: IntArray) -> Finding | None:
    """Faces that own no texel only because of their size."""
    seen = np.zeros(checked.mesh.n_faces + 1, dtype=bool)
    seen[owners] = True  # NO_FACE is -1, and so the last entry
    excused = outside(checked) | checked.overlaps.overlapping | (checked.uv_areas == 0.0)
    excused |= checked.stacked.shares
    return checked.flag("faces-without-texel", ~seen[:-1] & ~excused, checked.areas)


def low_texel_density(checked: CheckedMesh) -> Finding | None:
    """Faces with few texels per model unit along their most stretched direction."""
    options = checked.options
    try:
        stretch = face_stretch(checked.mesh.replace(positions=checked.positions), options.size)
    except UvError:  # there is nothing to measure
        return None
    texels = float(np.abs(stretch.texel_areas).sum())
    mean = math.sqrt(texels / float(stretch.areas.sum())) * checked.scale
    densities = mean / stretch.greatest
    least = options.min_texel_density or _LEAST_DENSITY * mean
    low = densities < least
    return checked.finding(
        "low-texel-density",
        low.sum(),
        stretch.faces[low],
        -densities[low],
        least=densities.min(),
        mean=mean,
    )


def texel_findings(checked: CheckedMesh, owners: IntArray) -> list[Finding | None]:
    """All findings at the size of the texture, or only that nothing is covered."""
    if (owners == NO_FACE).all():  # there is nothing to bake to
        return [checked.finding("nothing-covered", 1)]
    return [
        thin_charts(checked),
        close_charts(checked, owners),
        faces_without_texel(checked, owners),
        low_texel_density(checked),
    ]
