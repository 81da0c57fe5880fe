"""Polygons of FBX geometry and the values in its layers, as fields of `Mesh`.

The last corner of a polygon is written as -1 - index. Polygons of fewer than three corners, and
those with a corner that is no vertex, are left out, and so are those that are marked as holes.
Layers hold values for corners, vertices, polygons or the whole, listed or by index; corners whose
index is -1 get zeros. Vertex colors differ from corner to corner; the first of each vertex counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mesh.files.conversion import fan_corners
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.mesh import FloatArray
from texbake.mesh.weld import weld_rows

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FbxGeometry:
    """Triangles in the space of their geometry.

    Attributes
    ----------
    fields : dict
        Fields of `Mesh` but groups and name.
    face_materials : (F,) int64
        Number of each triangle's material among those of the model.
    """

    fields: dict[str, Any]
    face_materials: Indices


def read_geometry(path: PathLike, name: str, node: Node, most: int) -> FbxGeometry | None:
    """Triangles of a node with `Vertices` and `PolygonVertexIndex`; None where there are none.

    `most` corners are read at most, so that an array that packs well cannot fill the memory.

    Raises
    ------
    FileFormatError
        Arrays do not fit together.
    MeshError
        A number is not finite.
    """
    return _Reader(path, name, node, most).read()


class _Reader:
    """A geometry, its corners and polygons."""

    def __init__(self, path: PathLike, name: str, node: Node, most: int) -> None:
        self.path, self.name, self.node = path, name, node
        positions = self.floats(node, "Vertices")
        self.positions = positions[: len(positions) // 3 * 3].reshape(-1, 3)
        indices = node.numbers("PolygonVertexIndex")
        if len(indices) > most:
            self.fail("it has far more corners than its file has bytes for")
        corners = _integers(indices)
        ends = np.flatnonzero(corners < 0)
        # A last polygon that does not end is dropped.
        corners = corners[: ends[-1] + 1 if len(ends) else 0]
        self.sizes = np.diff(ends, prepend=-1)
        self.vertices = np.where(corners < 0, ~corners, corners)
        self.slots, self.polygons = self._triangles()

    def fail(self, what: str) -> None:
        """Raise `FileFormatError`."""
        raise FileFormatError(f"{self.path}: geometry {self.name!r}: {what}; export it again")

    def floats(self, node: Node, name: str) -> FloatArray:
        """(n,) numbers of a child, all finite."""
        values = node.numbers(name)
        with np.errstate(invalid="ignore"):  # NaN that signals is NaN like any other
            values = values.astype(np.float64)
        if not np.isfinite(values).all():
            raise MeshError(
                f"{self.path}: geometry {self.name!r}: a number of {name} is not finite"
            )
        return values

    def _triangles(self) -> tuple[Indices, Indices]:
        """Corners and polygons of the triangles that are kept."""
        slots, polygons = fan_corners(self.sizes)
        is_bad = self.vertices >= len(self.positions)
        bad = np.zeros(len(self.sizes), np.bool_)
        if is_bad.any():
            polygon_of = np.repeat(np.arange(len(self.sizes)), self.sizes)
            bad[polygon_of[is_bad]] = True
        layer = self.node.child("LayerElementHole")
        if layer is not None:
            holes = _integers(layer.numbers("Hole"))[: len(bad)]
            bad[: len(holes)] |= holes != 0
        if not bad.any():
            return slots, polygons
        kept = ~bad[polygons]
        return slots[kept], polygons[kept]

    def read(self) -> FbxGeometry | None:
        """Return the whole."""
        if len(self.slots) == 0:
            return None
        fields: dict[str, Any] = {
            "positions": self.positions,
            "faces": self.vertices[self.slots],
        }
        for layer, values, width, field, corners in (
            ("LayerElementNormal", "Normals", 3, "normals", "normal_faces"),
            ("LayerElementUV", "UV", 2, "uvs", "uv_faces"),
        ):
            found = self._layer(layer, values, width)
            if found is not None:
                fields[field], indices, is_listed = found
                if is_listed:
                    fields[field], indices = self._welded(fields[field], indices)
                fields[corners] = indices[self.slots]
        colors = self._layer("LayerElementColor", "Colors", 4)
        if colors is not None:
            fields["colors"] = self._vertex_colors(*colors[:2])
        return FbxGeometry(fields, self._materials())

    def _layer(self, layer: str, name: str, width: int) -> tuple[FloatArray, Indices, bool] | None:
        """Values, the row of each corner, and whether there is one row for each corner."""
        layers = self.node.named(layer)
        # The first set is that of the least number.
        node = min(layers, key=_number, default=None)
        if node is None:
            return None
        values = self.floats(node, name)
        values = values[: len(values) // width * width].reshape(-1, width)
        places = self._places(node)
        if places is None or len(values) == 0:
            return None
        is_listed = node.child_text("ReferenceInformationType") == "Direct"
        rows = places
        if not is_listed and node.child(f"{name}Index") is not None:
            rows = _looked_up(_integers(node.numbers(f"{name}Index")), places)
        missing = (rows < 0) | (rows >= len(values))
        if missing.all():
            return None
        if missing.any():
            values = np.concatenate([values, np.zeros((1, width))])
            rows = np.where(missing, len(values) - 1, rows)
        return values, rows, is_listed and len(values) >= len(rows)

    def _places(self, node: Node) -> Indices | None:
        """(C,) element that each corner takes its value from."""
        mapping = node.child_text("MappingInformationType")
        if mapping == "ByPolygonVertex":
            return np.arange(len(self.vertices))
        if mapping in ("ByVertice", "ByVertex", "ByControlPoint"):
            return self.vertices
        if mapping == "ByPolygon":
            return np.repeat(np.arange(len(self.sizes)), self.sizes)
        return np.zeros_like(self.vertices) if mapping == "AllSame" else None

    def _welded(self, values: FloatArray, rows: Indices) -> tuple[FloatArray, Indices]:
        """Make one row of equal values of one vertex."""
        listed = values[rows]
        keys = np.concatenate([self.vertices[:, None].astype(np.float64), listed], axis=1)
        kept, rows = np.unique(weld_rows(keys + 0.0), return_inverse=True)
        return listed[kept], rows

    def _vertex_colors(self, values: FloatArray, rows: Indices) -> npt.NDArray[np.float32]:
        """(V, 4) colors, white where no corner is."""
        colors = np.ones((len(self.positions), 4), np.float32)
        used = self.slots.ravel()[::-1]
        with np.errstate(over="ignore"):  # `Mesh` refuses what is not finite
            colors[self.vertices[used]] = values[rows[used]]
        return colors

    def _materials(self) -> Indices:
        """(F,) material of each triangle."""
        node = self.node.child("LayerElementMaterial")
        ids = _integers(node.numbers("Materials")) if node is not None else np.zeros(0, np.int64)
        if node is None or len(ids) == 0:
            return np.zeros(len(self.polygons), np.int64)
        is_by_polygon = node.child_text("MappingInformationType") == "ByPolygon"
        return _looked_up(ids, self.polygons if is_by_polygon else 0 * self.polygons)


def _looked_up(table: Indices, places: Indices) -> Indices:
    """Return the entries at the places, -1 where the table ends before."""
    found = np.full(places.shape, -1, np.int64)
    is_inside = places < len(table)
    found[is_inside] = table[places[is_inside]]
    return found


def _integers(values: npt.NDArray[Any]) -> Indices:
    """Return values as integers; any other value becomes an integer that no array has."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    with np.errstate(invalid="ignore"):
        is_sound = np.abs(values) < 2.0**53
        return np.where(is_sound, values, 2.0**53).astype(np.int64)


def _number(layer: Node) -> int:
    number = layer.values[0] if layer.values else 0
    return number if isinstance(number, int) else 0
