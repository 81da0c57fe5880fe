"""The mesh: triangles as arrays, in the indexed form of OBJ, never changed in place.

Positions, texture coordinates and normals are separate lists, each with its own corner indices, so
that giving a mesh texture coordinates adds two arrays and touches nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError, UvError, quoted
from texbake.files import PathLike
from texbake.mesh.uv_sets import UvSet, checked_uv_sets

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

# Vertices, and half-edges, three per face, are numbered with int32.
MAX_CORNERS = 2**31 - 1
MAX_FACES = MAX_CORNERS // 3

# glTF's name of the first set of texture coordinates.
FIRST_UV_SET = "TEXCOORD_0"


@dataclass(frozen=True, kw_only=True, eq=False)
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
        Vertex colors in [0, 1], as they stand in the file.
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
    name: str = "mesh"

    def __post_init__(self) -> None:
        positions = self._adopt("positions", np.float64, (None, 3))
        faces = self._adopt("faces", np.int32, (None, 3))
        if positions is None or faces is None or len(faces) == 0:
            raise MeshError(f"{self.name}: it has no faces; a mesh needs at least one triangle")
        check_face_count(len(faces), self.name)
        self._check_finite("positions", "a position")
        self._check_indices("faces", len(positions), "position")
        for values, corners, width, noun in (
            ("uvs", "uv_faces", 2, "texture coordinate"),
            ("normals", "normal_faces", 3, "normal"),
        ):
            self._check_pair(values, corners, width, noun)
        sets = checked_uv_sets(self.uv_sets, len(faces), self.name)
        object.__setattr__(self, "uv_sets", sets)
        if self.normals is not None:
            object.__setattr__(self, "normals", frozen(_normalized(self.normals)))
        self._adopt("tangents", np.float32, (len(faces), 3, 4))
        self._check_finite("tangents", "a tangent")
        self._adopt("colors", np.float32, (len(positions), None))
        self._check_finite("colors", "a vertex color")
        self._adopt("face_groups", np.int32, (len(faces),))
        self._check_indices("face_groups", len(self.group_names), "group")
        if len(self.group_objects) not in (0, len(self.group_names)):
            raise MeshError(f"{self.name}: group_objects and group_names differ in length")
        self._adopt("polygon_of", np.int32, (len(faces),))
        self._number_polygons()

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

    def count_polygons(self, chosen: npt.NDArray[np.bool_]) -> int:
        """Number of polygons that have one of the chosen (F,) triangles."""
        numbers = chosen if self.polygon_of is None else np.bincount(self.polygon_of, chosen)
        return int(np.count_nonzero(numbers))

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: least and greatest coordinates of the positions that faces use."""
        used = np.zeros(len(self.positions), dtype=bool)
        used[self.faces.ravel()] = True
        points = self.positions if used.all() else self.positions[used]
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
        if uv_set is not None:
            found = self.uv_set(uv_set)
            return found.uvs[found.faces]
        if self.uvs is None or self.uv_faces is None:
            raise UvError(
                f"{self.name}: it has no texture coordinates; "
                f"make some with: texbake unwrap {self.name} -o OUT"
            )
        return self.uvs[self.uv_faces]

    def uv_set(self, name: str) -> UvSet:
        """Return a further set of texture coordinates; raise `UvError` if there is none.

        `TEXCOORD_0` is the first set, unless a further set has that name.
        """
        if name == FIRST_UV_SET and self.uvs is not None and self.uv_faces is not None:
            return self.uv_sets.get(name) or UvSet(self.uvs, self.uv_faces)
        if name not in self.uv_sets:
            others = f"it has {', '.join(self.uv_sets)}; " if self.uv_sets else ""
            raise UvError(
                f"{self.name}: it has no UV set {quoted(name)}; {others}"
                f"make it with: texbake unwrap {self.name} --set {name} -o OUT"
            )
        return self.uv_sets[name]

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

        New faces leave out further sets of texture coordinates, and polygons, and new names of
        groups leave out objects, unless these are given as well.
        """
        if changes.get("group_names", self.group_names) != self.group_names:
            changes = {"group_objects": ()} | changes
        if "faces" in changes:
            changes = {"uv_sets": {}, "polygon_of": None} | changes
        return replace(self, **changes)

    def _adopt(self, field: str, dtype: type, shape: tuple[int | None, ...]) -> Any:
        """Convert a field to a read-only array of the given type and shape (None: any length)."""
        value = getattr(self, field)
        if value is None:
            return None
        try:
            if np.ma.is_masked(value):
                raise MeshError(f"{self.name}: {field} has masked numbers; leave them out")
            array = np.asarray(value)
            if array.dtype.kind not in "biuf":
                raise TypeError(array.dtype)
            if array.dtype != dtype or not array.flags.c_contiguous or array.ndim == 0:
                array = self._converted(field, array, dtype)
        except (TypeError, ValueError) as error:
            if isinstance(error, MeshError):
                raise
            raise MeshError(f"{self.name}: {field} is not an array of numbers") from error
        if array.ndim != len(shape) or any(
            want is not None and want != have for want, have in zip(shape, array.shape, strict=True)
        ):
            wanted = tuple("n" if want is None else want for want in shape)
            raise MeshError(
                f"{self.name}: {field} has the shape {array.shape}, not {wanted}".replace("'", "")
            )
        object.__setattr__(self, field, frozen(array))
        return array

    def _converted(self, field: str, array: npt.NDArray[Any], dtype: type) -> npt.NDArray[Any]:
        """Return a contiguous array of the given type; integers stay what they are."""
        if np.issubdtype(dtype, np.integer) and array.size:
            if array.dtype.kind not in "iu":
                raise MeshError(f"{self.name}: {field} must be integers, not {array.dtype}")
            limits = np.iinfo(dtype)
            if array.dtype.itemsize >= 4 and (array.max() > limits.max or array.min() < limits.min):
                raise MeshError(f"{self.name}: {field} has an index out of range")
        with np.errstate(over="ignore"):  # what float32 does not hold is found not finite
            return np.ascontiguousarray(array, dtype=dtype)

    def _check_pair(self, values: str, corners: str, width: int, noun: str) -> None:
        if (getattr(self, values) is None) != (getattr(self, corners) is None):
            raise MeshError(f"{self.name}: {values} and {corners} belong together; one is missing")
        if getattr(self, values) is None:
            return
        n_values = len(self._adopt(values, np.float64, (None, width)))
        self._adopt(corners, np.int32, (len(self.faces), 3))
        self._check_finite(values, f"a {noun}")
        self._check_indices(corners, n_values, noun)

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

    def _check_finite(self, field: str, noun: str) -> None:
        array = getattr(self, field)
        if array is None:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            if np.isfinite(array.sum()):  # a finite sum has only finite terms
                return
        bad = ~np.isfinite(array).reshape(len(array), -1).all(axis=1)
        if bad.any():
            raise MeshError(
                f"{self.name}: {noun} is not finite "
                f"({int(bad.sum())} of {len(array)}, the first at index {int(bad.argmax())})"
            )

    def _check_indices(self, field: str, n_values: int, noun: str) -> None:
        indices = getattr(self, field)
        if indices is None or len(indices) == 0:
            return
        if indices.min() < 0 or indices.max() >= n_values:
            bad = ((indices < 0) | (indices >= n_values)).reshape(len(indices), -1).any(axis=1)
            raise MeshError(
                f"{self.name}: a {noun} index is out of range "
                f"(face {int(bad.argmax())}; there are {n_values})"
            )


def check_face_count(n_faces: int, name: str) -> None:
    """Raise `MeshError` if a mesh has more faces than int32 can number half-edges for."""
    if n_faces > MAX_FACES:
        raise MeshError(
            f"{name}: it has {n_faces:,} triangles; {MAX_FACES:,} are the most; "
            "split it into several files"
        )


def check_corner_count(n_corners: int, path: PathLike) -> None:
    """Raise `FileFormatError` if a file places too many corners, or vertices, together.

    For readers of formats in which many nodes share a mesh, before that is copied.
    """
    if n_corners > MAX_CORNERS:
        raise FileFormatError(
            f"{path}: it places more triangles than 32-bit indices can count; split it into "
            "several files"
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
