"""What is wrong with texture coordinates at the size and padding of a bake.

Which face owns which texel is decided by the bake's own rasterizer, with one sample a texel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    rasterize_uv,
    snap_uvs,
)
from texbake.checks.coordinates import outside
from texbake.checks.finding import Finding, found
from texbake.checks.subject import Subject
from texbake.errors import UvError
from texbake.mapping.stretch import face_stretch
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.texture.padding import nearest_owner

# Of the mean of the mesh: a face of a quarter of its texels a unit looks blurred beside the others.
_LEAST_DENSITY = 0.25

Owners = npt.NDArray[np.int32]


def texel_owners(subject: Subject) -> Owners:
    """(H, W) int32: face that owns each texel's center, `NO_FACE` for none."""
    options = subject.options
    grid = SampleGrid(options.width_px, options.height_px, 1)
    try:
        faces = snap_uvs(subject.mesh, grid)
    except UvError:  # no face covers anything
        return np.full((options.height_px, options.width_px), NO_FACE, dtype=np.int32)
    return rasterize_uv(faces, grid, threads=options.threads)[0]


def nothing_covered(subject: Subject, owners: Owners) -> Finding | None:
    """Find out whether there is nothing to bake to."""
    return found("nothing-covered", subject.role, int((owners == NO_FACE).all()))


def thin_charts(subject: Subject) -> Finding | None:
    """Find charts thinner than the padding; the thinnest are the worst.

    The width of a chart is that of the rectangle of its area and outline, or four times its area
    over its outline where it is rounder than a square: exact for rectangles, for strips however
    bent, for rings, and for disks.
    """
    padding = subject.options.padding
    widths = chart_widths(subject)
    thin = np.isfinite(widths) & (widths < padding)
    faces = np.flatnonzero(thin[subject.charts])
    return found(
        "thin-charts",
        subject.role,
        thin.sum(),
        faces,
        -widths[subject.charts[faces]],
        padding=padding,
        least=widths[thin].min(initial=np.inf),
    )


def chart_widths(subject: Subject) -> FloatArray:
    """(n_charts,) float64: in texels; NaN for a chart without area."""
    options, charts = subject.options, subject.charts
    n_charts = int(charts.max()) + 1
    sides = np.array([options.width_px, options.height_px], dtype=np.float64)
    areas = np.bincount(charts, np.abs(subject.uv_areas), n_charts) * sides.prod()
    used_once = np.bincount(subject.texture_edges.ravel())[subject.texture_edges] == 1
    ways = (np.roll(subject.uvs, -1, axis=1) - subject.uvs) * sides
    lengths = np.where(used_once, np.hypot(ways[..., 0], ways[..., 1]), 0.0).sum(axis=1)
    outlines = np.bincount(charts, lengths, n_charts)
    # w l = area, 2 (w + l) = outline; what is rounder than a square counts as one.
    roots = np.sqrt(np.maximum(outlines**2 - 16.0 * areas, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        widths = 4.0 * areas / (outlines + roots)  # the lesser root, without cancellation
    return np.where(areas > 0.0, widths, np.nan)


def close_charts(subject: Subject, owners: Owners) -> Finding | None:
    """Find pairs of charts whose padding meets, and the faces where it does."""
    padding, threads = subject.options.padding, subject.options.threads
    covered = owners != NO_FACE
    chart_of = np.where(covered, subject.charts[owners], -1).astype(np.int32)
    nearest = nearest_owner(chart_of, padding, threads=threads)
    pairs = [_meeting(nearest.indices, chart_of, padding, axis) for axis in (0, 1)]
    texels = np.concatenate(pairs, axis=1)
    # Faces that lie on one another are told as that.
    overlapping = subject.overlaps.overlapping[owners.ravel()[texels]]
    texels = texels[:, ~overlapping.all(axis=0)]
    groups = subject.mesh.face_groups
    if groups is not None and subject.shares_texture.any():  # each group has a texture of its own
        of_ends = groups[owners.ravel()[texels]]
        texels = texels[:, of_ends[0] == of_ends[1]]
    between = np.sort(chart_of.ravel()[texels], axis=0)
    n_pairs = len(np.unique(between[0].astype(np.int64) << 32 | between[1]))
    faces, counts = np.unique(owners.ravel()[texels], return_counts=True)
    return found(
        "close-charts",
        subject.role,
        n_pairs,
        faces,
        counts,
        texels=nearest.n_meeting,
        padding=padding,
    )


def _meeting(
    indices: IntArray, chart_of: IntArray, padding: int, axis: int
) -> npt.NDArray[np.int64]:
    """(2, n): owners of different charts, nearest to two neighboring texels, both near to one.

    Neighbors along an axis, 0 for those below one another.
    """
    width = chart_of.shape[1]
    first = indices[:-1] if axis == 0 else indices[:, :-1]
    second = indices[1:] if axis == 0 else indices[:, 1:]
    flat = chart_of.ravel()
    rows, columns = np.nonzero((first >= 0) & (second >= 0) & (flat[first] != flat[second]))
    owners = np.stack([first[rows, columns], second[rows, columns]]).astype(np.int64)
    next_rows, next_columns = rows + (axis == 0), columns + (axis == 1)

    def near(owner: npt.NDArray[Any], row: npt.NDArray[Any], column: npt.NDArray[Any]) -> Any:
        return (owner // width - row) ** 2 + (owner % width - column) ** 2 <= padding**2

    meets = near(owners[1], rows, columns) | near(owners[0], next_rows, next_columns)
    return np.asarray(owners[:, meets])


def faces_without_texel(subject: Subject, owners: Owners) -> Finding | None:
    """Find faces that own no texel for no other reason than their size."""
    seen = np.zeros(subject.mesh.n_faces + 1, dtype=bool)
    seen[owners] = True  # NO_FACE is -1, and so the last entry
    excused = outside(subject) | subject.overlaps.overlapping | (subject.uv_areas == 0.0)
    faces = np.flatnonzero(~seen[:-1] & ~excused)
    return found("faces-without-texel", subject.role, len(faces), faces, subject.areas[faces])


def low_texel_density(subject: Subject) -> Finding | None:
    """Find faces with few texels a model unit along their most stretched direction."""
    options = subject.options
    try:
        stretch = face_stretch(subject.mesh.replace(positions=subject.positions), options.size)
    except UvError:  # there is nothing to measure
        return None
    texels = float(np.abs(stretch.texel_areas).sum())
    mean = math.sqrt(texels / float(stretch.areas.sum())) * subject.scale
    densities = mean / stretch.greatest
    least = options.min_texel_density or _LEAST_DENSITY * mean
    low = densities < least
    return found(
        "low-texel-density",
        subject.role,
        low.sum(),
        stretch.faces[low],
        -densities[low],
        least=densities.min(),
        mean=mean,
    )


def texel_findings(subject: Subject, owners: Owners) -> list[Finding | None]:
    """Everything of this module; of coordinates that cover nothing, that alone."""
    nothing = nothing_covered(subject, owners)
    if nothing is not None:
        return [nothing]
    return [
        thin_charts(subject),
        close_charts(subject, owners),
        faces_without_texel(subject, owners),
        low_texel_density(subject),
    ]
