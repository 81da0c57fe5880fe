"""Whether a mesh is better wrapped before it is simplified, and why.

One closed surface with few tunnels is not. Of other meshes, a coarse wrap shows what they are.
Where much of it has the mesh's outside on both sides, the mesh is an open surface, and stays one.
Where much of the mesh lies inside of the wrap, or its edges have more than two faces, simplifying
it would spend triangles on what is not seen, or tear it. A mesh of several objects stays as it is.
Where a closed mesh has more tunnels than the triangles can show, they must be closed.

For that, gaps are closed up to the narrowest width that leaves few enough tunnels, and the filling
is carved out again wherever that opens no tunnel: pores become pits.

Based on: Andrzej Szymczak, James Vanderhyde, "Extraction of Topologically Simple Isosurfaces from
Volume Datasets", IEEE Visualization 2003.
Kernel: `core/tunnel_carving.c`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from texbake.core import core
from texbake.errors import MeshError
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, Mesh
from texbake.mesh.objects import face_objects, weld_vertices
from texbake.mesh.options import AUTO, RemeshOptions
from texbake.mesh.remesh import looks_open, remesh, remesh_with_thinness
from texbake.mesh.remeshing.band import SHELL_DEPTH, Band, Grid
from texbake.mesh.remeshing.parts import Parts, without_crumbs, without_small_parts
from texbake.mesh.remeshing.projection import project
from texbake.mesh.remeshing.solid import (
    JUST_SOLID,
    Nets,
    flood_outside,
    nets_around,
    signed,
    solid_points,
)
from texbake.mesh.topology import face_components, find_edges, genus, repeated_vertices
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import Progress, Stages
from texbake.records import dataclass

# Widths of gaps, and the depth of carving, as shares of the diagonal. Deeper pits use triangles
# that the surface around them needs.
CLOSINGS: Final = (0.01, 0.02, 0.03, 0.05, 0.08)
_CARVING = 0.008


def remesh_with_few_tunnels(
    mesh: Mesh,
    n_faces: int,
    *,
    resolution: int,
    threads: int | None = None,
    progress: Progress = None,
) -> Iterator[tuple[Mesh, float, int]]:
    """Wrap a mesh in closed surfaces with no more tunnels than `n_faces` triangles show.

    Yields the wrap with the narrowest gaps that do, then the next wider and the next narrower one,
    each with the width of gaps and the number of parts smaller than a triangle.
    """
    most = n_faces / _FACES_PER_TUNNEL
    stages = Stages(progress)
    widest = f"{100.0 * CLOSINGS[-1]:g}%"  # the grid has room for all
    grid = Grid.around(mesh, RemeshOptions(resolution=resolution, close=widest))
    points = grid.to_voxels(mesh.positions)
    with stages.stage("measure voxels"):
        band = Band.around(points, mesh.faces, grid, threads=threads)
    tree = TriangleTree.build(points, mesh.faces, threads=threads)
    for nets, width in _closed(band, mesh.diagonal / grid.voxel, most, stages, threads):
        with stages.stage("project"):
            moved, faces = project(nets, tree, threads=threads)
        parts, _ = without_crumbs(Parts.of(moved, faces), keep_cavities=False)
        parts, n_left_out = without_small_parts(parts, 1.0 / n_faces)
        wrap = Mesh(positions=grid.to_model(parts.points), faces=parts.faces, name=mesh.name)
        yield with_nearest_attributes(wrap, mesh, threads), width * mesh.diagonal, n_left_out


def _closed(
    band: Band, diagonal: float, most: float, stages: Stages, threads: int | None
) -> Iterator[tuple[Nets, float]]:
    """Yield surfaces of solids with few tunnels, and the width of the gaps that each closes."""
    labels = band.labels(threads=threads)
    solid, field, thin = _flooded(band, labels, 0.0, threads)

    def flooded(width: float) -> tuple[BoolArray, Float32Array, BoolArray]:
        radius = width * diagonal / 2.0 - SHELL_DEPTH
        wide, wide_field, wide_thin = _flooded(band, labels, radius, threads)
        return wide | solid, wide_field, wide_thin

    def carved(wide: BoolArray) -> Nets:
        core.carve_tunnels(solid, wide, max(2, round(_CARVING * diagonal)))
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
    band: Band, labels: ByteArray, radius: float, threads: int | None
) -> tuple[BoolArray, Float32Array, BoolArray]:
    """Close gaps that a ball does not pass; return solid points, the field and its thin points."""
    labels = labels.copy()
    flood_outside(labels, max(radius, 0.0), None, threads=threads)
    field, thin = signed(band, labels, threads)
    return solid_points(band, field, labels, threads), field, thin


_COARSE = RemeshOptions(resolution=128)
_SAMPLES = 20_000
_DEPTH = 3.0  # voxels below the wrap from which on a point lies inside

# Shares from which on a mesh is open, of the wrap's vertices; has an inside that matters, of its
# area; and is torn, of its edges.
_OPEN, _HIDDEN, _TORN = 0.2, 0.1, 0.001
_MOST_HANDLES = 100

# Of low-poly meshes of two scans, those with 54 and 179 faces per tunnel were good, those with 18
# and 9 were not.
_FACES_PER_TUNNEL, _TOO_FEW = 60, 20
FEW_FACES = 1_000
"""Up to here, coarse voxels are finer than the faces can show."""


@dataclass(frozen=True)
class Reason:
    """Why a mesh should be wrapped."""

    text: str
    has_tunnels: bool = False  # it has more tunnels than the requested triangles can show
    # They can show so few of them that the mesh need not be tried as it is.
    is_certain: bool = False


def reason_to_wrap(
    mesh: Mesh, n_faces: int | None = None, *, threads: int | None = None
) -> Reason | None:
    """Return why a mesh should be wrapped before it is simplified; None where it should not."""
    faces = weld_vertices(mesh, threads=threads)[mesh.faces]
    faces = np.ascontiguousarray(faces[~repeated_vertices(faces)], dtype=np.int32)
    edges = find_edges(faces)
    handles = genus(faces, edges, mesh.n_vertices)
    if handles and n_faces is not None and handles > n_faces / _FACES_PER_TUNNEL:
        text = f"{n_faces:,} triangles cannot show its tunnels ({handles:,})"
        return Reason(text, has_tunnels=True, is_certain=handles > n_faces / _TOO_FEW)
    n_torn = int(np.count_nonzero(edges.non_manifold))
    has_few_rooms = handles is not None and handles <= _MOST_HANDLES
    if has_few_rooms and face_components(faces, mesh.n_vertices)[1] == 1:
        return None
    try:
        if looks_open(mesh, threads=threads):
            return None
        wrap, voxel, thin_share = remesh_with_thinness(_bare(mesh), _COARSE, threads=threads)
    except MeshError:
        return None
    if thin_share > _OPEN:
        return None
    if n_torn > _TORN * len(edges.vertices):
        return Reason(f"{n_torn:,} of its edges have more than two faces")
    if face_objects(mesh) is not None:  # they would become one
        return None
    hidden = _share_inside(mesh, wrap, voxel, threads)
    if hidden > _HIDDEN:
        return Reason(f"{100.0 * hidden:.0f} % of its surface lies inside")
    return None


def _bare(mesh: Mesh) -> Mesh:
    return mesh.replace(colors=None, face_groups=None, group_names=())


def _share_inside(mesh: Mesh, wrap: Mesh, voxel: float, threads: int | None) -> float:
    """Share of a mesh's area that lies deep inside of its wrap."""
    frame = LocalFrame.around(mesh)
    tree = TriangleTree.build(frame.to_local(wrap.positions), wrap.faces, threads=threads)
    points = frame.to_local(sample_surface(mesh, _SAMPLES, threads=threads)[0])
    depth = _DEPTH * float(frame.length_to_local(voxel))
    distances, _, _ = tree.closest_points(points, max_distance=depth, threads=threads)
    return float(np.mean(np.isinf(distances)))


def wraps(
    mesh: Mesh,
    n_faces: int | None,
    *,
    has_tunnels: bool = False,
    surface: str = AUTO,
    threads: int | None = None,
    progress: Progress = None,
) -> Iterator[tuple[Mesh, float, int]]:
    """Yield wraps as `remesh_with_few_tunnels`; or one wrap, 0 and 0 where that is not needed."""
    bare = _bare(mesh)
    if not has_tunnels:
        wrap = remesh(bare, RemeshOptions(surface=surface), threads=threads, progress=progress)
        handles = genus(wrap.faces, find_edges(wrap.faces), wrap.n_vertices) or 0
        if n_faces is None or handles <= n_faces / _FACES_PER_TUNNEL:
            yield wrap, 0.0, 0
            return
    assert n_faces is not None
    yield from remesh_with_few_tunnels(
        bare,
        n_faces,
        resolution=_COARSE.resolution if n_faces <= FEW_FACES else RemeshOptions.resolution,
        threads=threads,
        progress=progress,
    )
