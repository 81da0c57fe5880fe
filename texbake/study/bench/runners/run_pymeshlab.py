"""Do one job with pymeshlab: `run_pymeshlab.py JOB`."""

from pathlib import Path

import numpy as np
import pymeshlab
from runner_job import do_job


def bake_normals(job):
    """Transfer the normals of the high-poly mesh's vertices, in object space, in 8 bits."""
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["low"])
    meshes.load_new_mesh(job["high"])
    out = Path(job["out"])
    meshes.transfer_attributes_to_texture_per_vertex(
        sourcemesh=1, targetmesh=0, attributeenum="Vertex Normal", textname=out.name,
        textw=job["size"], texth=job["size"], overwrite=False, pullpush=False,
    )  # fmt: skip
    meshes.set_current_mesh(0)
    meshes.save_current_mesh(str(out.with_suffix(".obj")))  # writes the texture beside it


def unwrap(job):
    """Write texture coordinates by corner."""
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["mesh"])
    meshes.generate_voronoi_atlas_parametrization(regionnum=job["regions"], overlapflag=False)
    meshes.set_current_mesh(meshes.mesh_number() - 1)
    mesh = meshes.current_mesh()
    corners = mesh.wedge_tex_coord_matrix().reshape(-1, 3, 2)
    np.savez(job["out"], positions=mesh.vertex_matrix(), faces=mesh.face_matrix(), corners=corners)


def simplify(job):
    """Write a mesh of about this many triangles."""
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["mesh"])
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=job["faces"], optimalplacement=True, planarquadric=job["planar"]
    )
    meshes.save_current_mesh(job["out"])


def version(job):
    """Print the version."""
    from importlib.metadata import version as version_of

    print("VERSION", version_of("pymeshlab"))


if __name__ == "__main__":
    do_job(globals())
