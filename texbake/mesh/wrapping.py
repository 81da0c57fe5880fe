"""Whether a mesh is better wrapped before it is simplified, and why.

One closed surface with few handles is not. Of other meshes, a coarse wrap tells what they are:
where much of it has the mesh's outside on both sides, the mesh is an open surface, such as a range
scan, cloth, leaves or terrain, and stays one. Where much of the mesh lies inside of the wrap, or
its edges have more than two faces, simplifying it would spend triangles on what is not seen, or
tear it. Several objects stay apart, although they hide what lies between them.
"""

from __future__ import annotations

import numpy as np

from texbake.errors import MeshError
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.objects import face_objects, weld_vertices
from texbake.mesh.remesh import remesh, remesh_with_thinness
from texbake.mesh.remesh_options import RemeshOptions
from texbake.mesh.topology import (
    MeshEdges,
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


def reason_to_wrap(mesh: Mesh, *, threads: int | None = None) -> str | None:
    """Say why a mesh should be wrapped before it is simplified; None where it should not.

    Parameters
    ----------
    mesh
    threads
        None for every processor.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere, plane
    >>> reason_to_wrap(icosphere(3)) is None, reason_to_wrap(plane(8, 8)) is None
    (True, True)
    """
    faces = weld_vertices(mesh, threads=threads)[mesh.faces]
    faces = np.ascontiguousarray(faces[~repeated_vertices(faces)], dtype=np.int32)
    edges = find_edges(faces)
    n_torn = int(np.count_nonzero(edges.non_manifold))
    if _is_clean(faces, edges, mesh.n_vertices):
        return None
    bare = mesh.replace(colors=None, face_groups=None, group_names=())
    try:
        wrap, voxel, thin_share = remesh_with_thinness(bare, _COARSE, threads=threads)
    except MeshError:
        return None
    if thin_share > _OPEN:
        return None
    if n_torn > _TORN * len(edges.vertices):
        return f"{n_torn:,} of its edges have more than two faces"
    if face_objects(mesh) is not None:  # they would become one
        return None
    hidden = _share_inside(bare, wrap, voxel, threads)
    return f"{100.0 * hidden:.0f} % of its surface lies inside" if hidden > _HIDDEN else None


def _is_clean(faces: IntArray, edges: MeshEdges, n_vertices: int) -> bool:
    """Whether faces are one closed surface with too few handles to have many rooms inside."""
    if not edges.closed or face_components(faces, n_vertices)[1] > 1:
        return False
    handles = genus(faces, edges, n_vertices)
    return handles is not None and handles <= _MOST_HANDLES


def _share_inside(mesh: Mesh, wrap: Mesh, voxel: float, threads: int | None) -> float:
    """Share of a mesh's area that lies deep inside of its wrap."""
    frame = LocalFrame.around(mesh)
    tree = TriangleTree.build(frame.to_local(wrap.positions), wrap.faces, threads=threads)
    points = frame.to_local(sample_surface(mesh, _SAMPLES, threads=threads)[0])
    depth = _DEPTH * float(frame.length_to_local(voxel))
    distances, _, _ = tree.closest_points(points, max_distance=depth, threads=threads)
    return float(np.mean(np.isinf(distances)))


def wrapped_if(
    mesh: Mesh,
    choice: str,
    n_faces: int | None,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> tuple[Mesh, tuple[str, ...]]:
    """Wrap a mesh if asked to, or if it is better so; also return a sentence that says why.

    Parameters
    ----------
    mesh
    choice : {"auto", "always", "never"}
    n_faces
        What the mesh will be reduced to, None where an error decides. One that has no more is never
        better wrapped.
    threads, progress
        As for `remesh`.
    """
    may_help = choice == "auto" and (n_faces is None or mesh.n_faces > n_faces)
    reason = reason_to_wrap(mesh, threads=threads) if may_help else None
    if choice != "always" and reason is None:
        return mesh, ()
    bare = mesh.replace(colors=None, face_groups=None, group_names=())
    wrap = remesh(bare, threads=threads, progress=progress)
    if reason is None:
        return wrap, ()
    return wrap, (
        f"{mesh.name}: {reason}; the low-poly mesh was made from a closed surface around it; "
        "`remesh` never leaves it as it is",
    )
