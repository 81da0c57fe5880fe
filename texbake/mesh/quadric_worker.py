"""Runs PyMeshLab's quadric edge collapse in a process of its own: `quadric_worker.py FOLDER`.

Reads `mesh.npz` and writes `reduced-0.npz`, `reduced-1.npz`, ... as each attempt succeeds. It is a
script, started by `quadric_collapse`, and imports nothing of texbake, so that it starts quickly.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np


def main(folder: Path) -> None:
    """Make every attempt that `mesh.npz` asks for."""
    import pymeshlab

    with np.load(folder / "mesh.npz") as mesh:
        positions, faces, n_faces = mesh["positions"], mesh["faces"], int(mesh["n_faces"])
        corner_uvs = mesh.get("corner_uvs")
        keep_boundary = bool(mesh["keep_boundary"])
    # All of them, always: PyMeshLab takes what is left out from the call before.
    settings = {
        "targetfacenum": n_faces,
        "targetperc": 0.0,
        # Below the default of 0.3: the surface counts more than the shape of its triangles.
        "qualitythr": 0.1,
        "preserveboundary": keep_boundary,
        "boundaryweight": 1.0,
        "preservenormal": True,
        "optimalplacement": True,
        "planarquadric": False,
        "selected": False,
    }
    plain = {"planarweight": 0.001, "qualityweight": False, "autoclean": True}
    # Without the topology kept it may crash, and it loses thin parts sooner; with it, it may stop.
    attempts = [
        ("meshing_decimation_quadric_edge_collapse", plain | {"preservetopology": True}),
        ("meshing_decimation_quadric_edge_collapse", plain | {"preservetopology": False}),
    ]
    given = {"vertex_matrix": positions, "face_matrix": faces}
    if corner_uvs is not None:
        attempts = [
            ("meshing_decimation_quadric_edge_collapse_with_texture", {"extratcoordw": 1.0})
        ]
        given["w_tex_coords_matrix"] = corner_uvs
    for number, (name, more) in enumerate(attempts):
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(**given))
        meshes.apply_filter(name, **settings, **more)
        result = meshes.current_mesh()
        reduced = {"positions": result.vertex_matrix(), "faces": result.face_matrix()}
        if corner_uvs is not None:
            reduced["corner_uvs"] = result.wedge_tex_coord_matrix()
        partial = folder / "partial.npz"
        np.savez(partial, **reduced)
        partial.rename(folder / f"reduced-{number}.npz")
        if len(reduced["faces"]) <= n_faces:
            break


if __name__ == "__main__":
    main(Path(sys.argv[1]))
