"""Do one job with trimesh: `run_trimesh.py JOB`."""

import json
import sys
from importlib.metadata import PackageNotFoundError, version as version_of

import numpy as np
import trimesh


def unwrap(job):
    """Its unwrap is that of xatlas, and takes no size and no gap."""
    mesh = trimesh.load(job["mesh"], process=False)
    made = mesh.unwrap()
    np.savez(
        job["out"], positions=made.vertices, faces=made.faces, corners=made.visual.uv[made.faces]
    )


def simplify(job):
    """Write a mesh of about so many triangles."""
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


def main(text):
    """Do a job."""
    job = json.loads(text)
    globals()[job["task"].replace("-", "_")](job)


if __name__ == "__main__":
    main(sys.argv[1])
