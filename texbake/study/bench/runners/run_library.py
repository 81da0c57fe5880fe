"""Do one job with a library for meshes: `run_library.py JOB`, whose `program` is its name."""

import json
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version as version_of
from pathlib import Path

import numpy as np


def pymeshlab_bake_normals(job):
    """Transfer the normals of the high-poly mesh's vertices, in object space, in 8 bits."""
    import pymeshlab

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


def pymeshlab_unwrap(job):
    """Write texture coordinates by corner."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["mesh"])
    meshes.generate_voronoi_atlas_parametrization(regionnum=job["regions"], overlapflag=False)
    meshes.set_current_mesh(meshes.mesh_number() - 1)
    mesh = meshes.current_mesh()
    corners = mesh.wedge_tex_coord_matrix().reshape(-1, 3, 2)
    np.savez(job["out"], positions=mesh.vertex_matrix(), faces=mesh.face_matrix(), corners=corners)


def pymeshlab_simplify(job):
    """Write a mesh of about this many triangles."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["mesh"])
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=job["faces"], optimalplacement=True, planarquadric=job["planar"]
    )
    meshes.save_current_mesh(job["out"])


def read_ply(path):
    """Positions and triangles of a binary PLY file, of float32 and lists of one byte and int32."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in data[:end].splitlines() if b"element" in line]
    positions = np.frombuffer(data, "<f4", 3 * counts[0], end).reshape(-1, 3)
    rows = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    faces = np.frombuffer(data, rows, counts[1], end + positions.nbytes)["corners"]
    return np.ascontiguousarray(positions), np.ascontiguousarray(faces)


def xatlas_unwrap(job):
    """Write texture coordinates by corner."""
    import xatlas

    positions, faces = read_ply(job["mesh"])
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions, faces.astype(np.uint32))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    packing.resolution, packing.padding = job["size"], job["gap"]
    packing.bruteForce = job["brute_force"]
    atlas.generate(charts, packing)
    _, corners, uvs = atlas.get_mesh(0)
    # It divides u and v by different sizes; texels are square in pixels of the atlas.
    uvs = uvs * np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height)
    np.savez(job["out"], positions=positions, faces=faces, corners=uvs[corners])


def trimesh_unwrap(job):
    """Write texture coordinates by corner, from xatlas; trimesh sets neither size nor gap."""
    import trimesh

    mesh = trimesh.load(job["mesh"], process=False)
    unwrapped = mesh.unwrap()
    np.savez(
        job["out"],
        positions=unwrapped.vertices,
        faces=unwrapped.faces,
        corners=unwrapped.visual.uv[unwrapped.faces],
    )


def trimesh_simplify(job):
    """Write a mesh of about this many triangles."""
    import trimesh

    mesh = trimesh.load(job["mesh"], process=False)
    mesh.simplify_quadric_decimation(face_count=job["faces"]).export(job["out"])


def version(job):
    """Print the version of the library, and of what trimesh uses."""
    import_module(job["program"])
    words = version_of(job["program"])
    if job["program"] == "trimesh":
        parts = []
        for name in "fast-simplification", "xatlas":
            try:
                parts.append(f"with {name} {version_of(name)}")
            except PackageNotFoundError:
                parts.append(f"without {name}")
        words += f" ({', '.join(parts)})"
    print("VERSION", words)


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    task = job["task"].replace("-", "_")
    globals()[task if task == "version" else f"{job['program']}_{task}"](job)
