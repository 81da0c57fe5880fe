"""Run PyMeshLab's quadric edge collapse in a separate process: `quadric_worker.py FOLDER`.

Reads `mesh.npz` and writes `reduced-0.npz` and possibly `reduced-1.npz`, each when it is finished.
If PyMeshLab cannot be imported, it writes `import_error.txt` instead. `decimate` starts this
script, which imports nothing of texbake, so that it starts quickly.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np


def main(folder: Path) -> None:
    """Collapse with the topology kept, and without where that does not reach the count."""
    try:
        import pymeshlab
    except ImportError as error:  # such as an OpenGL library that is not installed
        (folder / "import_error.txt").write_text(str(error), encoding="utf-8")
        return

    with np.load(folder / "mesh.npz") as mesh:
        positions, faces, n_faces = mesh["positions"], mesh["faces"], int(mesh["n_faces"])
        keep_boundary = bool(mesh["keep_boundary"])
    # Without the topology kept it may crash, and sooner loses thin parts; with it, it may stop.
    for number, keep_topology in enumerate((True, False)):
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=positions, face_matrix=faces))
        # Every parameter, always: PyMeshLab takes those left out from the call before.
        meshes.meshing_decimation_quadric_edge_collapse(
            targetfacenum=n_faces,
            targetperc=0.0,
            # Not the default of 0.3: the surface counts more than the shape of its triangles.
            qualitythr=0.1,
            preserveboundary=keep_boundary,
            boundaryweight=1.0,
            preservenormal=True,
            preservetopology=keep_topology,
            optimalplacement=True,
            # Spreads triangles over flat parts evenly, at the cost of all others.
            planarquadric=False,
            planarweight=0.001,
            qualityweight=False,
            autoclean=True,
            selected=False,
        )
        reduced = meshes.current_mesh()
        partial = folder / "partial.npz"
        np.savez(partial, positions=reduced.vertex_matrix(), faces=reduced.face_matrix())
        partial.rename(folder / f"reduced-{number}.npz")
        if reduced.face_number() <= n_faces:
            break


if __name__ == "__main__":
    main(Path(sys.argv[1]))
