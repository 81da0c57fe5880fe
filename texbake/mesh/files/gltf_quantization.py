"""Vertices of glTF files as 8- and 16-bit integers (KHR_mesh_quantization).

Positions are steps of one uniform grid for the whole file, so that what was one point in several
primitives still is. The node has its place and its step. Normals, tangents and colors are 8-bit
fractions. Texture coordinates in the unit square are 16-bit fractions; those that leave it are
fractions of a greater square, which KHR_texture_transform puts back into place. They stay floats
where that square is so large that steps would be seen, or where no texture can carry the transform.

Based on: Khronos Group, "KHR_mesh_quantization", 2020.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import FloatArray, Mesh

EXTENSION = "KHR_mesh_quantization"
_STEPS = 65535
# The greatest square of texture coordinates: its steps are an eighth of a texel of 2048.
_MAX_SIDE = 4.0


@dataclass(frozen=True, eq=False)
class Grid:
    """Points of a grid, counted by 16-bit integers from its corner.

    Attributes
    ----------
    corner : (D,) float64
    """

    corner: FloatArray
    step: float

    @classmethod
    def around(cls, low: FloatArray, high: FloatArray) -> Grid:
        """Grid over a box; of a box without size every point is the corner."""
        side = float((high - low).max())
        return cls(low, side / _STEPS if side > 0.0 else 1.0)

    def codes(self, values: FloatArray) -> npt.NDArray[np.uint16]:
        """Nearest points of the grid, at most half a step away along each axis."""
        steps = np.rint((values - self.corner) / self.step)
        return np.clip(steps, 0, _STEPS).astype(np.uint16)


@dataclass(frozen=True, eq=False)
class Quantization:
    """The grids of a file.

    Attributes
    ----------
    uv_grids : mapping of int to Grid
        Of sets of texture coordinates that leave the unit square, v down; None where they stay
        floats.
    """

    positions: Grid
    uv_grids: Mapping[int, Grid | None] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def of(cls, meshes: Sequence[Mesh], materials: Materials | None) -> Quantization:
        """Grids for the meshes of a file; `materials` are those of the first."""
        bounds = np.array([mesh.bounds for mesh in meshes])
        if np.abs(bounds).max() > np.finfo(np.float32).max:
            name = meshes[0].name
            raise MeshError(f"{name}: a coordinate is beyond float32; scale it down first")
        sets = {0: [mesh.uvs for mesh in meshes if mesh.uvs is not None]}
        images: set[int] = set()
        if materials is not None:
            sets |= {number: [uvs] for number, uvs in materials.uv_sets.items()}
            images = materials.image_uv_sets
        grids = {
            uv_set: _uv_grid(np.concatenate(uvs), can_move=uv_set in images)
            for uv_set, uvs in sets.items()
            if len(uvs) and not _is_in_square(uvs)
        }
        return cls(Grid.around(bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)), grids)

    def place(self) -> dict[str, Any]:
        """Fields of a node that take codes of positions to the scene."""
        return {
            "translation": self.positions.corner.tolist(),
            "scale": [self.positions.step] * 3,
        }

    def uvs(self, uv_set: int, turned: FloatArray) -> npt.NDArray[Any]:
        """Codes of texture coordinates, v down; floats of a set that stays as it is."""
        grid = self.uv_grids.get(uv_set, _UNIT_SQUARE)
        return turned.astype(np.float32) if grid is None else grid.codes(turned)

    def uv_matrices(self) -> dict[int, FloatArray]:
        """Matrices that take fractions of a greater square to its texture coordinates, v down."""
        matrices = {}
        for uv_set, grid in self.uv_grids.items():
            if grid is not None:
                matrix: FloatArray = np.diag([grid.step * _STEPS, grid.step * _STEPS, 1.0])
                matrix[:2, 2] = grid.corner
                matrices[uv_set] = matrix
        return matrices


_UNIT_SQUARE = Grid(np.zeros(2), 1.0 / _STEPS)


def unit_codes(values: npt.NDArray[Any]) -> npt.NDArray[np.int8]:
    """Components in [-1, 1] as normalized signed bytes."""
    return np.rint(127.0 * values).astype(np.int8)


def color_codes(values: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Components in [0, 1] as normalized bytes."""
    return np.rint(255.0 * values).astype(np.uint8)


def _is_in_square(uvs: Sequence[FloatArray]) -> bool:
    return all(len(rows) == 0 or (rows.min() >= 0.0 and rows.max() <= 1.0) for rows in uvs)


def _uv_grid(uvs: FloatArray, *, can_move: bool) -> Grid | None:
    """Grid over a square around texture coordinates; None where they stay floats."""
    turned = np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)
    low, high = turned.min(axis=0), turned.max(axis=0)
    return Grid.around(low, high) if can_move and (high - low).max() <= _MAX_SIDE else None
