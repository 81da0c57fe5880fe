"""Many small primitives of a glTF file, read together instead of one by one.

Files of CAD programs have 100,000 meshes of a few triangles, each with arrays of its own. Here the
rows of all of them are taken out of the buffers at once. What comes out is bit for bit what
`read_primitive` gives. Where a primitive is large, is no list of triangles, is stored in another
way than plainly in a buffer, or anything about it is wrong, it is left to that function, which also
names what is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.errors import TexbakeError
from texbake.mesh.files.gltf_accessors import Accessors, Integers, column_of, of_kind
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_nodes import INDICES, TRIANGLES
from texbake.mesh.files.gltf_primitives import PrimitiveMesh, turned_up
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows

_ATTRIBUTES = {"POSITION": (3,), "NORMAL": (3,), "TANGENT": (4,), "COLOR_0": (3, 4)}
_UVS = "TEXCOORD_"
_ROWS_AT_ONCE = 1 << 18  # of arrays; more take more memory, and longer


class Wanted(NamedTuple):
    """A primitive, and the numbers of the sets of texture coordinates to read: first, others."""

    primitive: dict[str, Any]
    uv_set: int = 0
    further: tuple[int, ...] = ()


def read_primitives(
    document: Document, wanted: Sequence[Wanted], *, keeps_colors: bool = False
) -> list[PrimitiveMesh | None]:
    """Triangles of the primitives that can be read together; None for those that are left."""
    found: list[PrimitiveMesh | None] = [None] * len(wanted)
    alike: dict[Any, list[int]] = {}
    for i, one in enumerate(wanted):
        names = _arrays_of(one)
        if names is not None:
            alike.setdefault((names, one.uv_set, one.further), []).append(i)
    if all(len(places) < 2 for places in alike.values()):
        return found
    with suppress(TexbakeError):  # a buffer is missing
        accessors = Accessors.of(document)
        for (names, uv_set, further), places in alike.items():
            reader = _BatchReader(document, accessors, names, (uv_set, further), keeps_colors)
            primitives = [wanted[i].primitive for i in places]
            for i, piece in reader.read(primitives).items():
                found[places[i]] = piece
    return found


def _arrays_of(wanted: Wanted) -> tuple[str, ...] | None:
    """Names of the arrays of a primitive that are read; None if it is not plain."""
    primitive = wanted.primitive
    attributes = primitive.get("attributes")
    if (
        "extensions" in primitive
        or not isinstance(attributes, dict)
        or "POSITION" not in attributes
        or primitive.get("mode", TRIANGLES) != TRIANGLES
    ):
        return None
    uvs = {f"{_UVS}{number}" for number in (wanted.uv_set, *wanted.further)}
    names = tuple(name for name in attributes if name in _ATTRIBUTES or name in uvs)
    return (*names, INDICES) if INDICES in primitive else names


class _BatchReader:
    """Reads primitives that have arrays of the same names."""

    def __init__(
        self,
        document: Document,
        accessors: Accessors,
        names: tuple[str, ...],
        uv_sets: tuple[int, tuple[int, ...]],
        keeps_colors: bool,
    ) -> None:
        self.accessors = accessors
        self.names = names
        self.uv_set, self.further = uv_sets
        self.keeps_colors = keeps_colors

    def read(self, primitives: list[dict[str, Any]]) -> dict[int, PrimitiveMesh]:
        """Meshes of those that can be read, by their places in the list."""
        accessors = self.accessors
        numbers = np.stack([self._numbers(primitives, name) for name in self.names], axis=1)
        kinds, counts = accessors.kinds[numbers], accessors.counts[numbers]
        kinds[numbers < 0] = -1
        is_plain = (kinds >= 0).all(axis=1)
        vertices = counts[:, self.names.index("POSITION")]
        for column, name in enumerate(self.names):
            if name == INDICES:
                is_plain &= counts[:, column] % 3 == 0
            else:
                is_plain &= counts[:, column] == vertices
        if INDICES not in self.names:
            is_plain &= vertices % 3 == 0
        places = np.flatnonzero(is_plain)
        found: dict[int, PrimitiveMesh] = {}
        _, groups = np.unique(kinds[places], axis=0, return_inverse=True)
        order = np.argsort(groups.ravel(), kind="stable")
        bounds = np.flatnonzero(np.diff(groups.ravel()[order])) + 1
        for alike in np.split(places[order], bounds):
            rows = np.cumsum(counts[alike].max(axis=1))
            for chosen in np.split(alike, np.flatnonzero(np.diff(rows // _ROWS_AT_ONCE)) + 1):
                if len(chosen) > 1 and self._are_read(kinds[chosen[0]].tolist()):
                    pieces = self._batch(dict(zip(self.names, numbers[chosen].T, strict=True)))
                    found |= dict(zip(chosen.tolist(), pieces, strict=False))
        return found

    def _numbers(self, primitives: list[dict[str, Any]], name: str) -> Integers:
        """(n,) accessors of an array; -1 where there is none of that number."""
        owners = primitives if name == INDICES else [item["attributes"] for item in primitives]
        numbers = column_of(owners, name, -1)
        numbers[(numbers < 0) | (numbers >= len(self.accessors.kinds))] = -1
        return numbers

    def _are_read(self, kinds: list[int]) -> bool:
        """Whether arrays of these kinds are what their names ask for."""
        for name, kind in zip(self.names, kinds, strict=True):
            dtype, width, is_normalized = of_kind(kind)
            if name == INDICES:
                if width != 1 or dtype.kind != "u" or is_normalized:
                    return False
            elif width not in _ATTRIBUTES.get(name, (2,)):
                return False
        return True

    def _batch(self, numbers: Mapping[str, Integers]) -> list[PrimitiveMesh]:
        """Meshes of primitives of one kind; none where a value is not sound."""
        accessors = self.accessors
        arrays = {}
        for name, of in numbers.items():
            rows = accessors.rows(of)
            if name != INDICES:
                if not np.isfinite(rows).all():
                    return []
                rows = rows.astype(np.float64)
            arrays[name] = rows
        n_vertices = accessors.counts[numbers["POSITION"]]
        starts = np.cumsum(n_vertices) - n_vertices
        if INDICES in numbers:
            n_corners = accessors.counts[numbers[INDICES]]
            corners = arrays.pop(INDICES)[:, 0].astype(np.int64)
            if (corners >= np.repeat(n_vertices, n_corners)).any():
                return []
        else:
            n_corners = n_vertices
            corners = np.arange(len(arrays["POSITION"])) - np.repeat(starts, n_vertices)
        return self._pieces(arrays, n_vertices, corners, n_corners)

    def _pieces(
        self,
        arrays: dict[str, FloatArray],
        n_vertices: Integers,
        corners: Integers,
        n_corners: Integers,
    ) -> list[PrimitiveMesh]:
        """Cut joined arrays into the meshes of their primitives, vertices at one place joined."""
        starts = np.cumsum(n_vertices) - n_vertices
        positions, colors = arrays["POSITION"], arrays.get("COLOR_0")
        # Vertices of different primitives stay apart.
        keys = [positions, np.repeat(np.arange(len(starts), dtype=np.float64), n_vertices)[:, None]]
        if self.keeps_colors and colors is not None:
            keys.append(colors)
        firsts = weld_rows(np.concatenate(keys, axis=1))
        is_kept = firsts == np.arange(len(firsts))
        kept_before = np.concatenate([[0], np.cumsum(is_kept)])
        kept_starts = kept_before[np.append(starts, len(firsts))]
        welded = kept_before[firsts] - np.repeat(kept_starts[:-1], n_vertices)
        faces = welded[corners + np.repeat(starts, n_corners)]
        vertices = np.append(starts, len(firsts)).tolist()
        kept = _cut(positions[is_kept], kept_starts.tolist())
        triangles = (np.append(0, np.cumsum(n_corners)) // 3).tolist()
        of_positions, of_others = (_cut(_triangles(rows), triangles) for rows in (faces, corners))
        nothing = [None] * len(starts)
        uvs, normals, tangents = (
            nothing if rows is None else _cut(rows, vertices)
            for rows in (
                turned_up(arrays.get(f"{_UVS}{self.uv_set}")),
                arrays.get("NORMAL"),
                arrays.get("TANGENT"),
            )
        )
        further = {
            number: _cut(rows, vertices)
            for number in self.further
            if (rows := turned_up(arrays.get(f"{_UVS}{number}"))) is not None
        }
        of_vertices = (
            nothing
            if colors is None
            else _cut(colors[is_kept].astype(np.float32), kept_starts.tolist())
        )
        return [
            PrimitiveMesh(
                positions=kept[i],
                faces=of_positions[i],
                corners=of_others[i],
                uvs=uvs[i],
                further_uvs={number: rows[i] for number, rows in further.items()},
                normals=normals[i],
                tangents=tangents[i],
                colors=of_vertices[i],
            )
            for i in range(len(starts))
        ]


def _triangles(corners: Integers) -> IntArray:
    return corners.astype(np.int32).reshape(-1, 3)


def _cut(rows: npt.NDArray[Any], bounds: list[int]) -> list[Any]:
    """Parts of an array between rows."""
    return [rows[start:stop] for start, stop in pairwise(bounds)]
