"""Triangles of glTF primitives, in the space of their meshes.

Vertices at the same position, bit for bit, become one, because the format splits them where a
normal or a coordinate differs; these keep their own indices, so that nothing is lost (except where
such vertices differ in color: then the first decides). Points and lines are skipped. Primitives
compressed by Draco are decoded in a process of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from texbake.child import LIMITS
from texbake.errors import FileFormatError, MeshError, quoted, require_library, warn_of
from texbake.mesh.compose import MeshPart
from texbake.mesh.deformation import Deformation, Morph, largest_weights
from texbake.mesh.files.conversion import finite_rows, rows_not_finite, strip_triangles, warn_unused
from texbake.mesh.files.gltf_compression import DRACO
from texbake.mesh.files.gltf_document import Document, DracoMesh, read_document
from texbake.mesh.mesh import AnyArray, FloatArray, IndexArray, IntArray, UvSet, require_few_sets
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of primitives."""
INDICES = "indices"
_UVS = "TEXCOORD"
_UV_SET = re.compile("TEXCOORD_(0|[1-9][0-9]{0,8})")
_FIELDS = {
    "NORMAL": "normals", _UVS: "uvs", "COLOR": "colors", "WEIGHTS": "weights", "TARGET": "morphs",
}  # fmt: skip
_WIDTHS = {"POSITION": (3,), "NORMAL": (3,), "TANGENT": (4,), "COLOR_0": (3, 4)}
_BINDING = re.compile("(?:JOINTS|WEIGHTS)_[0-7]")  # 32 joints a vertex
_MOTIONS = ("JOINTS", "WEIGHTS", "TARGET")
_COPIES = 8  # memory of a morph target, in sets of the triangles alone
_ROWS_AT_ONCE = 1 << 18  # of joined primitives; more rows take more memory and time
# Draco packs the triangles of a flat grid 11 to a byte, and takes 80 bytes to decode each: 16 times
# what other files may take.
_PACKED = 16


class PrimitiveRequest(NamedTuple):
    """A primitive, and the numbers of the sets of texture coordinates to read: first, others."""

    primitive: dict[str, Any]
    uv_set: int = 0
    further: tuple[int, ...] = ()
    deforms: bool = False  # whether joints and morph targets are read


class _Arrays(NamedTuple):
    """Arrays of a primitive by the names of attributes, and the (F, 3) corners of its triangles."""

    attributes: dict[str, AnyArray]
    corners: IntArray


def read_primitives(
    document: Document, requests: Sequence[PrimitiveRequest], *, keeps_colors: bool = False
) -> list[MeshPart | None]:
    """Triangles of primitives in the space of their meshes; those of equal attributes at once."""
    found = [_read_arrays(document, request) for request in requests]
    alike: dict[Any, list[int]] = {}
    for i, (request, arrays) in enumerate(zip(requests, found, strict=True)):
        if arrays is not None:
            widths = tuple((name, rows.shape[1]) for name, rows in arrays.attributes.items())
            alike.setdefault((widths, *request[1:]), []).append(i)
    meshes: list[MeshPart | None] = [None] * len(requests)
    for places in alike.values():
        sizes = [len(arrays.corners) for i in places if (arrays := found[i]) is not None]
        stops = np.flatnonzero(np.diff(np.cumsum(sizes) // _ROWS_AT_ONCE)) + 1
        for start, stop in pairwise([0, *stops.tolist(), len(places)]):
            batch = places[start:stop]
            joined = [arrays for i in batch if (arrays := found[i]) is not None]
            pieces = _weld(document, joined, requests[batch[0]], keeps_colors)
            for i, piece in zip(batch, pieces, strict=True):
                meshes[i] = piece
    return meshes


def _read_arrays(document: Document, request: PrimitiveRequest) -> _Arrays | None:
    """Arrays of a primitive, checked; None where it has no triangle."""
    primitive = request.primitive
    mode = primitive.get("mode", TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
        return None
    source = _primitive_source(document, primitive, attributes)
    uvs = {f"{_UVS}_{number}" for number in (request.uv_set, *request.further)}
    arrays = {"POSITION": source.read("POSITION", (3,), None)}
    n = len(arrays["POSITION"])
    for name in source.accessors:
        if name != "POSITION" and (name in _WIDTHS or name in uvs):
            arrays[name] = source.read(name, _WIDTHS.get(name, (2,)), n)
    if request.deforms:
        arrays |= _motions(source, n)
    # Draco has made triangles of a strip.
    corners = _triangles(source.indices(n), TRIANGLES if source.decoded else mode)
    return _Arrays(arrays, corners) if len(corners) else None


def _motions(source: _PrimitiveSource, n: int) -> dict[str, AnyArray]:
    """Joints, weights and targets `TARGET_0` ... of n vertices, without damaged arrays."""
    arrays: dict[str, AnyArray] = {}
    bindings = set(filter(_BINDING.fullmatch, source.accessors))
    try:
        for number in sorted(name[7:] for name in bindings if name.startswith("JOINTS_")):
            names = f"JOINTS_{number}", f"WEIGHTS_{number}"
            if bindings.issuperset(names):
                arrays |= {name: source.read(name, (4,), n) for name in names}
    except FileFormatError as error:
        arrays = {}
        _warn_left_out(source.document, "joints and weights of vertices", error)
    for i, target in enumerate(source.targets):
        arrays[f"TARGET_{i}"] = np.zeros((n, 3))
        try:
            if "POSITION" in target:
                moved = source.document.accessor(target["POSITION"])
                if moved.shape != (n, 3):
                    source.document.fail(f"it has {len(moved)} rows, where there are {n} positions")
                arrays[f"TARGET_{i}"] = moved
        except FileFormatError as error:
            _warn_left_out(source.document, f"morph target {i}", error)
    return arrays


def _warn_left_out(document: Document, what: str, error: FileFormatError) -> None:
    warn_of(document.path, f"left out {what}: {str(error).removeprefix(f'{document.path}: ')}")


def _deformation(values: dict[str, AnyArray]) -> Deformation | None:
    """Deformation by the arrays of a primitive; joints are numbered as in the skin."""
    columns = {
        kind: [rows for name, rows in sorted(values.items()) if name.startswith(f"{kind}_")]
        for kind in _MOTIONS
    }
    if not any(columns.values()):
        return None
    n = len(values["POSITION"])
    joints = np.concatenate([np.zeros((n, 0)), *columns["JOINTS"]], axis=1).astype(np.int32)
    weights = np.concatenate([np.zeros((n, 0)), *columns["WEIGHTS"]], axis=1)
    joints, weights = largest_weights(joints, np.maximum(weights, 0.0), joints.shape[1])
    numbers = sorted(int(name[7:]) for name in values if name.startswith("TARGET_"))
    morphs = (Morph.of_rows(values[f"TARGET_{number}"]) for number in numbers)
    return Deformation(joints, weights, tuple(morphs))


def _cut(
    motion: Deformation | None, kept: IndexArray, bounds: IntArray
) -> list[Deformation | None]:
    """Deformation of the welded vertices of each part of a batch."""
    parts = pairwise(bounds.tolist())
    return [motion and motion.of(kept[start:stop]) for start, stop in parts]


def _weld(
    document: Document, batch: list[_Arrays], request: PrimitiveRequest, keeps_colors: bool
) -> list[MeshPart]:
    """Meshes of primitives that have the same attributes, vertices at one place joined."""
    with np.errstate(invalid="ignore"):  # a signaling NaN is read like any other NaN
        values = {
            name: np.concatenate([arrays.attributes[name] for arrays in batch], dtype=np.float64)
            for name in batch[0].attributes
        }
    if len(batch) > 1 and not all(np.isfinite(rows).all() for rows in values.values()):
        return [_weld(document, [arrays], request, keeps_colors)[0] for arrays in batch]
    bounds = _bounds([len(arrays.attributes["POSITION"]) for arrays in batch])
    n_faces = [len(arrays.corners) for arrays in batch]
    corners = np.concatenate([arrays.corners for arrays in batch])
    joined = corners + np.repeat(bounds[:-1], n_faces)[:, None] if len(batch) > 1 else corners
    values["POSITION"] = _finite_positions(document, values["POSITION"], joined)
    for name in values:
        if name.partition("_")[0] in _FIELDS:
            values[name] = finite_rows(document.path, values[name], _FIELDS[name.partition("_")[0]])
    keys = [values["POSITION"]]
    if keeps_colors and "COLOR_0" in values:
        keys.append(values["COLOR_0"])
    motion = _deformation(values)
    if motion is not None:
        keys.append(motion.rows(np.arange(len(motion))))
    if len(batch) > 1:  # vertices of different primitives stay apart
        keys.append(np.repeat(np.arange(len(batch), dtype=np.float64), np.diff(bounds))[:, None])
    firsts = weld_rows(np.concatenate(keys, axis=1) if len(keys) > 1 else keys[0])
    is_kept = firsts == np.arange(len(firsts))
    before = np.append(np.int32(0), np.cumsum(is_kept, dtype=np.int32))
    kept_bounds = before[bounds]
    faces = before[firsts][joined] - np.repeat(kept_bounds[:-1], n_faces)[:, None]
    colors, tangents = values.get("COLOR_0"), values.get("TANGENT")
    if tangents is not None and not np.isfinite(tangents).all():
        warn_of(document.path, "some tangents are not finite; computed ones replace all of them")
        tangents = None
    columns = {
        "positions": _pieces(values["POSITION"][is_kept], kept_bounds),
        "faces": _pieces(faces, _bounds(n_faces)),
        "corners": _pieces(corners, _bounds(n_faces)),
        "uvs": _pieces(flip_v(values.get(f"{_UVS}_{request.uv_set}")), bounds),
        "normals": _pieces(values.get("NORMAL"), bounds),
        "tangents": _pieces(tangents, bounds),
        "colors": _pieces(
            None if colors is None else colors[is_kept].astype(np.float32), kept_bounds
        ),
    }
    names = [f"{_UVS}_{number}" for number in request.further]
    motions = _cut(motion, np.flatnonzero(is_kept), kept_bounds)
    further = {name: _pieces(flip_v(values[name]), bounds) for name in names if name in values}
    return [
        MeshPart(
            **{name: parts[i] for name, parts in columns.items()},
            uv_sets={name: UvSet(rows[i], columns["corners"][i]) for name, rows in further.items()},
            deformation=motions[i],
        )
        for i in range(len(batch))
    ]


def _pieces(rows: AnyArray | None, bounds: IntArray) -> list[Any]:
    """Rows of each run between bounds; None for each where there are none."""
    if rows is None:
        return [None] * (len(bounds) - 1)
    return [rows[start:stop] for start, stop in pairwise(bounds.tolist())]


def _bounds(counts: list[int]) -> IntArray:
    """(n + 1,) where each of some runs of rows begins, and where the last ends."""
    return np.cumsum([0, *counts], dtype=np.int32)


def motion_count(document: Document, primitive: dict[str, Any]) -> int:
    """Number of arrays of joints and morph targets of a primitive; repeated ones count more."""
    bindings = filter(_BINDING.fullmatch, document.mapping(primitive, "attributes"))
    targets = [str(each.get("POSITION")) for each in morph_targets(primitive)]
    n_repeated = len(targets) - len(set(targets))
    return len(list(bindings)) + len(targets) + (_COPIES - 1) * n_repeated


def morph_targets(primitive: dict[str, Any]) -> list[dict[str, Any]]:
    """Morph targets of a primitive; none where its list is damaged."""
    targets = primitive.get("targets")
    is_sound = isinstance(targets, list) and all(isinstance(each, dict) for each in targets)
    return targets if is_sound else []  # type: ignore[return-value]


def triangle_count(document: Document, primitive: dict[str, Any]) -> int:
    """Number of triangles that `read_primitives` finds, without reading them."""
    mode = primitive.get("mode", TRIANGLES)
    attributes = document.mapping(primitive, "attributes")
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
        return 0
    counted = primitive.get(INDICES, attributes["POSITION"])
    count = document.integer(document.item("accessors", counted), "count", 0)
    return count // 3 if mode == TRIANGLES else max(count - 2, 0)


def further_sets(document: Document, primitive: dict[str, Any]) -> list[int]:
    """Numbers of the sets of texture coordinates of a primitive after the first."""
    matches = map(_UV_SET.fullmatch, document.mapping(primitive, "attributes"))
    numbers = sorted({int(match[1]) for match in filter(None, matches)} - {0})
    require_few_sets(len(numbers), str(document.path))
    return numbers


def primitive_uvs(document: Document, primitive: dict[str, Any], uv_set: int) -> FloatArray | None:
    """(n, 2) float64: a set of texture coordinates of a primitive, v turned up; None without it."""
    name = f"{_UVS}_{uv_set}"
    source = _primitive_source(document, primitive, document.mapping(primitive, "attributes"))
    if name not in source.accessors:
        return None
    uvs = source.read(name, (2,), None).astype(np.float64)
    return flip_v(finite_rows(document.path, uvs, "uvs"))


def flip_v(uvs: FloatArray | None) -> FloatArray | None:
    """(n, 2) texture coordinates of the file with v up; None where there are none."""
    return None if uvs is None else np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


@dataclass(frozen=True, eq=False)
class _PrimitiveSource:
    """Where the arrays of a primitive are, by their names, `indices` among them."""

    document: Document
    accessors: dict[str, Any]  # accessor of each
    decoded: dict[str, AnyArray]  # those that a compressed primitive holds in their place
    targets: list[dict[str, Any]]  # morph targets

    def read(self, name: str, widths: tuple[int, ...], count: int | None) -> AnyArray:
        """(count, width) values of an attribute."""
        values = self._values(name)
        if values.shape[1] not in widths:
            self.document.fail(f"{name} has {values.shape[1]} components, not {widths[0]}")
        if count is not None and len(values) != count:
            self.document.fail(f"{name} counts {len(values)}, where there are {count} positions")
        return values

    def indices(self, n_vertices: int) -> AnyArray:
        """(n,) vertices of corners."""
        if INDICES not in self.accessors:
            return np.arange(n_vertices)
        indices = self._values(INDICES)
        if indices.shape[1] != 1 or indices.dtype.kind != "u":
            self.document.fail("indices are not unsigned integers")
        if len(indices) and indices.max() >= n_vertices:
            self.document.fail(
                f"an index is out of range ({indices.max()}; there are {n_vertices})"
            )
        return indices[:, 0]

    def _values(self, name: str) -> AnyArray:
        if name not in self.decoded:
            return self.document.accessor(self.accessors[name])
        if self.accessors[name] is None:
            return self.decoded[name]
        accessor = self.document.item("accessors", self.accessors[name])
        return self.document.denormalized(accessor, self.decoded[name])


def _primitive_source(
    document: Document, primitive: dict[str, Any], attributes: dict[str, Any]
) -> _PrimitiveSource:
    accessors = dict(attributes)
    targets = morph_targets(primitive)
    if INDICES in primitive:
        accessors[INDICES] = primitive[INDICES]
    draco = document.mapping(document.mapping(primitive, "extensions"), DRACO)
    # A file may hold the same arrays uncompressed, for programs that do not read Draco.
    if not draco or "bufferView" in document.item("accessors", attributes["POSITION"]):
        return _PrimitiveSource(document, accessors, {}, targets)
    decoded = document.draco.get(document.integer(draco, "bufferView"))
    if decoded is None:
        document.fail("a primitive compressed by Draco is damaged")
    rows, indices = decoded
    arrays = {INDICES: indices.reshape(-1, 1)}
    for name, number in document.mapping(draco, "attributes").items():
        if type(number) is not int or number not in rows:
            document.fail(f"a primitive compressed by Draco has no attribute {quoted(number)}")
        arrays[name] = rows[number]
    return _PrimitiveSource(document, {INDICES: None, **accessors}, arrays, targets)


def decode_draco(path: str) -> dict[int, DracoMesh | None]:
    """Answer for `Document.draco`."""
    DracoPy = require_library("DracoPy", path)

    document = read_document(path)
    LIMITS.allow(_PACKED * document.n_bytes)
    found: dict[int, DracoMesh | None] = {}
    for mesh in document.items("meshes"):
        for primitive in document.objects(mesh, "primitives"):
            draco = document.mapping(document.mapping(primitive, "extensions"), DRACO)
            if not draco:
                continue
            view = document.integer(draco, "bufferView")
            if view in found:
                continue
            content = document.view_bytes(view).tobytes()
            try:
                decoded = DracoPy.decode(content)
                rows = {int(item["unique_id"]): item["data"] for item in decoded.attributes}
                found[view] = (
                    {number: values.reshape(len(values), -1) for number, values in rows.items()},
                    np.asarray(decoded.faces, np.uint32).ravel(),
                )
            except MemoryError:
                raise
            except Exception:  # DracoPy's errors have no base of their own
                found[view] = None
    return found


def _finite_positions(document: Document, positions: FloatArray, corners: IntArray) -> FloatArray:
    """Return positions; a used position replaces unused ones that are not finite."""
    is_bad = rows_not_finite(positions)
    if not is_bad.any():
        return positions
    if is_bad[corners].any():
        raise MeshError(f"{document.path}: a value of POSITION is not finite; export it again")
    warn_unused(document.path, f"{np.count_nonzero(is_bad):,} of {len(positions):,}")
    return np.where(is_bad[:, None], positions[corners[0, 0]], positions)


def _triangles(indices: AnyArray, mode: int) -> IntArray:
    """(F, 3) corners of a list, a strip or a fan; an incomplete triangle at the end is dropped."""
    indices = indices.astype(np.int32)
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if mode == STRIP:
        return strip_triangles(indices)
    i = np.arange(max(len(indices) - 2, 0))
    return indices[np.stack((i + 1, i + 2, 0 * i), axis=1)]
