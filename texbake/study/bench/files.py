"""The mesh files that all programs read: PLY and OBJ, without normals, with float32 positions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texbake.mesh.files import write_mesh
from texbake.mesh.mesh import Mesh
from texbake.study.bench.cases import BenchCase


def pair_files(case: BenchCase, folder: Path) -> dict[str, str]:
    """Return the paths of the high-poly mesh (`high`) and the low-poly one (`low`), written once.

    The high-poly mesh is binary PLY, the low-poly one OBJ with texture coordinates.
    """
    return {
        "high": mesh_file(case.high, folder, f"{case.name} high"),
        "low": _written(case.low, folder / f"{case.name} low.obj"),
    }


def mesh_file(mesh: Mesh, folder: Path, name: str) -> str:
    """Return the path of a mesh as binary PLY, without texture coordinates, written once."""
    return _written(mesh.replace(uvs=None, uv_faces=None), folder / f"{name}.ply")


def _written(mesh: Mesh, path: Path) -> str:
    if not path.exists():
        positions = mesh.positions.astype(np.float32)
        write_mesh(mesh.replace(positions=positions), path)
    return str(path)
