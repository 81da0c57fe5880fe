"""Fewer triangles: `fast` with meshoptimizer, `best` with PyMeshLab from where that leaves off.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997; Jarek Rossignac, Paul Borrel, "Multi-resolution 3D approximations for rendering
complex scenes", Modeling in Computer Graphics 1993 (clusters, meshoptimizer's sloppy mode).

`fast` keeps a subset of the vertices, bit for bit. `best` puts vertices where the quadric error is
least; it is compared with `fast` by measured distance, and the closer of the two is returned.

Seams and hard edges are kept by their topology: a vertex for each side, which the library moves
together. Weights for the attributes themselves (meshoptimizer's simplifyWithAttributes) changed
neither distances nor texture coordinates measurably on real meshes, and are not used.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texbake.errors import DependencyError, MeshError, OptionError
from texbake.mesh.distance import SurfaceDistance, surface_distance
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.quadric_collapse import collapse_edges
from texbake.mesh.simplify_options import DEFAULT_QUALITY, MIN_FACES, QUALITIES
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.vertex_stream import (
    VertexStream,
    gather,
    has_hard_edges,
    weld_corners,
    weld_positions,
)
from texbake.progress import ProgressSink, Stages

# Larger meshes first come down to this many faces, or this many times the faces asked for: from
# more, PyMeshLab takes longer and comes no closer.
_START_FACES = 50_000
_START_TIMES = 4

# A boundary that would take up more than this part of the faces is simplified like the rest.
_BOUNDARY_SHARE = 0.25

_ANY_ERROR = 1e9  # in units of the mesh's size: only the count stops meshoptimizer


@dataclass(frozen=True, kw_only=True)
class SimplifyReport:
    """What came of `simplify`.

    Attributes
    ----------
    n_faces_before, n_faces_asked, n_faces : int
        `n_faces` is above `n_faces_asked` where nothing came down to it.
    n_vertices : int
        Positions of the result.
    quality : str
        As asked.
    method : str
        What made the result.
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
        """Whether the result has no more faces than asked for."""
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
    method: str
    notes: tuple[str, ...] = ()


def simplify(
    mesh: Mesh,
    n_faces: int,
    *,
    quality: str = DEFAULT_QUALITY,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> Mesh:
    """Make a mesh lighter: at most `n_faces` triangles, as close to the surface as can be.

    Boundaries, seams of texture coordinates, hard edges (where the mesh's own normals differ at one
    position) and borders between groups are kept, as long as the count can be reached with them.
    Where it cannot, they are given up in this order: a locked boundary, small separate parts, seams
    and hard edges with their attributes, and then the topology; `simplify_with_report` says so. The
    count is reached even so, but for meshes that are mostly broken.

    Parameters
    ----------
    mesh
        Any mesh; vertices at bit-equal positions are joined, faces without three distinct
        positions and duplicate faces dropped.
    n_faces
        Triangles asked for, at least 4. A mesh with no more comes back itself, unchanged.
    quality
        `fast`: a subset of the vertices, bit-equal, with their texture coordinates, hard normals,
        groups and colors. `best`: moved vertices, closer to the surface, and slower; groups and
        colors are those of the nearest point of the mesh given. A mesh with hard edges gets
        `fast` in both.
    progress
        Told of the stages.
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
    DependencyError
        A library is missing.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere
    >>> simplify(icosphere(4), 500).n_faces
    500
    """
    return _simplified(mesh, n_faces, quality, Stages(progress), threads).mesh


def simplify_with_report(
    mesh: Mesh,
    n_faces: int,
    *,
    quality: str = DEFAULT_QUALITY,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> tuple[Mesh, SimplifyReport]:
    """`simplify`, with what came of it and how far the result lies from the mesh given."""
    stages = Stages(progress)
    start = time.perf_counter()
    result = _simplified(mesh, n_faces, quality, stages, threads)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = surface_distance(mesh, result.mesh, threads=threads)
    report = SimplifyReport(
        n_faces_before=mesh.n_faces,
        n_faces_asked=n_faces,
        n_faces=result.mesh.n_faces,
        n_vertices=result.mesh.n_vertices,
        quality=quality,
        method=result.method,
        notes=result.notes,
        distance=distance,
        seconds=seconds,
    )
    return result.mesh, report


def _simplified(
    mesh: Mesh, n_faces: int, quality: str, stages: Stages, threads: int | None
) -> _Result:
    if n_faces < MIN_FACES:
        raise OptionError(f"faces: {n_faces} is too few; it must be at least {MIN_FACES}")
    if quality not in QUALITIES:
        raise OptionError(f"quality: {quality} is not one of {', '.join(QUALITIES)}")
    if n_faces >= mesh.n_faces:
        return _Result(mesh, "unchanged", ("it has no more faces than asked for",))
    with stages.stage("simplify"):
        start = _started(weld_corners(mesh, threads=threads), n_faces)
        if len(start.faces) == 0:
            raise MeshError(f"{mesh.name}: no face of it has three distinct corners; mend it first")
        fast = _fast(mesh, start, n_faces, threads)
        return _best(mesh, start, fast, n_faces, threads) if quality == "best" else fast


def _fast(mesh: Mesh, start: VertexStream, n_faces: int, threads: int | None) -> _Result:
    """First attempt that reaches the count, else the one with the fewest faces."""
    results: list[_Result] = []
    for stream, faces, method, notes in _attempts(mesh, start, n_faces, threads):
        if len(faces) == 0:
            continue
        light = _with_nearest(gather(mesh, stream, faces), mesh, threads)
        results.append(_Result(light, method, notes))
        if light.n_faces <= n_faces:
            return results[-1]
    result = min(results, key=lambda result: result.mesh.n_faces)
    stopped = f"it does not come below {result.mesh.n_faces} faces: its topology stands in the way"
    return _Result(result.mesh, result.method, (*result.notes, stopped))


def _attempts(
    mesh: Mesh, stream: VertexStream, n_faces: int, threads: int | None
) -> Iterator[tuple[VertexStream, IntArray, str, tuple[str, ...]]]:
    """Ways to the count, each giving up more than the one before."""
    lock, prune = _meshoptimizer().SIMPLIFY_LOCK_BORDER, _meshoptimizer().SIMPLIFY_PRUNE
    notes: tuple[str, ...] = ()
    while True:
        if _boundary_fits(stream, n_faces):
            yield stream, _collapsed(stream, n_faces, lock), "meshoptimizer", notes
        yield stream, _collapsed(stream, n_faces), "meshoptimizer", notes
        pruned = (*notes, "small separate parts were dropped")
        yield stream, _collapsed(stream, n_faces, prune), "meshoptimizer, pruned", pruned
        if not stream.has_seams:
            break
        notes = ("its seams and hard edges were given up: they do not fit into so few faces",)
        stream = _started(weld_positions(mesh, threads=threads), n_faces)
    clustered = (*notes, "its topology was given up: vertices were joined in clusters")
    yield stream, _clustered(stream, n_faces), "meshoptimizer, sloppy", clustered


def _best(
    mesh: Mesh, start: VertexStream, fast: _Result, n_faces: int, threads: int | None
) -> _Result:
    """Whatever comes closest of what reaches the count, else the one with the fewest faces."""
    if has_hard_edges(mesh, threads=threads):
        return _Result(fast.mesh, fast.method, (*fast.notes, "only fast keeps its hard edges"))
    results = [fast]
    for reduced in collapse_edges(
        gather(mesh, start, start.faces),
        n_faces,
        keep_boundary=_boundary_fits(start, n_faces),
    ):
        stream = weld_corners(reduced, threads=threads)
        if len(stream.faces) > 0:
            light = _with_nearest(gather(reduced, stream, stream.faces), mesh, threads)
            results.append(_Result(light, "meshoptimizer, then pymeshlab"))

    def order(result: _Result) -> tuple[int, float]:
        beyond = max(result.mesh.n_faces - n_faces, 0)
        return beyond, surface_distance(mesh, result.mesh, threads=threads).rms

    return min(results, key=order)


def _started(stream: VertexStream, n_faces: int) -> VertexStream:
    """Bring a large stream down to where further steps are cheap, its boundary untouched if it can.

    Starting the quadrics anew from there also brings `fast` a little closer to the surface.
    """
    n_start = max(_START_FACES, _START_TIMES * n_faces)
    if len(stream.faces) <= n_start:
        return stream
    faces = _collapsed(stream, n_start, _meshoptimizer().SIMPLIFY_LOCK_BORDER)
    if len(faces) > 2 * n_start:  # it is mostly boundary
        faces = _collapsed(stream, n_start)
    return stream.restricted(faces)


def _boundary_fits(stream: VertexStream, n_faces: int) -> bool:
    """Whether there is a boundary, and keeping all of it leaves most faces to the rest."""
    corners = stream.position_ids[stream.faces].astype(np.int64)
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges[:, 0] << 32 | edges[:, 1], return_counts=True)
    n_boundary = int((counts == 1).sum())
    return 0 < n_boundary <= _BOUNDARY_SHARE * n_faces


def _collapsed(stream: VertexStream, n_faces: int, options: int = 0) -> IntArray:
    """Faces that meshoptimizer leaves; none if it drops everything."""
    return _reduced(stream, n_faces, _meshoptimizer().simplify, options=ctypes.c_uint(options))


def _clustered(stream: VertexStream, n_faces: int) -> IntArray:
    return _reduced(stream, n_faces, _meshoptimizer().simplify_sloppy)


def _meshoptimizer() -> Any:
    try:
        import meshoptimizer
    except ImportError as error:
        raise DependencyError(
            "simplify: meshoptimizer is missing; pip install --pre meshoptimizer"
        ) from error
    return meshoptimizer


def _reduced(stream: VertexStream, n_faces: int, reduce: Any, **options: Any) -> IntArray:
    """Call one of meshoptimizer's functions; its package leaves some of the types to the caller."""
    indices = np.ascontiguousarray(stream.faces).view(np.uint32).ravel()
    reduced = np.empty(len(indices), dtype=np.uint32)
    n_indices = reduce(
        reduced,
        indices,
        stream.points,
        index_count=ctypes.c_size_t(len(indices)),
        vertex_count=ctypes.c_size_t(len(stream.points)),
        vertex_positions_stride=ctypes.c_size_t(stream.points.strides[0]),
        target_index_count=ctypes.c_size_t(3 * n_faces),
        target_error=_ANY_ERROR,
        **options,
    )
    return reduced[:n_indices].view(np.int32).reshape(-1, 3).copy()


def _with_nearest(light: Mesh, mesh: Mesh, threads: int | None) -> Mesh:
    """Give a light mesh the groups and colors that it lacks, from the nearest points of `mesh`."""
    groups = mesh.face_groups if light.face_groups is None else None
    colors = mesh.colors if light.colors is None else None
    if groups is not None and len(mesh.group_names) == 1:
        ids = np.zeros(light.n_faces, dtype=np.int32)
        light = light.replace(face_groups=ids, group_names=mesh.group_names)
        groups = None
    if groups is None and colors is None:
        return light
    frame = LocalFrame.around(mesh)
    tree = TriangleTree.build(frame.to_local(mesh.positions), mesh.faces, threads=threads)
    points = frame.to_local(light.positions)
    if groups is not None:
        centers = points[light.faces].mean(axis=1)
        _, nearest, _ = tree.closest_points(centers, threads=threads)
        light = light.replace(face_groups=groups[nearest], group_names=mesh.group_names)
    if colors is not None:
        _, nearest, weights = tree.closest_points(points, threads=threads)
        blended = np.einsum("nc,ncx->nx", weights, colors[mesh.faces[nearest]])
        light = light.replace(colors=blended)
    return light
