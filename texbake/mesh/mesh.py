"""The mesh: triangles as arrays, in the indexed form of OBJ, never changed in place.

Positions, texture coordinates and normals are separate lists, each with its own corner indices, so
that giving a mesh texture coordinates adds two arrays and touches nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import MeshError, UvError, quoted
from texbake.mesh.deformation import Deformation
from texbake.records import dataclass

BoolArray = npt.NDArray[np.bool_]
FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
IndexArray = npt.NDArray[np.intp]
ByteArray = npt.NDArray[np.uint8]
AnyArray = npt.NDArray[Any]

# Vertices, and half-edges, three per face, are numbered with int32.
MAX_CORNERS = 2**31 - 1
MAX_FACES = MAX_CORNERS // 3

# glTF's name of the first set of texture coordinates.
FIRST_UV_SET = "TEXCOORD_0"

MOST_UV_SETS = 64
"""Further sets of a mesh: each takes as much memory as its faces, and a file can name one array as
any number of sets."""


@dataclass(frozen=True, eq=False)
class UvSet:
    """A set of texture coordinates with a layout of its own, beside the first, `Mesh.uvs`."""

    uvs: FloatArray  # (T, 2) float64; v up, (0, 0) at the lower left
    faces: IntArray  # (F, 3) int32; indices into `uvs`


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Mesh:
    """Triangles in space, with the texture coordinates, normals and groups that they have.

    Arrays are converted to the types below and made read-only; a float64 or int32 array that is
    already contiguous is shared, not copied.

    Attributes
    ----------
    positions : (V, 3) float64
        Points in model units.
    faces : (F, 3) int32
        Indices into `positions`, counter-clockwise seen from outside.
    uvs : (T, 2) float64, optional
        Texture coordinates, v up, (0, 0) at the lower left.
    uv_faces : (F, 3) int32, optional
        Indices into `uvs`, given if and only if `uvs` is.
    uv_sets : mapping of str to UvSet
        Further sets of texture coordinates by their names, each with indices of its own.
    normals : (N, 3) float64, optional
        Shading normals, normalized on the way in; a zero vector stays zero.
    normal_faces : (F, 3) int32, optional
        Indices into `normals`, given if and only if `normals` is.
    tangents : (F, 3, 4) float32, optional
        Corner tangents that came with the file; w is the bitangent sign.
    colors : (V, 3) or (V, 4) float32, optional
        Linear vertex colors in [0, 1], with or without alpha. Readers and writers convert those of
        files that store sRGB: all but glTF and USD.
    polygon_of : (F,) int32, optional
        Polygon of each face, whose triangles follow one another. Numbers may only rise on the way
        in, and become those from 0 on; None where all polygons are triangles.
    face_groups : (F,) int32, optional
        Index into `group_names` of each face.
    group_names : tuple of str
        Names of the groups (OBJ groups and objects, glTF primitives).
    group_objects : tuple of int
        Number of the object that each group belongs to; empty where groups are not objects. See
        `texbake.mesh.objects`.
    deformation : Deformation, optional
        What moves the vertices: joints and morph targets.
    name : str
        File name, for messages.

    Raises
    ------
    MeshError
        A number is not finite, an index is out of range, shapes do not match, or there are no
        faces or more than `MAX_FACES`.
    """

    positions: FloatArray
    faces: IntArray
    uvs: FloatArray | None = None
    uv_faces: IntArray | None = None
    uv_sets: Mapping[str, UvSet] = field(default_factory=dict)
    normals: FloatArray | None = None
    normal_faces: IntArray | None = None
    tangents: npt.NDArray[np.float32] | None = None
    colors: npt.NDArray[np.float32] | None = None
    polygon_of: IntArray | None = None
    face_groups: IntArray | None = None
    group_names: tuple[str, ...] = ()
    group_objects: tuple[int, ...] = ()
    deformation: Deformation | None = None
    name: str = "mesh"

    def __post_init__(self) -> None:
        positions = self._adopt("positions", np.float64, (None, 3), "a position")
        faces = self._adopt("faces", np.int32, (None, 3))
        if positions is None or faces is None or len(faces) == 0:
            raise MeshError(f"{self.name}: it has no faces; a mesh needs at least one triangle")
        check_face_count(len(faces), self.name)
        _check_indices(faces, len(positions), f"{self.name}: a position index")
        for values, corners, width, noun in (
            ("uvs", "uv_faces", 2, "texture coordinate"),
            ("normals", "normal_faces", 3, "normal"),
        ):
            self._check_pair(values, corners, width, noun)
        self._check_uv_sets()
        if self.normals is not None:
            object.__setattr__(self, "normals", frozen(_normalized(self.normals)))
        self._adopt("tangents", np.float32, (len(faces), 3, 4), "a tangent")
        self._adopt("colors", np.float32, (len(positions), None), "a vertex color")
        groups = self._adopt("face_groups", np.int32, (len(faces),))
        if groups is not None:
            _check_indices(groups, len(self.group_names), f"{self.name}: a group index")
        if len(self.group_objects) not in (0, len(self.group_names)):
            raise MeshError(f"{self.name}: group_objects and group_names differ in length")
        if self.deformation is not None and len(self.deformation) != len(positions):
            raise MeshError(f"{self.name}: deformation and positions differ in length")
        self._adopt("polygon_of", np.int32, (len(faces),))
        self._number_polygons()

    def __repr__(self) -> str:
        sides = " x ".join(f"{side:.4g}" for side in np.ptp(self.bounds, axis=0).tolist())
        counts = f"{self.n_faces:,} faces, {self.n_vertices:,} vertices, {sides}"
        kinds = ("uvs", "normals", "tangents", "colors")
        has = [kind for kind in kinds if getattr(self, kind) is not None]
        return f"<Mesh {self.name}: {', '.join([counts, *has])}>"

    def _repr_html_(self) -> str:
        # Pages build on meshes, so this module imports none of them.
        return str(import_module("texbake").show(self)._repr_html_())

    @property
    def n_vertices(self) -> int:
        """Number of positions."""
        return len(self.positions)

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @property
    def n_polygons(self) -> int:
        """Number of polygons: that of triangles, unless some make up larger polygons."""
        return self.n_faces if self.polygon_of is None else int(self.polygon_of[-1]) + 1

    @property
    def polygon_numbers(self) -> IntArray:
        """(F,) int32: polygon of each face, also of a mesh of triangles."""
        if self.polygon_of is None:
            return np.arange(self.n_faces, dtype=np.int32)
        return self.polygon_of

    def count_polygons(self, chosen: npt.NDArray[np.bool_]) -> int:
        """Number of polygons that have one of the chosen (F,) triangles."""
        numbers = chosen if self.polygon_of is None else np.bincount(self.polygon_of, chosen)
        return int(np.count_nonzero(numbers))

    @cached_property
    def used_vertices(self) -> npt.NDArray[np.bool_]:
        """(V,) bool: vertices that faces use. Kernel: `core/framing.c`."""
        used = np.zeros(self.n_vertices, np.bool_)
        core.mark_used_vertices(self.faces, used)
        return frozen(used)

    @property
    def used_positions(self) -> FloatArray:
        """(n, 3) float64: the positions that faces use."""
        used = self.used_vertices
        return self.positions if used.all() else self.positions[used]

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: least and greatest coordinates of the positions that faces use."""
        points = self.used_positions
        # Column by column: numpy is several times slower along the first axis of a narrow array.
        columns = [points[:, axis] for axis in range(3)]
        return frozen(np.array([[c.min() for c in columns], [c.max() for c in columns]]))

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box, in model units."""
        low, high = self.bounds
        with np.errstate(over="ignore"):
            sides = high - low
            _, exponent = np.frexp(sides.max())  # scaled, because its square may overflow float64
            return float(np.ldexp(pm.norm(np.ldexp(sides, -exponent)), exponent))

    def corner_uvs(self, uv_set: str | None = None) -> FloatArray:
        """(F, 3, 2) float64: the texture coordinates of each face's corners, in a set.

        Raises `UvError` where the mesh has none, or no further set of that name.
        """
        found = self.uv_set(uv_set)
        return found.uvs[found.faces]

    def uv_set(self, name: str | None) -> UvSet:
        """Return a set of texture coordinates; raise `UvError` if there is none.

        None is the first set, and so is `TEXCOORD_0` unless a further set has that name.
        """
        if name is not None and name in self.uv_sets:
            return self.uv_sets[name]
        if name in (None, FIRST_UV_SET) and self.uvs is not None and self.uv_faces is not None:
            return UvSet(self.uvs, self.uv_faces)
        if name is None:
            raise UvError(
                f"{self.name}: it has no texture coordinates; "
                f"make some with: texbake unwrap {self.name} -o OUT"
            )
        others = f"it has {', '.join(self.uv_sets)}; " if self.uv_sets else ""
        raise UvError(
            f"{self.name}: it has no UV set {quoted(name)}; {others}"
            f"make it with: texbake unwrap {self.name} --uv-set {name} -o OUT"
        )

    def on_uv_set(self, name: str | None) -> Mesh:
        """Return a mesh whose texture coordinates are those of a further set; itself for None.

        Tangents are left out, since they belong to the first set. Raises as `uv_set` does.
        """
        if name is None or (name == FIRST_UV_SET and name not in self.uv_sets):
            return self
        found = self.uv_set(name)
        return self.replace(uvs=found.uvs, uv_faces=found.faces, tangents=None)

    def replace(self, **changes: Any) -> Mesh:
        """Return a mesh with some fields changed and the others shared.

        New faces drop further sets of texture coordinates and polygons, new positions drop the
        deformation, and new names of groups drop the objects, unless these are passed as well.
        """
        if changes.get("group_names", self.group_names) != self.group_names:
            changes = {"group_objects": ()} | changes
        if "faces" in changes:
            changes = {"uv_sets": {}, "polygon_of": None} | changes
        if "positions" in changes:
            changes = {"deformation": None} | changes
        return replace(self, **changes)

    def _adopt(
        self, field: str, dtype: type, shape: tuple[int | None, ...], noun: str | None = None
    ) -> Any:
        """Make a field a read-only array of a type and shape; with a `noun` of finite numbers."""
        value = getattr(self, field)
        if value is None:
            return None
        array = _convert(value, f"{self.name}: {field}", dtype, shape)
        if noun is not None:
            _check_finite(array, f"{self.name}: {noun}")
        object.__setattr__(self, field, array)
        return array

    def _check_pair(self, values: str, corners: str, width: int, noun: str) -> None:
        if (getattr(self, values) is None) != (getattr(self, corners) is None):
            raise MeshError(f"{self.name}: {values} and {corners} belong together; one is missing")
        if getattr(self, values) is None:
            return
        array = self._adopt(values, np.float64, (None, width), f"a {noun}")
        indices = self._adopt(corners, np.int32, (len(self.faces), 3))
        _check_indices(indices, len(array), f"{self.name}: a {noun} index")

    def _check_uv_sets(self) -> None:
        require_few_sets(len(self.uv_sets), self.name)
        sets = {}
        for name, item in self.uv_sets.items():
            if not isinstance(name, str) or not name.strip() or not name.isprintable():
                raise MeshError(f"{self.name}: {quoted(name)} is not a name of texture coordinates")
            of_set = f"of the UV set {quoted(name)}"
            uvs = _convert(item.uvs, f"{self.name}: uvs {of_set}", np.float64, (None, 2))
            _check_finite(uvs, f"{self.name}: a texture coordinate {of_set}")
            shape = (len(self.faces), 3)
            faces = _convert(item.faces, f"{self.name}: faces {of_set}", np.int32, shape)
            _check_indices(faces, len(uvs), f"{self.name}: an index {of_set}")
            sets[name] = UvSet(uvs, faces)
        object.__setattr__(self, "uv_sets", sets)

    def _number_polygons(self) -> None:
        if self.polygon_of is None:
            return
        steps = np.diff(self.polygon_of)
        if (steps < 0).any():
            raise MeshError(
                f"{self.name}: polygon_of falls; triangles of a polygon must be side by side"
            )
        if (steps > 0).all():
            object.__setattr__(self, "polygon_of", None)
        elif self.polygon_of[0] != 0 or (steps > 1).any():
            numbers = np.cumsum(steps > 0, dtype=np.int32)
            object.__setattr__(self, "polygon_of", frozen(np.append(np.int32(0), numbers)))


def _convert(value: Any, what: str, dtype: type, shape: tuple[int | None, ...]) -> npt.NDArray[Any]:
    """Return a read-only, contiguous array of a shape (None: any length); nothing is rounded."""
    if type(value) is not np.ndarray and np.ma.is_masked(value):
        raise MeshError(f"{what} has masked numbers; leave them out")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise MeshError(f"{what} is not an array of numbers") from error
    if array.dtype.kind not in "biuf":
        raise MeshError(f"{what} is not an array of numbers")
    if np.issubdtype(dtype, np.integer) and array.dtype != dtype and array.size:
        if array.dtype.kind not in "iu":
            raise MeshError(f"{what} must be integers, not {array.dtype}")
        limits = np.iinfo(dtype)
        if array.dtype.itemsize >= 4 and (array.max() > limits.max or array.min() < limits.min):
            raise MeshError(f"{what} has an index out of range")
    with np.errstate(over="ignore"):  # what float32 does not hold is found not finite
        array = np.asarray(array, dtype=dtype, order="C")
    if array.ndim != len(shape) or any(
        want is not None and want != have for want, have in zip(shape, array.shape, strict=True)
    ):
        wanted = str(tuple("n" if want is None else want for want in shape)).replace("'", "")
        raise MeshError(f"{what} has the shape {array.shape}, not {wanted}")
    return frozen(array)


def _check_finite(array: npt.NDArray[Any], what: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(array.sum()):  # a finite sum has only finite terms
            return
    bad = ~np.isfinite(array).reshape(len(array), -1).all(axis=1)
    if bad.any():
        raise MeshError(
            f"{what} is not finite "
            f"({int(bad.sum())} of {len(array)}, the first at index {int(bad.argmax())})"
        )


def _check_indices(indices: IntArray, n_values: int, what: str) -> None:
    if indices.view(np.uint32).max() >= min(n_values, 1 << 31):  # negative ones are large there
        bad = ((indices < 0) | (indices >= n_values)).reshape(len(indices), -1).any(axis=1)
        raise MeshError(f"{what} is out of range (face {int(bad.argmax())}; there are {n_values})")


def require_few_sets(n_sets: int, mesh: str) -> None:
    """Raise `MeshError` for more further sets of texture coordinates than a mesh can have."""
    if n_sets > MOST_UV_SETS:
        raise MeshError(
            f"{mesh}: it has {n_sets:,} sets of texture coordinates besides the first, and at most "
            f"{MOST_UV_SETS} are read; remove those that nothing uses"
        )


def check_face_count(n_faces: int, name: str) -> None:
    """Raise `MeshError` if a mesh has more faces than int32 can number half-edges for."""
    if n_faces > MAX_FACES:
        raise MeshError(
            f"{name}: it has {n_faces:,} triangles; {MAX_FACES:,} are the most; "
            "split it into several files"
        )


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Read-only view of an array."""
    view = array.view()
    view.flags.writeable = False
    return view


def _normalized(vectors: FloatArray) -> FloatArray:
    """Unit vectors, left bit-equal where they are unit already to float32 precision."""
    squares = pm.vecdot(vectors, vectors)
    # 1e-6 relative: what float32 files leave of a unit vector.
    off = (np.abs(squares - 1.0) > 1e-6) & (squares > 0.0)
    if not off.any():
        return vectors
    unit = vectors.copy()
    scaled = vectors[off] / np.abs(vectors[off]).max(axis=1, keepdims=True)
    unit[off] = scaled / pm.norm(scaled, axis=1, keepdims=True)
    return unit
