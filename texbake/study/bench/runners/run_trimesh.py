"""Do one job with trimesh: `run_trimesh.py JOB`."""

from importlib.metadata import PackageNotFoundError, version as version_of

import numpy as np
import trimesh
from runner_job import do_job


def unwrap(job):
    """Its unwrap is that of xatlas, and takes no size and no gap."""
    mesh = trimesh.load(job["mesh"], process=False)
    made = mesh.unwrap()
    np.savez(
        job["out"], positions=made.vertices, faces=made.faces, corners=made.visual.uv[made.faces]
    )


def simplify(job):
    """Write a mesh of about this many triangles."""
    mesh = trimesh.load(job["mesh"], process=False)
    mesh.simplify_quadric_decimation(face_count=job["faces"]).export(job["out"])


def version(job):
    """Print the version."""
    parts = []
    for name in "fast-simplification", "xatlas":
        try:
            parts.append(f"with {name} {version_of(name)}")
        except PackageNotFoundError:
            parts.append(f"without {name}")
    print("VERSION", f"{version_of('trimesh')} ({', '.join(parts)})")


if __name__ == "__main__":
    do_job(globals())
