"""Bench Blender: run this with the Python that has `bpy`, or with the one inside Blender.

blender/bin/python integrations/bench/blender.py cases
"""

import json
import sys

from adapter import RUNNERS, do_jobs, launched, parser

FORMS = {"bake-normals": "tangent", "bake-displacement": "positions"}
SUFFIXES = {"bake-normals": ".png", "unwrap": ".npz", "simplify": ".ply", "remesh": ".ply"}


def command_of(job, stem):
    """Return a command that does a job with the script that `texbake bench` uses too."""
    output = stem.with_suffix(SUFFIXES.get(job["task"], ".exr"))
    job = {"method": "smart", **job, "out": str(output)}
    return script(job), output, FORMS.get(job["task"])


def script(job):
    """Return the command of a job."""
    return [sys.executable, RUNNERS / "run_blender.py", json.dumps(job)]


if __name__ == "__main__":
    chosen = parser(__doc__).parse_args()
    lines = launched(script({"task": "version"}), chosen.timeout)["output"].splitlines()
    versions = [line.removeprefix("VERSION ") for line in lines if line.startswith("VERSION ")]
    if not versions:
        sys.exit(f"{sys.executable}: no Blender: {lines[-1] if lines else 'it printed nothing'}")
    do_jobs(chosen, "Blender", versions[-1], command_of)
