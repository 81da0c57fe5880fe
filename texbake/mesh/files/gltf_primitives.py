"""Triangles of a glTF primitive, in the space of its mesh.

Vertices at the same position, bit for bit, become one, because the format splits them where a
normal or a coordinate differs; these keep their own indices, so that nothing is lost (except where
such vertices differ in color: then the first decides). Points and lines are skipped. Primitives
compressed by Draco are read where DracoPy is installed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError, quoted, warn_of
from texbake.mesh.files.conversion import (
    finite_rows,
    rows_not_finite,
    strip_triangles,
    warn_unused,
)
from texbake.mesh.files.gltf_compression import DRACO, decode_draco
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_nodes import FAN, INDICES, STRIP, TRIANGLES
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows

_FIELDS = {"NORMAL": "normals", "TEXCOORD": "uvs", "COLOR": "colors"}


@dataclass(frozen=True)
class PrimitiveMesh:
    """Triangles of a primitive.

    Attributes
    ----------
    positions : (V, 3) float64
        No two are equal, bit for bit (unless they differ in color, where that is kept).
    faces : (F, 3) int32
        Indices into `positions`, and into `colors`.
    corners : (F, 3) int32
        Indices into all other attributes.
    uvs : (n, 2) float64, optional
        v turned up.
    further_uvs : mapping of int to (n, 2) float64
        Further sets, by their numbers.
    normals : (n, 3) float64, optional
    tangents : (n, 4), optional
    colors : (V, 3) or (V, 4) float32, optional
        Linear.
    """

    positions: FloatArray
    faces: IntArray
    corners: IntArray
    uvs: FloatArray | None
    further_uvs: Mapping[int, FloatArray]
    normals: FloatArray | None
    tangents: npt.NDArray[Any] | None
    colors: npt.NDArray[np.float32] | None


def read_primitive(
    document: Document,
    primitive: dict[str, Any],
    *,
    uv_set: int = 0,
    further: Collection[int] = (),
    keeps_colors: bool = False,
) -> PrimitiveMesh | None:
    """Triangles of a primitive in the space of its mesh, or None where it has none."""
    mode = primitive.get("mode", TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
        return None
    arrays = _primitive_arrays(document, primitive, attributes)
    positions = _attribute(document, arrays, "POSITION", (3,), None)
    assert positions is not None
    n = len(positions)
    # Draco has made triangles of a strip.
    mode = TRIANGLES if arrays.decoded else mode
    corners = _triangles(_corner_indices(document, arrays, n), mode)
    positions = _finite_positions(document, positions, corners)
    uvs = _attribute(document, arrays, f"TEXCOORD_{uv_set}", (2,), n)
    others = {
        number: _attribute(document, arrays, f"TEXCOORD_{number}", (2,), n) for number in further
    }
    colors = _attribute(document, arrays, "COLOR_0", (3, 4), n)
    keys = positions
    if keeps_colors and colors is not None:
        keys = np.concatenate([positions, colors], axis=1)
    firsts = weld_rows(keys)
    is_kept = firsts == np.arange(len(firsts))
    kept, vertices = np.flatnonzero(is_kept), (np.cumsum(is_kept, dtype=np.int32) - 1)[firsts]
    return PrimitiveMesh(
        positions=positions[kept],
        faces=vertices[corners],
        corners=corners,
        uvs=turned_up(uvs),
        further_uvs={
            i: rows
            for i, rows in ((i, turned_up(o)) for i, o in others.items())
            if rows is not None
        },
        normals=_attribute(document, arrays, "NORMAL", (3,), n),
        tangents=_attribute(document, arrays, "TANGENT", (4,), n),
        colors=None if colors is None else colors[kept].astype(np.float32),
    )


def primitive_uvs(document: Document, primitive: dict[str, Any], uv_set: int) -> FloatArray | None:
    """(n, 2) float64: a set of texture coordinates of a primitive, v turned up; None without it."""
    attributes = document.mapping(primitive, "attributes")
    arrays = _primitive_arrays(document, primitive, attributes)
    return turned_up(_attribute(document, arrays, f"TEXCOORD_{uv_set}", (2,), None))


def turned_up(uvs: FloatArray | None) -> FloatArray | None:
    """(n, 2) texture coordinates of the file with v up; None where there are none."""
    return None if uvs is None else np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


@dataclass(frozen=True, eq=False)
class _PrimitiveArrays:
    """Arrays of a primitive by their names, `indices` among them.

    Attributes
    ----------
    accessors
        Accessor of each.
    decoded
        Those that a compressed primitive holds in their place.
    """

    document: Document
    accessors: dict[str, Any]
    decoded: dict[str, npt.NDArray[Any]]

    def read(self, name: str) -> npt.NDArray[Any]:
        """(count, width) values."""
        if name not in self.decoded:
            return self.document.accessor(self.accessors[name])
        if self.accessors[name] is None:
            return self.decoded[name]
        return self.document.denormalized(self.accessors[name], self.decoded[name])


def _primitive_arrays(
    document: Document, primitive: dict[str, Any], attributes: dict[str, Any]
) -> _PrimitiveArrays:
    accessors = dict(attributes)
    if INDICES in primitive:
        accessors[INDICES] = primitive[INDICES]
    draco = document.mapping(document.mapping(primitive, "extensions"), DRACO)
    # A file may hold the same arrays uncompressed, for programs that do not read Draco.
    if not draco or "bufferView" in document.item("accessors", attributes["POSITION"]):
        return _PrimitiveArrays(document, accessors, {})
    decoded = decode_draco(document.view_bytes(draco.get("bufferView")))
    if isinstance(decoded, str):
        document.fail(decoded)
    rows, indices = decoded
    numbers = document.mapping(draco, "attributes")
    arrays = {}
    for name, number in numbers.items():
        if type(number) is not int or number not in rows:
            document.fail(f"a primitive compressed by Draco has no attribute {quoted(number)}")
        arrays[name] = rows[number]
    return _PrimitiveArrays(
        document,
        {INDICES: None, **accessors},
        {**arrays, INDICES: indices.reshape(-1, 1)},
    )


def _attribute(
    document: Document,
    arrays: _PrimitiveArrays,
    name: str,
    widths: tuple[int, ...],
    count: int | None,
) -> FloatArray | None:
    """(count, width) float64 values of an attribute, or None where the primitive has none."""
    if name not in arrays.accessors:
        return None
    values = arrays.read(name)
    if values.shape[1] not in widths:
        document.fail(f"{name} has {values.shape[1]} components, not {widths[0]}")
    if count is not None and len(values) != count:
        document.fail(f"{name} counts {len(values)}, where there are {count} positions")
    with np.errstate(invalid="ignore"):  # a signaling NaN is read like any other NaN
        values = values.astype(np.float64)
    if name == "POSITION":
        return values
    if name == "TANGENT":
        return _finite_tangents(document, values)
    return finite_rows(document.path, values, _FIELDS[name.partition("_")[0]])


def _finite_positions(document: Document, positions: FloatArray, corners: IntArray) -> FloatArray:
    """Return positions; a used position replaces unused ones that are not finite."""
    is_bad = rows_not_finite(positions)
    if not is_bad.any():
        return positions
    if len(corners) == 0 or is_bad[corners].any():
        raise MeshError(f"{document.path}: a value of POSITION is not finite; export it again")
    warn_unused(document.path, f"{np.count_nonzero(is_bad):,} of {len(positions):,}")
    return np.where(is_bad[:, None], positions[corners[0, 0]], positions)


def _finite_tangents(document: Document, tangents: FloatArray) -> FloatArray | None:
    if np.isfinite(tangents).all():
        return tangents
    warn_of(document.path, "some tangents are not finite; computed ones replace all of them")
    return None


def _corner_indices(
    document: Document, arrays: _PrimitiveArrays, n_vertices: int
) -> npt.NDArray[np.int64]:
    if INDICES not in arrays.accessors:
        return np.arange(n_vertices)
    indices = arrays.read(INDICES)
    if indices.shape[1] != 1 or indices.dtype.kind != "u":
        document.fail("indices are not unsigned integers")
    if len(indices) and indices.max() >= n_vertices:
        document.fail(f"an index is out of range ({indices.max()}; there are {n_vertices})")
    return indices[:, 0].astype(np.int64)


def _triangles(indices: npt.NDArray[np.int64], mode: int) -> IntArray:
    """(F, 3) corners of a list, a strip or a fan; an incomplete triangle at the end is dropped."""
    if mode == TRIANGLES:
        triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    elif mode == STRIP:
        triangles = strip_triangles(indices)
    else:
        i = np.arange(max(len(indices) - 2, 0))
        triangles = indices[np.stack((i + 1, i + 2, 0 * i), axis=1)]
    return triangles.astype(np.int32)
