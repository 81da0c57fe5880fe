"""The two libraries that remove triangles: meshoptimizer, and PyMeshLab in a process of its own.

meshoptimizer collapses edges of a vertex stream onto one of their ends; PyMeshLab collapses them to
the points of least quadric error. (Its variant for textured meshes carried texture coordinates
across seams, on up to a fifth of the surface of real meshes, and is not used.)

PyMeshLab crashes on some broken meshes and takes the process with it. So it runs in a process of
its own, `quadric_worker`, with a limit on its time, and a crash costs no more than the attempt.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997; Jarek Rossignac, Paul Borrel, "Multi-resolution 3D approximations for rendering
complex scenes", Modeling in Computer Graphics 1993 (clusters).
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import DependencyError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.vertex_stream import VertexStream

# Larger meshes are first reduced to this many faces, or to this multiple of the requested faces:
# from more, PyMeshLab takes longer and comes no closer.
_START_FACES = 50_000
_START_TIMES = 4

# A boundary that would take up more than this part of the faces is simplified like the rest.
_BOUNDARY_SHARE = 0.25

_ANY_ERROR = 1e9  # in units of the mesh's size: only the count stops it


def bring_down(stream: VertexStream, n_faces: int) -> VertexStream:
    """Reduce a large stream until further steps are cheap, leaving its boundary if possible.

    Starting the quadrics anew from there also brings the result a little closer to the surface.
    """
    n_start = max(_START_FACES, _START_TIMES * n_faces)
    if len(stream.faces) <= n_start:
        return stream
    faces = collapse_stream(stream, n_start, lock_boundary=True)
    if len(faces) > 2 * n_start:  # it is mostly boundary
        faces = collapse_stream(stream, n_start)
    return stream.restricted(faces)


def boundary_fits(stream: VertexStream, n_faces: int) -> bool:
    """Whether there is a boundary, and keeping all of it leaves most of `n_faces` to the rest."""
    corners = stream.position_ids[stream.faces].astype(np.int64)
    low, high = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).T
    # Faces that tie the sides of a seam together have edges without length.
    _, counts = np.unique((low << 32 | high)[low < high], return_counts=True)
    n_boundary = int((counts == 1).sum())
    return 0 < n_boundary <= _BOUNDARY_SHARE * n_faces


def collapse_stream(
    stream: VertexStream, n_faces: int, *, lock_boundary: bool = False, prune: bool = False
) -> IntArray:
    """Collapse edges until `n_faces` are left or no edge can.

    Parameters
    ----------
    stream
        Its seams keep together and are kept; each of its vertices is used by a face.
    n_faces
        Number of faces wanted.
    lock_boundary
        Leave boundary vertices where they are, instead of collapsing them along the boundary.
    prune
        Drop separate parts, the smallest first, where nothing else is left; perhaps all.

    Returns
    -------
    (F, 3) int32
        Faces over the stream's vertices, wound like those they come from.
    """
    library = _meshoptimizer()
    options = library.SIMPLIFY_LOCK_BORDER * lock_boundary | library.SIMPLIFY_PRUNE * prune
    return _call(stream, n_faces, library.simplify, options=ctypes.c_uint(options))


def cluster_stream(stream: VertexStream, n_faces: int) -> IntArray:
    """Join vertices in cells of a grid, whatever their topology, for at most `n_faces`."""
    return _call(stream, n_faces, _meshoptimizer().simplify_sloppy)


def _meshoptimizer() -> Any:
    try:
        import meshoptimizer
    except ImportError as error:
        raise DependencyError(
            "simplify: meshoptimizer is missing; pip install --pre meshoptimizer"
        ) from error
    return meshoptimizer


def _call(stream: VertexStream, n_faces: int, reduce: Any, **options: Any) -> IntArray:
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


_WORKER = Path(__file__).with_name("quadric_worker.py")

# Ten times what it takes on 2 cores, and enough to start Python on a busy machine.
_SECONDS_PER_FACE = 300e-6
_SECONDS_TO_START = 60.0


def collapse_edges(mesh: Mesh, n_faces: int, *, keep_boundary: bool) -> list[Mesh]:
    """Collapse edges until at most `n_faces` are left.

    Parameters
    ----------
    mesh
        Its positions and faces count, and nothing else.
    n_faces
        Number of faces wanted.
    keep_boundary
        Leave every boundary edge where it is.

    Returns
    -------
    list of Mesh
        The result of each attempt: none if the mesh was too broken; one with the topology kept;
        and where that did not reach `n_faces`, one without.

    Raises
    ------
    DependencyError
        PyMeshLab is not installed, or a library that it needs.
    """
    if find_spec("pymeshlab") is None:
        raise DependencyError("simplify: pymeshlab is missing; pip install pymeshlab")
    frame = LocalFrame.around(mesh)
    with tempfile.TemporaryDirectory(prefix="texbake-") as name:
        folder = Path(name)
        given = {
            "positions": frame.to_local(mesh.positions),
            "faces": mesh.faces,
            "n_faces": n_faces,
            "keep_boundary": keep_boundary,
        }
        np.savez(folder / "mesh.npz", **given)  # type: ignore[arg-type]
        with suppress(subprocess.TimeoutExpired):
            # -P: the worker's neighbors are not modules of its own.
            subprocess.run(
                [sys.executable, "-P", str(_WORKER), str(folder)],
                timeout=_SECONDS_TO_START + _SECONDS_PER_FACE * mesh.n_faces,
                capture_output=True,
                check=False,
            )
        import_error = folder / "import_error.txt"
        if import_error.exists():
            reason = " ".join(import_error.read_text(encoding="utf-8").split())
            raise DependencyError(
                f"simplify: pymeshlab does not load: {reason}; "
                "install what it needs, or use the quality fast"
            )
        reduced = [_reduced(path, mesh, frame) for path in sorted(folder.glob("reduced-*.npz"))]
    return [result for result in reduced if result is not None]


def _reduced(path: Path, mesh: Mesh, frame: LocalFrame) -> Mesh | None:
    with np.load(path) as arrays:
        positions, faces = frame.to_model(arrays["positions"]), arrays["faces"]
    if len(faces) == 0 or not np.isfinite(positions).all():
        return None
    return Mesh(positions=positions, faces=faces, name=mesh.name)
