"""What peers are given to draw: one mesh, one camera, one directional light, as plain arrays.

Peers are programs of one form: `python PEER.py JOB.npz ... -o FOLDER` writes FOLDER/JOB.npy for
each, (H, W, 4) float32, linear light, row 0 at the top. One that is not to be had on a machine
exits with code 3 and says in one line what is missing.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

UNAVAILABLE = 3  # exit code


class UnavailableError(Exception):
    """The peer cannot be had on this machine."""


@dataclass(kw_only=True, eq=False)
class Job:
    """What a file of a job holds, by these names.

    Vertices carry all attributes at one index. Images are rows down from the top; texture
    coordinates have (0, 0) at the lower left. A color image of uint8 is sRGB, one of float32
    linear. Normal maps hold (n + 1) / 2. Colors are linear. A white surface that faces the light
    reflects `light`.
    """

    positions: np.ndarray  # (V, 3)
    faces: np.ndarray  # (F, 3)
    clip_from_world: np.ndarray  # (4, 4), depth from 1 at the near plane to 0 at infinity
    eye: np.ndarray  # (3,)
    axes: np.ndarray  # (3, 3): rows right, up, back
    width: int
    height: int
    shading: str = "unlit"  # or lambert, blinn-phong
    normals: np.ndarray | None = None  # (V, 3)
    uvs: np.ndarray | None = None  # (V, 2)
    tangents: np.ndarray | None = None  # (V, 4)
    base_map: np.ndarray | None = None  # (H, W, 3)
    normal_map: np.ndarray | None = None  # (H, W, 3)
    filter: str = "trilinear"  # or bilinear, nearest
    base_color: tuple[float, ...] = (1.0, 1.0, 1.0)
    specular: tuple[float, ...] = (0.0, 0.0, 0.0)
    exponent: float = 1.0
    to_light: tuple[float, ...] = (0.0, 0.0, 1.0)
    light: tuple[float, ...] = (1.0, 1.0, 1.0)
    ambient: tuple[float, ...] = (0.0, 0.0, 0.0)
    samples: int = 1
    # Mip levels as OpenGL defines them; else as it lets graphics cards simplify them.
    exact_levels: bool = False

    @property
    def opengl_from_world(self):
        """(4, 4): to clip space as OpenGL has it, depth from -w at the near plane to w."""
        matrix = self.clip_from_world.copy()
        matrix[2] = matrix[3] - 2.0 * matrix[2]
        return matrix


def read_job(path):
    """Read a job; what it does not hold has its default."""
    known = {field.name for field in fields(Job)}
    with np.load(path) as arrays:
        values = {name: arrays[name] for name in arrays.files if name in known}
    return Job(
        **{name: value.item() if value.ndim == 0 else value for name, value in values.items()}
    )


def draw_files(description, draw_all):
    """Draw the jobs that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("jobs", nargs="+", type=Path)
    parser.add_argument("-o", dest="folder", type=Path, required=True)
    arguments = parser.parse_args()
    try:
        pictures = draw_all(arguments.jobs)
        for path, picture in zip(arguments.jobs, pictures, strict=True):
            np.save(arguments.folder / f"{path.stem}.npy", picture)
    except UnavailableError as error:
        print(error, file=sys.stderr)
        return UNAVAILABLE
    return 0
