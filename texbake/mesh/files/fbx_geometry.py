"""Polygons of FBX geometry and the values in its layers, as fields of `Mesh`.

The last corner of a polygon is written as -1 - index. Polygons of fewer than three corners, and
those with a corner that is no vertex, are left out, and so are those that are marked as holes.
Layers hold values for corners, vertices, polygons or the whole, listed or by index; corners whose
index is -1 get zeros. Vertex colors differ from corner to corner; the first of each vertex counts.
Of several sets of texture coordinates the first is that of the mesh; sets that textures name are
read besides, in rows that all sets share. Where there are no normals, smoothing makes some.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, MeshError, quoted, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import finite_rows, rows_not_finite
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.mesh import FloatArray
from texbake.mesh.polygons import triangulated
from texbake.mesh.smoothing_groups import Polygons, smoothed_normals
from texbake.mesh.weld import weld_rows

Indices = npt.NDArray[np.int64]
# Values, the row of each corner, and whether there is one row for each corner.
_Layer = tuple[FloatArray, Indices, bool]
_MOST_UV_SETS = 8
_FIELDS = {"Normals": "normals", "UV": "uvs", "Colors": "colors"}


@dataclass(frozen=True, eq=False)
class FbxGeometry:
    """Triangles in the space of their geometry.

    Attributes
    ----------
    fields : dict
        Fields of `Mesh` but groups and name.
    face_materials : (F,) int64
        Number of each triangle's material among those of the model.
    uv_sets : dict of str to (T, 2) float64
        Sets of texture coordinates after the first, by their names, in the rows of the first.
    """

    fields: dict[str, Any]
    face_materials: Indices
    uv_sets: dict[str, FloatArray] = field(default_factory=dict)


def read_geometry(
    path: PathLike, name: str, node: Node, most: int, uv_names: Collection[str] = ()
) -> FbxGeometry | None:
    """Triangles of a node with `Vertices` and `PolygonVertexIndex`; None where there are none.

    `most` corners are read at most, so that an array that packs well cannot fill the memory. Of the
    sets of texture coordinates after the first, those are read that `uv_names` has.
    """
    return _Reader(path, name, node, most).read(uv_names)


class _Reader:
    """A geometry, its corners and polygons."""

    def __init__(self, path: PathLike, name: str, node: Node, most: int) -> None:
        self.path, self.name, self.node = path, name, node
        positions = _floats(node, "Vertices")
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
        raise FileFormatError(f"{self.path}: geometry {quoted(self.name)}: {what}; export it again")

    def _triangles(self) -> tuple[Indices, Indices]:
        """Corners and polygons of the triangles that are kept."""
        where = f"{self.path}: geometry {quoted(self.name)}"
        slots, polygons = triangulated(where, self.positions, self.vertices, self.sizes)
        is_bad = self.vertices >= len(self.positions)
        bad = np.zeros(len(self.sizes), np.bool_)
        if is_bad.any():
            polygon_of = np.repeat(np.arange(len(self.sizes)), self.sizes)
            bad[polygon_of[is_bad]] = True
            n_bad = int(np.count_nonzero(bad))
            noun = "face" if n_bad == 1 else "faces"
            warn_of(where, f"left out {n_bad:,} {noun} with corners that are no vertices")
        layer = self.node.child("LayerElementHole")
        if layer is not None:
            holes = _integers(layer.numbers("Hole"))[: len(bad)]
            bad[: len(holes)] |= holes != 0
        if not bad.any():
            return slots, polygons
        kept = ~bad[polygons]
        return slots[kept], polygons[kept]

    def read(self, uv_names: Collection[str]) -> FbxGeometry | None:
        """Return the whole."""
        if len(self.slots) == 0:
            return None
        is_bad = rows_not_finite(self.positions)
        if is_bad.any() and is_bad[self.vertices[self.slots]].any():
            raise MeshError(
                f"{self.path}: geometry {quoted(self.name)}: a value of Vertices is not finite"
            )
        fields: dict[str, Any] = {
            "positions": self.positions,
            "faces": self.vertices[self.slots],
            "polygon_of": self.polygons,
        }
        normals = self._layer(self._first("LayerElementNormal"), "Normals", 3)
        if normals is not None:
            fields["normals"], rows = self._welded(normals)
            fields["normal_faces"] = rows[self.slots]
        else:
            fields |= self._smoothing()
        sets = self._uv_sets(uv_names)
        if sets is not None:
            (fields["uvs"], *_), rows, _ = sets
            fields["uv_faces"] = rows[self.slots]
        colors = self._layer(self._first("LayerElementColor"), "Colors", 4)
        if colors is not None:
            fields["colors"] = self._vertex_colors(*colors[:2])
        further = {} if sets is None else dict(zip(sets[2], sets[0][1:], strict=True))
        return FbxGeometry(fields, self._materials(), further)

    def _first(self, layer: str) -> Node | None:
        """Return the layer of the least number."""
        return min(self.node.named(layer), key=_number, default=None)

    def _uv_sets(
        self, names: Collection[str]
    ) -> tuple[list[FloatArray], Indices, list[str]] | None:
        """Values of the sets in rows that they share, the row of each corner, further names."""
        layers = sorted(self.node.named("LayerElementUV"), key=_number)
        first = self._layer(next(iter(layers), None), "UV", 2)
        if first is None:
            return None
        found = [self._welded(first)]
        further: dict[str, None] = {}
        for layer in layers[1:_MOST_UV_SETS]:
            name = layer.child_text("Name")
            if name not in names or name in (layers[0].child_text("Name"), *further):
                continue
            if (values := self._layer(layer, "UV", 2)) is not None:
                found.append(self._welded(values))
                further[name] = None
        if not further:
            return [found[0][0]], found[0][1], []
        table = np.stack([rows for _, rows in found], axis=1).astype(np.int32)
        kept, rows = np.unique(weld_rows(table), return_inverse=True)
        return [values[of_corner[kept]] for values, of_corner in found], rows, list(further)

    def _smoothing(self) -> dict[str, Any]:
        """Return normals that smoothing makes, as fields; none where no edge is hard."""
        node = self._first("LayerElementSmoothing")
        if node is None:
            return {}
        values = _integers(node.numbers("Smoothing"))
        polygons = Polygons(self.vertices, self.sizes)
        pairs = polygons.pairs(self.slots)
        if node.child_text("MappingInformationType") == "ByEdge":
            edges = _integers(self.node.numbers("Edges"))[: len(values)]
            hard = edges[values[: len(edges)] == 0]
            hard = hard[(hard >= 0) & (hard < len(pairs.keys))]
            is_smooth = ~np.isin(pairs.keys[pairs.one], pairs.keys[hard])
        else:
            places = self._places(node)
            if places is None:
                return {}
            # Groups as bits; 0 makes a polygon flat, as programs mean that write 0 and 1 alone.
            groups = np.maximum(_looked_up(values, places), 0)
            is_smooth = (groups[pairs.one] & groups[pairs.other]) != 0
        faces = self.vertices[self.slots].astype(np.int32)
        return smoothed_normals(self.positions, faces, polygons, self.slots, pairs, is_smooth)

    def _layer(self, node: Node | None, name: str, width: int) -> _Layer | None:
        """Read a layer; None where it has nothing to say."""
        if node is None:
            return None
        values = _floats(node, name)
        values = values[: len(values) // width * width].reshape(-1, width)
        values = finite_rows(self.path, values, _FIELDS[name])
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

    def _welded(self, layer: _Layer) -> tuple[FloatArray, Indices]:
        """Make one row of equal values of one vertex, where there is one for each corner."""
        values, rows, is_listed = layer
        if not is_listed:
            return values, rows
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


def _floats(node: Node, name: str) -> FloatArray:
    """(n,) numbers of a child."""
    with np.errstate(invalid="ignore"):  # a signaling NaN is read like any other NaN
        return node.numbers(name).astype(np.float64)


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
