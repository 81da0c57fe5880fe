"""Fewer triangles by collapsing edges, as close to the surface as their number allows.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997; Jarek Rossignac, Paul Borrel, "Multi-resolution 3D approximations for rendering
complex scenes", Modeling in Computer Graphics 1993 (clusters of vertices, where the topology must
be given up).

`fast` keeps a subset of the vertices, bit for bit. `best` puts vertices where the quadric error is
least; it is compared with `fast` by measured distance, and the closer of the two is returned.

Both keep what is a surface a surface, of the same topology. Seams and hard edges are kept by their
topology: a vertex for each side, which move together. Weights for the attributes themselves changed
neither distances nor texture coordinates measurably on real meshes, and are not used.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from texbake.errors import MeshError, OptionError
from texbake.mesh.decimate import (
    boundary_fits,
    bring_down,
    cluster_stream,
    collapse_stream,
    drop_parts,
    move_and_collapse,
)
from texbake.mesh.distance import SurfaceDistance, surface_distance
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.simplify_options import DEFAULT_QUALITY, MIN_FACES, QUALITIES
from texbake.mesh.topology import find_edges
from texbake.mesh.triangle_tree import with_nearest_attributes
from texbake.mesh.vertex_stream import (
    VertexStream,
    gather,
    weld_corners,
    weld_positions,
)
from texbake.progress import ProgressSink, Stages

_GIVEN_UP = "too few faces to keep its"

# A result this much under the count is tried again, this often at most.
_SLACK = 0.02
_TRIES = 6

_COMPARED = 20_000  # samples; the RMS distance is good to about a hundredth

# Share of the requested faces that an attempt must leave, or else further attempts are made.
_ENOUGH = 0.75


@dataclass(frozen=True, kw_only=True)
class SimplifyReport:
    """Figures of a run of `simplify`.

    Attributes
    ----------
    n_faces_before, n_faces_asked, n_faces : int
        Of the given mesh, requested, and of the result. `n_faces` is above `n_faces_asked` where
        no attempt came down to it.
    n_vertices : int
        Positions of the result.
    quality : str
        As requested.
    method : str
        How the result was made.
    notes : tuple of str
        What was given up to reach the count, or why it was not reached.
    distance : SurfaceDistance
        Between the mesh given (a) and the result (b).
    seconds : float
        Without measuring the distance.
    """

    n_faces_before: int
    n_faces_asked: int
    n_faces: int
    n_vertices: int
    quality: str
    method: str
    notes: tuple[str, ...]
    distance: SurfaceDistance
    seconds: float

    @property
    def reached(self) -> bool:
        """Whether the result has at most the requested number of faces."""
        return self.n_faces <= self.n_faces_asked

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        values = asdict(self)
        values["reached"] = self.reached
        values["notes"] = list(self.notes)
        for figure in ("max", "rms", "mean"):
            values["distance"][figure] = getattr(self.distance, figure)
            values["distance"][f"{figure}_relative"] = getattr(self.distance, f"{figure}_relative")
        return values


@dataclass(frozen=True)
class _Result:
    mesh: Mesh
    start: VertexStream  # what the last step began with
    method: str
    notes: tuple[str, ...] = ()


def simplify(
    mesh: MeshLike,
    n_faces: int,
    *,
    quality: str = DEFAULT_QUALITY,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> Mesh:
    """Reduce a mesh to at most `n_faces` triangles that stay as close to its surface as possible.

    Boundaries, seams of texture coordinates, hard edges (where the mesh's own normals differ at one
    position) and borders between groups are kept, as long as the count can be reached with them.
    Where it cannot, they are given up in this order: a locked boundary, small separate parts, seams
    and hard edges with their attributes, and, of a mesh with non-manifold or misoriented edges, the
    topology; the report of `simplify_with_report` says which. An oriented surface stays one: where
    its tunnels need more faces than `n_faces`, it keeps more.

    Parameters
    ----------
    mesh
        Any mesh; vertices at bit-equal positions are joined, faces without three distinct
        positions and duplicate faces dropped.
    n_faces
        Number of triangles wanted, at least 4. A mesh with no more than that is returned
        unchanged.
    quality
        `fast`: a subset of the vertices, bit-equal, with their texture coordinates, hard normals,
        groups and colors. `best`: moved vertices, closer to the surface, and slower; groups and
        colors are those of the nearest point of the mesh given. A mesh that keeps texture
        coordinates or hard edges gets `fast` in both.
    progress
        Called with each stage.
    threads
        None for every processor; the result does not depend on it.

    Returns
    -------
    Mesh
        Without tangents, and without normals if no hard edges are left: smooth normals are those
        of the surface that is left.

    Raises
    ------
    OptionError
        `n_faces` or `quality` is not possible.
    MeshError
        The mesh has no face with three distinct positions.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere
    >>> simplify(icosphere(4), 500).n_faces
    500
    """
    mesh = as_mesh(mesh)
    return _simplified(mesh, n_faces, quality, Stages(progress), threads)[0]


def simplify_with_report(
    mesh: MeshLike,
    n_faces: int,
    *,
    quality: str = DEFAULT_QUALITY,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> tuple[Mesh, SimplifyReport]:
    """Simplify a mesh, and report the method and how far the result lies from the given mesh."""
    mesh = as_mesh(mesh)
    stages = Stages(progress)
    start = time.perf_counter()
    low, method, notes = _simplified(mesh, n_faces, quality, stages, threads)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = surface_distance(mesh, low, threads=threads)
    report = SimplifyReport(
        n_faces_before=mesh.n_faces,
        n_faces_asked=n_faces,
        n_faces=low.n_faces,
        n_vertices=low.n_vertices,
        quality=quality,
        method=method,
        notes=notes,
        distance=distance,
        seconds=seconds,
    )
    return low, report


def _simplified(
    mesh: Mesh, n_faces: int, quality: str, stages: Stages, threads: int | None
) -> tuple[Mesh, str, tuple[str, ...]]:
    """The simplified mesh, how it was made, and what was given up."""
    if n_faces < MIN_FACES:
        raise OptionError(f"n_faces: {n_faces} is too few; it must be at least {MIN_FACES}")
    if quality not in QUALITIES:
        raise OptionError(f"quality: {quality} is not one of {', '.join(QUALITIES)}")
    if n_faces >= mesh.n_faces:
        return mesh, "unchanged", ("it has no more faces than requested",)
    with stages.stage("simplify"):
        start = bring_down(weld_corners(mesh, threads=threads), n_faces, threads=threads)
        if gather(mesh, start, start.faces) is None:
            raise MeshError(
                f"{mesh.name}: none of its faces has three distinct corners; repair it first"
            )
        fast = _fast(mesh, start, n_faces, threads)
        result = _best(mesh, fast, n_faces, threads) if quality == "best" else fast
    if result.mesh.n_faces > n_faces:
        least = result.mesh.n_faces
        result = _noted(result, f"its topology does not allow fewer than {least} faces")
    return with_nearest_attributes(result.mesh, mesh, threads), result.method, result.notes


def _fast(mesh: Mesh, start: VertexStream, n_faces: int, threads: int | None) -> _Result:
    """The first attempt that comes close to the count from below, else the one nearest to it.

    Dropping separate parts can leave next to nothing of a mesh of many parts; clustering vertices
    then keeps more of it.
    """
    results: list[_Result] = []
    for stream, reduce, method, notes in _attempts(mesh, start, n_faces, threads):
        low = _reduce_to(mesh, stream, reduce, n_faces)
        if low is None:
            continue
        results.append(_Result(low, stream, method, notes))
        if _ENOUGH * n_faces <= low.n_faces <= n_faces:
            return results[-1]
    reached = [result for result in results if result.mesh.n_faces <= n_faces]
    if reached:
        result = max(reached, key=lambda result: result.mesh.n_faces)
        few = f"only {result.mesh.n_faces} of the {n_faces} requested faces are left"
        return result if 2 * result.mesh.n_faces > n_faces else _noted(result, few)
    return min(results, key=lambda result: result.mesh.n_faces)


def _noted(result: _Result, note: str) -> _Result:
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


def _best(mesh: Mesh, fast: _Result, n_faces: int, threads: int | None) -> _Result:
    """Of both results the one that reaches the count, or else the closest."""
    start = fast.start
    if start.uv_ids is not None or start.normal_ids is not None:
        return replace(fast, notes=(*fast.notes, f"only fast keeps {_seams(start)}"))
    welded = gather(mesh, start, start.faces)
    if welded is None:
        return fast
    stream = weld_positions(welded, threads=threads)
    points, faces = move_and_collapse(stream, n_faces, lock_boundary=boundary_fits(stream, n_faces))
    moved = Mesh(positions=LocalFrame.around(welded).to_model(points), faces=faces, name=mesh.name)
    low = gather(moved, replace(stream, position_ids=np.arange(len(points), dtype=np.int32)), faces)
    if low is None:
        return fast
    given_up = tuple(note for note in fast.notes if note.startswith(_GIVEN_UP))
    results = [fast, _Result(low, start, "moved vertices", given_up)]

    def order(result: _Result) -> tuple[int, float]:
        beyond = max(result.mesh.n_faces - n_faces, 0)
        distance = surface_distance(mesh, result.mesh, n_samples=_COMPARED, threads=threads)
        return beyond, distance.rms

    return min(results, key=order)
