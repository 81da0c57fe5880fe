"""A mesh reduced to a number of faces, by the first attempt that gives up least for it.

`fast` keeps a subset of the vertices, bit for bit. `best` puts vertices where the quadric error is
least; it is compared with `fast` by measured distance, and the closer of the two is returned.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997; Jarek Rossignac, Paul Borrel, "Multi-resolution 3D approximations for rendering
complex scenes", Modeling in Computer Graphics 1993 (clusters of vertices, where the topology must
be given up).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from texbake.errors import MeshError
from texbake.mesh.decimate import (
    boundary_fits,
    bring_down,
    cluster_stream,
    collapse_stream,
    drop_parts,
    move_and_collapse,
)
from texbake.mesh.distance import SurfaceDistance, surface_distance
from texbake.mesh.flat_shading import is_flat_shaded
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.topology import find_edges
from texbake.mesh.triangle_tree import with_nearest_attributes
from texbake.mesh.vertex_stream import (
    VertexStream,
    gather,
    weld_corners,
    weld_positions,
)

_GIVEN_UP = "too few faces to keep its"

# A result this much under the count is tried again, this often at most.
_SLACK = 0.02
_TRIES = 6

_COMPARED = 20_000  # samples; the RMS distance is good to about a hundredth

# Share of the requested faces that an attempt must leave, or else further attempts are made.
_ENOUGH = 0.75


@dataclass(frozen=True)
class Reduction:
    """A mesh with fewer faces, how it was made, and what was given up for that."""

    mesh: Mesh
    start: VertexStream | None  # what the last step began with
    method: str
    notes: tuple[str, ...] = ()
    gave_up: bool = False  # something of the mesh, to reach the count
    distance: SurfaceDistance | None = None  # where it was measured


def reduced(mesh: Mesh, n_faces: int, quality: str, threads: int | None) -> Reduction:
    """Return a mesh reduced to a number of faces, or to as few as are possible."""
    if is_flat_shaded(mesh, threads=threads):
        low = reduced(mesh.replace(normals=None, normal_faces=None), n_faces, quality, threads)
        return noted(low, "its normals are those of its facets: none of its edges counts as hard")
    start = bring_down(weld_corners(mesh, threads=threads), n_faces, threads=threads)
    if gather(mesh, start, start.faces) is None:
        raise MeshError(
            f"{mesh.name}: none of its faces has three distinct corners; repair it first"
        )
    result = _fast(mesh, start, n_faces, threads)
    if quality == "best":
        result = _best(mesh, result, n_faces, threads)
    least = result.mesh.n_faces
    if least > n_faces:
        result = noted(result, f"its topology does not allow fewer than {least} faces")
    return replace(result, mesh=with_nearest_attributes(result.mesh, mesh, threads))


def _fast(mesh: Mesh, start: VertexStream, n_faces: int, threads: int | None) -> Reduction:
    """The first attempt that comes close to the count from below, else the one nearest to it.

    Dropping separate parts can leave next to nothing of a mesh of many parts; clustering vertices
    then keeps more of it.
    """
    results: list[Reduction] = []
    for stream, reduce, method, notes in _attempts(mesh, start, n_faces, threads):
        low = _reduce_to(mesh, stream, reduce, n_faces)
        if low is None:
            continue
        results.append(Reduction(low, stream, method, notes, gave_up=bool(notes)))
        if _ENOUGH * n_faces <= low.n_faces <= n_faces:
            return results[-1]
    reached = [result for result in results if result.mesh.n_faces <= n_faces]
    if reached:
        result = max(reached, key=lambda result: result.mesh.n_faces)
        few = f"only {result.mesh.n_faces} of the {n_faces} requested faces are left"
        return result if 2 * result.mesh.n_faces > n_faces else noted(result, few)
    return min(results, key=lambda result: result.mesh.n_faces)


def noted(result: Reduction, note: str) -> Reduction:
    """Return a reduction with one more note."""
    return replace(result, notes=(*result.notes, note))


def _attempts(
    mesh: Mesh, stream: VertexStream, n_faces: int, threads: int | None
) -> Iterator[tuple[VertexStream, Callable[[int], IntArray], str, tuple[str, ...]]]:
    """Yield attempts to reach the count, each giving up more than the one before, with notes.

    Clusters of vertices are the last one. They are not for an oriented surface, because they seldom
    leave one.
    """
    notes: tuple[str, ...] = ()
    while True:
        collapse = partial(collapse_stream, stream)
        if boundary_fits(stream, n_faces):
            yield stream, partial(collapse, lock_boundary=True), "collapsed edges", notes
        yield stream, collapse, "collapsed edges", notes
        pruned = (*notes, "small separate parts were dropped")
        yield stream, partial(_pruned, stream), "collapsed edges, dropped parts", pruned
        if not stream.has_seams:
            break
        notes = (f"{_GIVEN_UP} {_seams(stream)}",)
        welded = weld_positions(mesh, threads=threads)
        stream = bring_down(welded, n_faces, threads=threads)
    edges = find_edges(stream.position_ids[stream.faces])
    if edges.non_manifold.any() or edges.misoriented.any():
        clustered = (*notes, "its topology was given up: vertices were joined in clusters")
        yield stream, partial(cluster_stream, stream), "clustered vertices", clustered
    yield stream, lambda _: stream.faces, "unchanged", notes


def _pruned(stream: VertexStream, n_faces: int) -> IntArray:
    """Collapse, and drop parts of what cannot come down to the count."""
    return drop_parts(stream, collapse_stream(stream, n_faces), n_faces)


def _reduce_to(
    mesh: Mesh, stream: VertexStream, reduce: Callable[[int], IntArray], n_faces: int
) -> Mesh | None:
    """Reduce to the count, asking for more where degenerate faces or clusters leave fewer."""
    nearest: Mesh | None = None
    n_asked = n_faces
    for _ in range(_TRIES):
        low = gather(mesh, stream, reduce(n_asked))
        n_left = 0 if low is None else low.n_faces
        if low is not None and (nearest is None or nearest.n_faces < n_left <= n_faces):
            nearest = low
        if n_left >= (1.0 - _SLACK) * n_faces:
            break
        n_asked += n_faces - n_left
    return nearest


def _seams(stream: VertexStream) -> str:
    names = {
        "texture coordinates": stream.uv_ids,
        "hard edges": stream.normal_ids,
        "group borders": stream.group_ids,
    }
    return " and ".join(name for name, ids in names.items() if ids is not None)


def _moved(mesh: Mesh, start: VertexStream, n_faces: int, threads: int | None) -> Mesh | None:
    """The mesh with vertices moved to where the error is least."""
    if start.uv_ids is None and start.normal_ids is None:
        # Borders of groups do not hinder here: a face gets its group back from the nearest point.
        welded = gather(mesh, start, start.faces)
        if welded is None:
            return None
        mesh, start = welded, weld_positions(welded, threads=threads)
    moved = move_and_collapse(mesh, start, n_faces, lock_boundary=boundary_fits(start, n_faces))
    corners = Mesh(
        positions=LocalFrame.around(mesh).to_model(moved.points),
        faces=moved.stream.position_ids[moved.stream.faces],
        uvs=moved.uvs,
        uv_faces=None if moved.stream.uv_ids is None else moved.stream.uv_ids[moved.stream.faces],
        normals=moved.normals,
        normal_faces=None
        if moved.stream.normal_ids is None
        else moved.stream.normal_ids[moved.stream.faces],
        group_names=mesh.group_names,
        name=mesh.name,
    )
    return gather(corners, moved.stream, moved.stream.faces)


def _best(mesh: Mesh, fast: Reduction, n_faces: int, threads: int | None) -> Reduction:
    """Of both results the one that reaches the count, or else the closest."""
    start = fast.start
    assert start is not None
    low = _moved(mesh, start, n_faces, threads)
    if low is None:
        return fast
    given_up = tuple(note for note in fast.notes if note.startswith(_GIVEN_UP))
    moved_result = Reduction(low, start, "moved vertices", given_up, gave_up=bool(given_up))
    results = [fast, moved_result]

    def order(result: Reduction) -> tuple[int, float]:
        beyond = max(result.mesh.n_faces - n_faces, 0)
        distance = surface_distance(mesh, result.mesh, n_samples=_COMPARED, threads=threads)
        return beyond, distance.rms

    return min(results, key=order)
