"""Compressed parts of glTF files: views by meshoptimizer, primitives by Draco, quantized vertices.

Codes of meshoptimizer are lossless, except that a triangle may begin with another of its corners.
`gltf_primitives` reads Draco.

Positions are 16-bit steps of one grid for the whole file, so that what was one point in several
primitives still is; the node has its place and its step. Instances have a grid of their own.
Normals, tangents and colors are 8-bit fractions, in compressed files also points of an octahedron,
which take fewer bytes and have about twice the error. Texture coordinates are 16-bit fractions of a
square that KHR_texture_transform puts back into place, and floats where steps would be seen, or no
texture can carry it.

Based on:
    Arseny Kapoulkine, "EXT_meshopt_compression", Khronos vendor extension, 2021, whose bitstreams
        are version 0 of vertices and version 1 of indices;
    Khronos Group, "KHR_draco_mesh_compression", 2018, and "KHR_mesh_quantization", 2020.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError, quoted, require_library
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import AnyArray, ByteArray, FloatArray, Int64Array, Mesh
from texbake.records import dataclass

EXTENSION = "EXT_meshopt_compression"
DRACO = "KHR_draco_mesh_compression"
QUANTIZATION = "KHR_mesh_quantization"
ATTRIBUTES, TRIANGLES, INDICES = "ATTRIBUTES", "TRIANGLES", "INDICES"
OCTAHEDRAL = "OCTAHEDRAL"
_FILTERS = {OCTAHEDRAL: "decode_filter_oct", "QUATERNION": "decode_filter_quat",
            "EXPONENTIAL": "decode_filter_exp"}  # fmt: skip
# The least that a byte of a vertex can be coded to is a 64th of a byte, and of an index more; the
# header of a block is what 1024 bytes leave room for.
_GREATEST_RATIO, _HEAD = 64, 1024


def encode_vertices(values: AnyArray) -> bytes:
    """Bytes of the rows of an array, each of a multiple of four bytes, at most 256."""
    meshoptimizer = _library()
    meshoptimizer.encode_vertex_version(0)  # the library's state, so said each time
    return bytes(meshoptimizer.encode_vertex_buffer(np.ascontiguousarray(values)))


def encode_triangles(indices: AnyArray, n_vertices: int) -> bytes:
    """Bytes of corner indices (3 F,); each triangle may come back with another corner first."""
    meshoptimizer = _library()
    meshoptimizer.encode_index_version(1)
    flat = np.ascontiguousarray(indices, np.uint32).ravel()
    return bytes(meshoptimizer.encode_index_buffer(flat, len(flat), n_vertices))


def ordered_triangles(indices: Int64Array, n_vertices: int) -> tuple[Int64Array, Int64Array]:
    """Triangles (3 F,) in an order of strips, which compresses better, and old vertices (n,)."""
    given = np.ascontiguousarray(indices, np.uint32)
    codes = np.empty_like(given)
    _library().optimize_vertex_cache_strip(codes, given, len(given), n_vertices)
    ordered = codes.astype(np.int64)
    used, firsts = np.unique(ordered, return_index=True)
    vertices = used[np.argsort(firsts, kind="stable")]
    places = np.empty(n_vertices, np.int64)
    places[vertices] = np.arange(len(vertices))
    return places[ordered], vertices


def decode_view(
    data: ByteArray, *, mode: str, filter_name: str, count: int, stride: int
) -> ByteArray | str:
    """(count * stride,) bytes of a compressed view (n,), or in words why there are none."""
    if count * stride > _GREATEST_RATIO * len(data) + _HEAD:
        return f"a compressed view claims {count * stride} bytes, more than {len(data)} can hold"
    if mode == ATTRIBUTES:
        if stride % 4 or not 0 < stride <= 256:
            return f"a compressed view has a stride of {stride} bytes, which vertices cannot have"
    elif mode not in (TRIANGLES, INDICES) or stride not in (2, 4):
        return f"a compressed view of mode {quoted(mode)} and stride {stride} is not known"
    if filter_name != "NONE" and (filter_name not in _FILTERS or mode != ATTRIBUTES):
        return f"the filter {quoted(filter_name)} of a compressed view is not known"
    if mode == TRIANGLES and count % 3:
        return f"a compressed view has {count} corners, which is not a multiple of 3"
    if filter_name == OCTAHEDRAL and stride not in (4, 8):
        return f"octahedral normals of {stride} bytes are not known"
    if filter_name == "QUATERNION" and stride != 8:
        return f"rotations of {stride} bytes are not known"
    if count == 0:
        return np.zeros(0, np.uint8)
    meshoptimizer, content = _library(), data.tobytes()
    try:
        if mode == ATTRIBUTES:
            kind = np.dtype((np.void, stride))
            rows = meshoptimizer.decode_vertex_buffer(count, stride, content, dtype=kind)
            if filter_name != "NONE":
                rows = getattr(meshoptimizer, _FILTERS[filter_name])(rows, count, stride)
        elif mode == TRIANGLES:
            rows = meshoptimizer.decode_index_buffer(count, stride, content)
        else:
            rows = meshoptimizer.decode_index_sequence(count, stride, content)
    except (RuntimeError, ValueError):
        return "a compressed view is damaged"
    # Of 16-bit indices the first half of the array is filled.
    return np.frombuffer(rows.tobytes()[: count * stride], np.uint8)


def require_compression() -> None:
    """Raise where the library that compresses is missing."""
    _library()


def _library() -> Any:
    return require_library("meshoptimizer", "glTF", '"texbake[meshoptimizer]"')


MOST_STEPS = 65535
# Least steps along a side, unless it is as short as the rounding of float32 along the longest.
_LEAST_STEPS, _FLAT = 64, 1e-7
# The greatest square of texture coordinates: its steps are an eighth of a texel of 2048.
_MAX_SIDE = 4.0
# Where they may be coarse: a quarter of a texel of 1024, or a texel if an image repeats four times.
_COARSE_STEPS, _FEW_REPEATS = 4096, 4.0


@dataclass(frozen=True, eq=False)
class Grid:
    """Points of a grid, counted by 16-bit integers from its corner."""

    corner: FloatArray  # (D,) float64
    step: float

    @classmethod
    def around(cls, low: FloatArray, high: FloatArray, n_steps: int = MOST_STEPS) -> Grid:
        """Grid over a box; of a box without size every point is the corner."""
        side = float((high - low).max())
        return cls(low, side / n_steps if side > 0.0 else 1.0)

    def codes(self, values: FloatArray) -> npt.NDArray[np.uint16]:
        """Nearest points of the grid, at most half a step away along each axis."""
        steps = np.rint((values - self.corner) / self.step)
        return np.clip(steps, 0, MOST_STEPS).astype(np.uint16)

    def place(self) -> dict[str, Any]:
        """Fields of a node that take codes of positions to where they are."""
        return {"translation": self.corner.tolist(), "scale": [self.step] * 3}

    def matrix(self) -> FloatArray:
        """(4, 4) float64: matrix that takes codes of positions to where they are."""
        matrix: FloatArray = np.diag([self.step] * 3 + [1.0])
        matrix[:3, 3] = self.corner
        return matrix


@dataclass(frozen=True, eq=False)
class Quantization:
    """The grids of a file."""

    positions: Grid
    # Of sets of texture coordinates that leave the unit square, v down; None where they stay
    # floats.
    uv_grids: Mapping[int, Grid | None] = field(default_factory=lambda: MappingProxyType({}))
    is_octahedral: bool = False  # whether normals and tangents are

    @staticmethod
    def would_flatten(meshes: Sequence[Mesh]) -> bool:
        """Whether a side of the meshes is so much shorter than the longest that steps show."""
        bounds = np.array([mesh.bounds for mesh in meshes])
        sides = bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)
        thin = _LEAST_STEPS / MOST_STEPS * sides.max()
        return bool(((sides > _FLAT * sides.max()) & (sides < thin)).any())

    @classmethod
    def of(
        cls, meshes: Sequence[Mesh], materials: Materials | None, *, is_coarse: bool = False
    ) -> Quantization:
        """Grids for the meshes of a file; `materials` are those of the first.

        With `is_coarse`, texture coordinates have 4,096 steps over the unit square or more, and
        normals are octahedral.
        """
        bounds = np.array([mesh.bounds for mesh in meshes])
        if np.abs(bounds).max() > np.finfo(np.float32).max:
            name = meshes[0].name
            raise MeshError(f"{name}: a coordinate is beyond float32; scale it down first")
        sets = {0: [mesh.uvs for mesh in meshes if mesh.uvs is not None]}
        images: set[int] = set()
        if materials is not None:
            sets |= {number: [uvs] for number, uvs in materials.uv_sets.items()}
            images = materials.image_uv_sets
        uv_steps = _coarse_steps(materials) if is_coarse and materials else MOST_STEPS
        grids: dict[int, Grid | None] = {}
        for uv_set, parts in sets.items():
            rows = np.concatenate([np.zeros((0, 2)), *parts])
            is_inside = len(rows) == 0 or (rows.min() >= 0.0 and rows.max() <= 1.0)
            if is_inside and (len(rows) == 0 or uv_steps >= MOST_STEPS or uv_set not in images):
                continue
            turned = np.stack([rows[:, 0], 1.0 - rows[:, 1]], axis=1)
            low, high = turned.min(axis=0), turned.max(axis=0)
            side = float((high - low).max())
            is_moved = uv_set in images and side <= _MAX_SIDE
            n_steps = min(MOST_STEPS, max(1, math.ceil(side * uv_steps)))
            grids[uv_set] = Grid.around(low, high, n_steps) if is_moved else None
        box = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        return cls(Grid.around(*box), grids, is_coarse)

    def uvs(self, uv_set: int, turned: FloatArray) -> AnyArray:
        """Codes of texture coordinates, v down; floats of a set that stays as it is."""
        grid = self.uv_grids.get(uv_set, _UNIT_SQUARE)
        return turned.astype(np.float32) if grid is None else grid.codes(turned)

    def uv_matrices(self) -> dict[int, FloatArray]:
        """Matrices that take fractions of a greater square to its texture coordinates, v down."""
        matrices = {}
        for uv_set, grid in self.uv_grids.items():
            if grid is not None:
                matrix: FloatArray = np.diag([grid.step * MOST_STEPS, grid.step * MOST_STEPS, 1.0])
                matrix[:2, 2] = grid.corner
                matrices[uv_set] = matrix
        return matrices


def _coarse_steps(materials: Materials) -> float:
    """Steps over the unit square of texture coordinates, more where images repeat often."""
    images = (image for material in materials.materials for image in material.images)
    scales = [abs(number) for image in images for row in image.placing for number in row[:2]]
    return _COARSE_STEPS * max(1.0, max(scales, default=1.0) / _FEW_REPEATS)


_UNIT_SQUARE = Grid(np.zeros(2), 1.0 / MOST_STEPS)


def unit_codes(values: AnyArray) -> npt.NDArray[np.int8]:
    """Components in [-1, 1] as normalized signed bytes."""
    return np.rint(127.0 * values).astype(np.int8)


def octahedral_codes(values: AnyArray) -> npt.NDArray[np.int8]:
    """(n, 4) bytes that the filter for octahedral normals decodes to directions (n, 3 or 4)."""
    directions = values[:, :3].astype(np.float64)
    directions /= np.abs(directions).sum(axis=1, keepdims=True)
    flat, away = directions[:, :2], directions[:, 2:] < 0.0
    folded = (1.0 - np.abs(flat[:, ::-1])) * np.where(flat < 0.0, -1.0, 1.0)
    codes = np.zeros((len(values), 4), np.int8)
    codes[:, :2] = unit_codes(np.where(away, folded, flat))
    codes[:, 2] = 127
    codes[:, 3:] = unit_codes(values[:, 3:]) if values.shape[1] == 4 else 0
    return codes


def color_codes(values: AnyArray) -> ByteArray:
    """Components in [0, 1] as normalized bytes."""
    return np.rint(255.0 * values).astype(np.uint8)
