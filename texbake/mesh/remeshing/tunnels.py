"""A solid with few tunnels around a mesh.

Gaps are closed up to the narrowest width that leaves few enough tunnels. The filling is then carved
out again, from outside and to a small depth, wherever that opens no tunnel: pores become pits.

Based on: Andrzej Szymczak, James Vanderhyde, "Extraction of Topologically Simple Isosurfaces from
Volume Datasets", IEEE Visualization 2003.
Kernel: `core/tunnel_carving.c`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import Mesh
from texbake.mesh.remesh_options import RemeshOptions
from texbake.mesh.remeshing.band import SHELL_DEPTH, Band, CrowdedGridError
from texbake.mesh.remeshing.flood import flood_outside
from texbake.mesh.remeshing.grid import Grid, too_crowded
from texbake.mesh.remeshing.nets import JUST_SOLID, Nets, nets_around, signed, solid_points
from texbake.mesh.remeshing.parts import without_crumbs
from texbake.mesh.remeshing.projection import project
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import ProgressSink, Stages

# Widths of gaps, and the depth of carving, as shares of the diagonal. Deeper pits use triangles
# that the surface around them needs.
CLOSINGS: Final = (0.01, 0.02, 0.03, 0.05, 0.08)
_DEPTH = 0.008

Labels = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]
FloatArray32 = npt.NDArray[np.float32]


def remesh_with_few_tunnels(
    mesh: Mesh,
    most: float,
    *,
    resolution: int,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Iterator[tuple[Mesh, float]]:
    """Wrap a mesh in closed surfaces with few tunnels.

    Yields the wrap that closes the narrowest gaps which leave at most `most` tunnels, then those of
    the next wider and the next narrower gaps, each with the width of its gaps, in model units.
    """
    stages = Stages(progress)
    widest = f"{100.0 * CLOSINGS[-1]:g}%"  # the grid has room for all
    options = RemeshOptions(resolution=resolution, close=widest)
    grid = Grid.around(mesh, options)
    points = grid.to_voxels(mesh.positions)
    with stages.stage("measure voxels"):
        try:
            band = Band.around(points, mesh.faces, grid.shape, threads=threads)
        except CrowdedGridError as error:
            raise too_crowded(mesh, options, error) from error
    tree = TriangleTree.build(points, mesh.faces, threads=threads)
    for nets, width in _closed(band, mesh.diagonal / grid.voxel, most, stages, threads):
        with stages.stage("project"):
            moved, faces = project(nets, tree, threads=threads)
        moved, faces, _ = without_crumbs(moved, faces, keep_cavities=False)
        wrap = Mesh(positions=grid.to_model(moved), faces=faces, name=mesh.name)
        yield with_nearest_attributes(wrap, mesh, threads), width * mesh.diagonal


def _closed(
    band: Band, diagonal: float, most: float, stages: Stages, threads: int | None
) -> Iterator[tuple[Nets, float]]:
    """Yield surfaces of solids with few tunnels, and the width of the gaps that each closes.

    The diagonal of the mesh is in voxels, and the widths are shares of it.
    """
    labels = band.labels(threads=threads)
    solid, field, thin = _flooded(band, labels, 0.0, threads)

    def flooded(width: float) -> tuple[BoolArray, FloatArray32, BoolArray]:
        radius = width * diagonal / 2.0 - SHELL_DEPTH
        wide, wide_field, wide_thin = _flooded(band, labels, radius, threads)
        return wide | solid, wide_field, wide_thin

    def carved(wide: BoolArray) -> Nets:
        core.carve_tunnels(solid, wide, max(2, round(_DEPTH * diagonal)))
        added = band.values_of(wide & ~solid)
        with_added = field.copy()
        with_added[added] = np.minimum(field[added], JUST_SOLID)
        return nets_around(band, with_added, wide, thin, threads)

    with stages.stage("close tunnels"):
        for width in CLOSINGS:
            wide, wide_field, wide_thin = flooded(width)
            if nets_around(band, wide_field, wide, wide_thin, threads).n_handles <= most:
                break
        nets = carved(wide)
    yield nets, width
    chosen = CLOSINGS.index(width)
    for other in (*CLOSINGS[chosen + 1 :][:1], *CLOSINGS[:chosen][-1:]):
        with stages.stage("close tunnels"):
            nets = carved(flooded(other)[0])
        yield nets, other


def _flooded(
    band: Band, labels: Labels, radius: float, threads: int | None
) -> tuple[BoolArray, FloatArray32, BoolArray]:
    """Close gaps that a ball does not pass; return solid points, the field and its thin points."""
    labels = labels.copy()
    flood_outside(labels, max(radius, 0.0), None, threads=threads)
    field, thin = signed(band, labels, threads)
    return solid_points(band, field, labels, threads), field, thin
