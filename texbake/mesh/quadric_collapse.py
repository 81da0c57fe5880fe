"""Decimation with PyMeshLab: edges collapse to the points of least quadric error.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997, as MeshLab has it. (Its variant for textured meshes carried texture coordinates
across seams, on up to a fifth of the surface of real meshes, and is not used.)

PyMeshLab crashes on some broken meshes, and takes the process with it. So it runs in one of its
own, with a limit on its time, and whatever it does to that one costs no more than the attempt.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from texbake.errors import DependencyError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh

_WORKER = Path(__file__).with_name("quadric_worker.py")

# Ten times what it takes on 2 cores, and enough to start Python on a busy machine.
_SECONDS_A_FACE = 300e-6
_SECONDS_TO_START = 60.0


def collapse_edges(mesh: Mesh, n_faces: int, *, keep_boundary: bool) -> list[Mesh]:
    """Collapse edges until at most `n_faces` are left.

    Parameters
    ----------
    mesh
        Its positions and faces count, and nothing else.
    n_faces
        Faces asked for.
    keep_boundary
        Leave every boundary edge where it is.

    Returns
    -------
    list of Mesh
        What each attempt came to: none if the mesh was too broken for it; one with the topology
        kept, and where that did not reach `n_faces`, one without.

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
                timeout=_SECONDS_TO_START + _SECONDS_A_FACE * mesh.n_faces,
                capture_output=True,
                check=False,
            )
        import_error = folder / "import_error.txt"
        if import_error.exists():
            reason = " ".join(import_error.read_text(encoding="utf-8").split())
            raise DependencyError(
                f"simplify: pymeshlab does not load: {reason}; "
                "install what it needs, or ask for quality fast"
            )
        reduced = [_reduced(path, mesh, frame) for path in sorted(folder.glob("reduced-*.npz"))]
    return [result for result in reduced if result is not None]


def _reduced(path: Path, mesh: Mesh, frame: LocalFrame) -> Mesh | None:
    with np.load(path) as arrays:
        positions, faces = frame.to_model(arrays["positions"]), arrays["faces"]
    if len(faces) == 0 or not np.isfinite(positions).all():
        return None
    return Mesh(positions=positions, faces=faces, name=mesh.name)
