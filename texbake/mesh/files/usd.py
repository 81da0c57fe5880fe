"""Reading USD: .usd, .usda, .usdc and .usdz; docs/reference/formats.md says what is read.

Z up becomes Y up as in glTF: (x, y, z) becomes (x, z, -y). Each mesh is a group of its name, and
where it has subsets of faces, each of those; in a stage of several meshes subsets are named
``mesh/subset``. Prims that are inactive, or there for guides or as proxies, are left out.

Based on: Pixar, "Universal Scene Description", UsdGeom, release 26.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mesh.compose import join_parts
from texbake.mesh.files.conversion import check_corner_count
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.unread_parts import warn_of_cages
from texbake.mesh.files.usd_stage import meters_per_unit, open_stage, reporting_damage
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Int64Array, Mesh, UvSet
from texbake.mesh.polygons import triangulated
from texbake.mesh.weld import unique_corners
from texbake.records import dataclass

_Y_FROM_Z = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])


def read_usd(path: PathLike) -> Mesh:
    """Read a USD file; see the module for how a stage is converted."""
    mesh: Mesh = read_in_child(path, "mesh", {"Mesh": Mesh, "UvSet": UvSet})
    return mesh


def mesh_of_stage(path: PathLike) -> Mesh:
    """Answer for `read_usd`."""
    stage = open_stage(path)
    with reporting_damage(path):
        parts = read_parts(path, stage)
    if not parts:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    warn_of_cages(path, sum(_is_subdivided(part.prim) for part in parts))
    meshes = [part.mesh for part in parts]
    return join_parts(meshes, Path(path).name, np.array([part.matrix for part in parts]))


def _is_subdivided(prim: Any) -> bool:
    """Whether a mesh says that it is a subdivision surface, which it is also if it says nothing."""
    from pxr import UsdGeom

    scheme = UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr()
    return bool(scheme.HasAuthoredValue()) and scheme.Get() != UsdGeom.Tokens.none


@dataclass(frozen=True, eq=False)
class UsdPart:
    """A mesh of a stage."""

    mesh: Mesh  # in its own space
    holders: list[Any]  # prim of each group: a subset, or that of the mesh
    prim: Any  # that of the mesh
    matrix: FloatArray  # (4, 4) float64; to the world


def read_parts(path: PathLike, stage: Any) -> list[UsdPart]:
    """Meshes of a stage that have faces."""
    to_world = _world_matrix(stage)
    parts = []
    n_corners = 0
    placed = list(_placed_meshes(stage))
    for prim, matrix in placed:
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = pm.matmul(to_world, matrix)
        geometry = _MeshReader(path, prim).read(is_alone=len(placed) == 1)
        if geometry is None:
            continue
        part = UsdPart(*geometry, prim, matrix)
        n_corners += max(part.mesh.faces.size, part.mesh.n_vertices)
        check_corner_count(n_corners, path)
        parts.append(part)
    return parts


def _world_matrix(stage: Any) -> FloatArray:
    """(4, 4) matrix of a stage's axes and unit to Y up and meters."""
    from pxr import UsdGeom

    matrix = _Y_FROM_Z if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else np.eye(4)
    meters = meters_per_unit(stage) or 1.0
    return np.asarray(pm.matmul(matrix, np.diag([meters, meters, meters, 1.0])))


def _placed_meshes(stage: Any) -> Iterator[tuple[Any, FloatArray]]:
    """Mesh prims that are shown, each with its (4, 4) matrix to the world."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    prims = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer) or _is_hidden(prim):
            prims.PruneChildren()
        elif prim.IsA(UsdGeom.Mesh):
            # Points are rows there.
            yield prim, np.array(cache.GetLocalToWorldTransform(prim)).T


def _is_hidden(prim: Any) -> bool:
    from pxr import Usd, UsdGeom

    if not prim.IsA(UsdGeom.Imageable):
        return False
    imageable = UsdGeom.Imageable(prim)
    visibility = imageable.GetVisibilityAttr().Get(Usd.TimeCode.EarliestTime())
    purpose = imageable.GetPurposeAttr().Get()
    return visibility == "invisible" or purpose in ("guide", "proxy")


# Types of texture coordinates; the dedicated types come first.
_PAIRS = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]", "half2[]")


class _MeshReader:
    """Reads a mesh prim: its polygons, their groups, and the values of their corners."""

    def __init__(self, path: PathLike, prim: Any) -> None:
        from pxr import Usd, UsdGeom

        self.path, self.prim = path, prim
        self.mesh, self.time = UsdGeom.Mesh(prim), Usd.TimeCode.EarliestTime()
        self.points = self.numbers(self.mesh.GetPointsAttr().Get(self.time) or (), np.float64)
        self.sizes = self.integers(self.mesh.GetFaceVertexCountsAttr())
        self.vertices = self.integers(self.mesh.GetFaceVertexIndicesAttr())

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError` about the mesh."""
        raise FileFormatError(f"{self.path}: {self.prim.GetPath()}: {what}; export it again")

    def numbers(self, values: Any, kind: type[np.generic]) -> AnyArray:
        """Return what the library has read, which may be anything, as numbers of a kind."""
        try:
            with np.errstate(invalid="ignore"):  # NaN that signals is NaN like any other
                return np.array(values, kind)
        except (TypeError, ValueError, OverflowError):
            raise FileFormatError(
                f"{self.path}: it holds {type(values).__name__} where numbers belong; "
                "export it again"
            ) from None

    def integers(self, attribute: Any) -> Int64Array:
        """(n,) integers of an attribute; none where it has no value."""
        values = attribute.Get(self.time)
        return self.numbers(() if values is None else values, np.int64).ravel()

    def read(self, *, is_alone: bool) -> tuple[Mesh, list[Any]] | None:
        """Return the mesh in its own space, and the prim of each group; None without a face."""
        from pxr import UsdGeom

        points, sizes, vertices = self.points, self.sizes, self.vertices
        if points.size == 0 or len(sizes) == 0:
            return None
        if points.ndim != 2 or points.shape[1] != 3:
            self.fail(f"its points have the shape {points.shape}, not 3 numbers each")
        if sizes.min() < 0 or sizes.sum() != len(vertices):
            self.fail(f"its faces count {sizes.sum()} corners, and {len(vertices)} are there")
        if vertices.size and (vertices.min() < 0 or vertices.max() >= len(points)):
            self.fail(f"a corner is none of its {len(points)} points")
        slots, polygons = triangulated(self.path, points, vertices, sizes)
        is_filled = ~np.isin(polygons, self.integers(self.mesh.GetHoleIndicesAttr()))
        slots, polygons = slots[is_filled], polygons[is_filled]
        if len(slots) == 0:
            return None
        if self.mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            slots = slots[:, ::-1]
        groups, holders = self._groups()
        own, names = prim_name(self.prim), map(prim_name, holders)
        prefix = "" if is_alone else f"{own}/"
        fields: dict[str, Any] = {"colors": self._colors()}
        for values, corners, source, width in (
            ("uvs", "uv_faces", texture_coordinates(self.prim), 2),
            ("normals", "normal_faces", self._normals(), 3),
        ):
            if (found := self._values(source, width)) is not None:
                fields |= {values: found[0], corners: found[1][slots]}
        tangents = self._values(_primvar(self.prim, "tangents"), 4)
        if tangents is not None:
            fields["tangents"] = tangents[0][tangents[1][slots]]
        mesh = Mesh(
            positions=points,
            faces=vertices[slots].astype(np.int32),
            polygon_of=polygons.astype(np.int32),
            face_groups=groups[polygons].astype(np.int32),
            group_names=tuple(name if name == own else f"{prefix}{name}" for name in names),
            name=Path(self.path).name,
            **fields,
        )
        return mesh, holders

    def _groups(self) -> tuple[Int64Array, list[Any]]:
        """Group of each polygon, and the prims of the groups: subsets, else the mesh itself."""
        from pxr import UsdGeom

        groups = np.full(len(self.sizes), -1)
        holders: list[Any] = []
        for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(self.prim)):
            if subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
                continue
            faces = self.integers(subset.GetIndicesAttr())
            groups[faces[(faces >= 0) & (faces < len(groups))]] = len(holders)
            holders.append(subset.GetPrim())
        if (groups < 0).any():
            groups[groups < 0] = len(holders)
            holders.append(self.prim)
        return groups, holders

    def _colors(self) -> Float32Array | None:
        """Colors at points, with opacities; None where the mesh has one color as a whole."""
        columns = []
        for name, width in (("displayColor", 3), ("displayOpacity", 1)):
            primvar = _primvar(self.prim, name)
            if primvar is None or primvar.GetInterpolation() not in ("vertex", "varying"):
                break
            values = primvar.ComputeFlattened(self.time)
            if values is None or len(values) != len(self.points):
                break
            columns.append(self.numbers(values, np.float32).reshape(-1, width))
        return np.concatenate(columns, axis=1) if columns else None

    def _normals(self) -> Any:
        """Return the primvar `normals`, or else the attribute; None without either."""
        attribute = self.mesh.GetNormalsAttr()
        primvar = _primvar(self.prim, "normals")
        return primvar or (attribute if attribute.Get(self.time) else None)

    def _values(self, source: Any, width: int) -> tuple[FloatArray, Int64Array] | None:
        """(n, width) values, and the row of each corner; None without a source."""
        from pxr import UsdGeom

        if source is None:
            return None
        name = source.GetName()
        if isinstance(source, UsdGeom.Primvar):
            interpolation, indices = source.GetInterpolation(), source.GetIndices(self.time)
        else:
            interpolation, indices = self.mesh.GetNormalsInterpolation(), None
        array = self.numbers(source.Get(self.time), np.float64)
        if array.ndim != 2 or array.shape[1] != width:
            if name.endswith("tangents"):
                return None  # no rule of the format names them, and others may mean something else
            self.fail(f"{name}: it has the shape {array.shape}, not {width} numbers a value")
        elements = self._elements(interpolation)
        if indices:
            table = self.numbers(indices, np.int64)
            if len(elements) and elements.max() >= len(table):
                n_places = elements.max() + 1
                self.fail(f"{name}: it has {len(table)} indices for {n_places} places")
            elements = table[elements]
        if len(elements) and (elements.min() < 0 or elements.max() >= len(array)):
            self.fail(f"{name}: it has {len(array)} values, and an index points outside of them")
        is_listed = interpolation == "faceVarying" and not indices
        if is_listed and len(array) != len(elements):
            self.fail(f"{name}: it has {len(array)} values for {len(elements)} corners")
        if is_listed and np.isfinite(array).all():
            array, numbers = unique_corners(self.vertices, array)
            elements = numbers.astype(np.int64)
        return array, elements

    def _elements(self, interpolation: str) -> Int64Array:
        """(C,) element that each corner takes its value from."""
        if interpolation == "faceVarying":
            return np.arange(len(self.vertices))
        if interpolation == "uniform":
            return np.repeat(np.arange(len(self.sizes)), self.sizes)
        return 0 * self.vertices if interpolation == "constant" else self.vertices


def _primvar(prim: Any, name: str) -> Any:
    from pxr import UsdGeom

    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    return primvar if primvar and primvar.HasValue() else None


def texture_coordinates(prim: Any) -> Any:
    """Return the primvar `st`, else the first that has two floats per corner; None where none."""
    from pxr import UsdGeom

    named = _primvar(prim, "st")
    if named is not None:
        return named
    primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
    pairs = [p for p in primvars if str(p.GetTypeName()) in _PAIRS and p.HasValue()]
    return min(pairs, key=lambda p: _PAIRS.index(str(p.GetTypeName())), default=None)


def prim_name(prim: Any) -> str:
    """Return the name of a prim that programs display."""
    return str(prim.GetDisplayName() or prim.GetName())
