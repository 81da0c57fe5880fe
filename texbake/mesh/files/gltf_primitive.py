"""Primitives of glTF meshes: their triangles, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.transform import corner_order, transformed_normals, transformed_tangents
from texbake.mesh.weld import weld_rows

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


@dataclass(frozen=True)
class Piece:
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
    normals : (n, 3) float64, optional
    tangents : (n, 4), optional
    colors : (V, 3) or (V, 4) float32, optional
        Linear.
    """

    positions: FloatArray
    faces: IntArray
    corners: IntArray
    uvs: FloatArray | None
    normals: FloatArray | None
    tangents: npt.NDArray[Any] | None
    colors: npt.NDArray[np.float32] | None

    def placed(self, matrix: FloatArray) -> Piece:
        """Move it; triangles that a mirror turns inside out are turned back."""
        linear = matrix[:3, :3]
        order = corner_order(linear)
        normals, tangents = self.normals, self.tangents
        # A matrix of huge numbers takes finite points to infinity, which `Mesh` refuses.
        with np.errstate(over="ignore", invalid="ignore"):
            return replace(
                self,
                positions=self.positions @ linear.T + matrix[:3, 3],
                faces=self.faces[:, order],
                corners=self.corners[:, order],
                normals=None if normals is None else transformed_normals(normals, linear),
                tangents=None if tangents is None else transformed_tangents(tangents, linear),
            )


def read_primitive(
    document: Document, primitive: dict[str, Any], *, uv_set: int = 0, keeps_colors: bool = False
) -> Piece | None:
    """Triangles of a primitive in the space of its mesh, or None where it has none.

    Parameters
    ----------
    uv_set
        Number of the texture coordinates to read.
    keeps_colors
        Whether vertices at one position stay apart where they differ in color; else the first
        decides.

    Raises
    ------
    FileFormatError
        An attribute is not what its name asks for.
    MeshError
        A number of an attribute is not finite.
    """
    mode = primitive.get("mode", _TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
        return None
    positions = _attribute(document, attributes, "POSITION", (3,), None)
    assert positions is not None
    n = len(positions)
    corners = _triangles(_corner_indices(document, primitive, n), mode)
    uvs = _attribute(document, attributes, f"TEXCOORD_{uv_set}", (2,), n)
    colors = _attribute(document, attributes, "COLOR_0", (3, 4), n)
    told_apart = positions
    if keeps_colors and colors is not None:
        told_apart = np.concatenate([positions, colors], axis=1)
    kept, vertices = np.unique(weld_rows(told_apart + 0.0), return_inverse=True)
    return Piece(
        positions=positions[kept],
        faces=vertices.astype(np.int32)[corners],
        corners=corners,
        uvs=None if uvs is None else np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1),
        normals=_attribute(document, attributes, "NORMAL", (3,), n),
        tangents=_attribute(document, attributes, "TANGENT", (4,), n),
        colors=None if colors is None else colors[kept].astype(np.float32),
    )


def _attribute(
    document: Document,
    attributes: dict[str, Any],
    name: str,
    widths: tuple[int, ...],
    count: int | None,
) -> FloatArray | None:
    """(count, width) float64 values of an attribute, or None where the primitive has none."""
    if name not in attributes:
        return None
    values = document.accessor(attributes[name])
    if values.shape[1] not in widths:
        document.fail(f"{name} has {values.shape[1]} components, not {widths[0]}")
    if count is not None and len(values) != count:
        document.fail(f"{name} counts {len(values)}, where there are {count} positions")
    if not np.isfinite(values).all():  # before the cast, which warns of signaling NaNs
        raise MeshError(f"{document.path}: a number of {name} is not finite; export it again")
    return values.astype(np.float64)


def _corner_indices(
    document: Document, primitive: dict[str, Any], n_vertices: int
) -> npt.NDArray[np.int64]:
    if "indices" not in primitive:
        return np.arange(n_vertices)
    indices = document.accessor(primitive["indices"])
    if indices.shape[1] != 1 or indices.dtype.kind != "u":
        document.fail("indices are not unsigned integers")
    if len(indices) and indices.max() >= n_vertices:
        document.fail(f"an index is out of range ({indices.max()}; there are {n_vertices})")
    return indices[:, 0].astype(np.int64)


def _triangles(indices: npt.NDArray[np.int64], mode: int) -> IntArray:
    """(F, 3) corners of a list, a strip or a fan; an incomplete triangle at the end is dropped."""
    if mode == _TRIANGLES:
        triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    else:
        i = np.arange(max(len(indices) - 2, 0))
        odd = i % 2
        places = (i, i + 1 + odd, i + 2 - odd) if mode == _STRIP else (i + 1, i + 2, 0 * i)
        triangles = indices[np.stack(places, axis=1)]
    return triangles.astype(np.int32)
