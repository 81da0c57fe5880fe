"""Whether a mesh is better wrapped before it is simplified, and why.

One closed surface with few tunnels is not. Of other meshes, a coarse wrap shows what they are:
where much of it has the mesh's outside on both sides, the mesh is an open surface, such as a range
scan, cloth, leaves or terrain, and stays one. Where much of the mesh lies inside of the wrap, or
its edges have more than two faces, simplifying it would spend triangles on what is not seen, or
tear it. A mesh of several objects stays as it is, because wrapping would join them. Where a closed
mesh has more tunnels than the triangles can show, they must be closed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texbake.errors import MeshError
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.objects import face_objects, weld_vertices
from texbake.mesh.remesh import looks_open, remesh, remesh_with_thinness
from texbake.mesh.remesh_options import AUTO, RemeshOptions
from texbake.mesh.remeshing.tunnels import remesh_with_few_tunnels
from texbake.mesh.topology import (
    face_components,
    find_edges,
    genus,
    repeated_vertices,
)
from texbake.mesh.triangle_tree import TriangleTree
from texbake.progress import ProgressSink

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
    """Say why a mesh should be wrapped before it is simplified; None where it should not.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere, plane
    >>> reason_to_wrap(icosphere(3)) is None, reason_to_wrap(plane(8, 8)) is None
    (True, True)
    """
    faces = weld_vertices(mesh, threads=threads)[mesh.faces]
    faces = np.ascontiguousarray(faces[~repeated_vertices(faces)], dtype=np.int32)
    edges = find_edges(faces)
    handles = genus(faces, edges, mesh.n_vertices)
    if handles and n_faces is not None and handles > n_faces / _FACES_PER_TUNNEL:
        text = f"{n_faces:,} triangles cannot show its tunnels ({handles:,})"
        return Reason(text, has_tunnels=True, is_certain=handles > n_faces / _TOO_FEW)
    n_torn = int(np.count_nonzero(edges.non_manifold))
    if _is_clean(faces, handles, mesh.n_vertices):
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


def _is_clean(faces: IntArray, handles: int | None, n_vertices: int) -> bool:
    """Whether faces are one closed surface with too few handles to have many rooms inside."""
    if handles is None or handles > _MOST_HANDLES:
        return False
    return face_components(faces, n_vertices)[1] == 1


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
    progress: ProgressSink | None = None,
) -> Iterator[tuple[Mesh, float]]:
    """Wrap a mesh with no more tunnels than a number of triangles can show.

    Yields wraps with the width of the gaps that were closed for fewer tunnels, in model units, the
    narrowest that leaves few enough first; or one wrap and 0 where that is not needed.
    """
    bare = _bare(mesh)
    if not has_tunnels:
        options = RemeshOptions(surface=surface)
        wrap = remesh(bare, options, threads=threads, progress=progress)
        handles = genus(wrap.faces, find_edges(wrap.faces), wrap.n_vertices) or 0
        if n_faces is None or handles <= n_faces / _FACES_PER_TUNNEL:
            yield wrap, 0.0
            return
    assert n_faces is not None
    yield from remesh_with_few_tunnels(
        bare,
        n_faces / _FACES_PER_TUNNEL,
        resolution=_COARSE.resolution if n_faces <= FEW_FACES else RemeshOptions.resolution,
        threads=threads,
        progress=progress,
    )
