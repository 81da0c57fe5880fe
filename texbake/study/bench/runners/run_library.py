"""Do one job with a library for meshes: `run_library.py JOB`, whose `program` is its name."""

import json
import sys
from importlib import import_module
from importlib.metadata import version as version_of
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


def pymeshlab_remesh(job):
    """Write a mesh of the zero level of distances on a grid."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(job["mesh"])
    box = meshes.current_mesh().bounding_box()
    side = max(box.dim_x(), box.dim_y(), box.dim_z())
    meshes.generate_resampled_uniform_mesh(cellsize=pymeshlab.PureValue(side / job["voxels"]))
    meshes.save_current_mesh(job["out"])


def read_ply(path):
    """Positions and triangles of a binary PLY file, of float32 and lists of one byte and int32."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].splitlines()
    counts = [int(line.split()[2]) for line in lines if line.startswith(b"element")]
    width = sum(line.startswith(b"property float") for line in lines)  # more than 3 with normals
    positions = np.frombuffer(data, "<f4", width * counts[0], end).reshape(-1, width)
    rows = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    faces = np.frombuffer(data, rows, counts[1], end + positions.nbytes)["corners"]
    return np.ascontiguousarray(positions[:, :3]), np.ascontiguousarray(faces)


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


def write_ply(path, positions, faces):
    """Write positions and triangles as binary PLY, as `read_ply` reads them."""
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    data = np.ascontiguousarray(positions, "<f4").tobytes() + rows.tobytes()
    Path(path).write_bytes(head.encode("ascii") + data)


def fast_simplification_simplify(job):
    """Write a mesh of about this many triangles."""
    import fast_simplification

    positions, faces = read_ply(job["mesh"])
    write_ply(
        job["out"], *fast_simplification.simplify(positions, faces, target_count=job["faces"])
    )


def meshoptimizer_simplify(job):
    """Write a mesh of about this many triangles, without a bound on the error."""
    import meshoptimizer

    positions, faces = read_ply(job["mesh"])
    indices = faces.astype(np.uint32).ravel()
    kept = np.zeros_like(indices)
    count = meshoptimizer.simplify(
        kept, indices, positions, target_index_count=3 * job["faces"], target_error=1.0
    )
    used, corners = np.unique(kept[:count], return_inverse=True)
    write_ply(job["out"], positions[used], corners.reshape(-1, 3))


def version(job):
    """Print the version of the library."""
    name = job["program"]
    import_module(name.replace("-", "_"))
    print("VERSION", version_of(name))


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    name = job["task"] if job["task"] == "version" else f"{job['program']}_{job['task']}"
    globals()[name.replace("-", "_")](job)
