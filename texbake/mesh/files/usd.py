"""Reading USD: .usd, .usda, .usdc and .usdz.

All meshes of the stage are joined into one, in world space, at the stage's first time. Differences
between stages are removed:

- A stage that is Z up is turned to Y up, as glTF is: (x, y, z) becomes (x, z, -y).
- Lengths become meters where the stage says how many a unit has; else they stay as they are.
- Left-handed meshes list their corners the other way round.

For polygons see `texbake.mesh.polygons`; a subdivision surface is read as its control mesh. Each
mesh is a group of its name, and where it has subsets of faces, each of those; in a stage of several
meshes subsets are named ``mesh/subset``. Prims that are invisible, inactive, or there for guides or
as proxies are left out, and so are point instancers, curves and points.

Based on: Pixar, "Universal Scene Description", UsdGeom, release 26.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.unread_parts import warn_of_cages
from texbake.mesh.files.usd_stage import (
    UsdCorners,
    numbers_of,
    open_stage,
    read_colors,
    read_primvars,
    reporting_damage,
)
from texbake.mesh.join import join_parts
from texbake.mesh.mesh import FloatArray, Mesh, UvSet, check_corner_count
from texbake.mesh.polygons import triangulated

_Y_FROM_Z = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])


def read_usd(path: PathLike) -> Mesh:
    """Read a USD file; see the module for how a stage is converted.

    Positions, normals, texture coordinates (the primvar `st`, else the first of the role
    TextureCoordinate or of two floats per corner), tangents of four floats per corner (`tangents`),
    display colors at vertices, and subsets.
    """
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
    prim: Any  # that of the mesh
    holders: tuple[Any, ...]  # prim of each group: a subset, or that of the mesh
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
        part = _read_mesh(path, prim, matrix, is_alone=len(placed) == 1)
        if part is None:
            continue
        n_corners += max(part.mesh.faces.size, part.mesh.n_vertices)
        check_corner_count(n_corners, path)
        parts.append(part)
    return parts


def _world_matrix(stage: Any) -> FloatArray:
    """(4, 4) matrix of a stage's axes and unit to Y up and meters."""
    from pxr import UsdGeom

    matrix = _Y_FROM_Z if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else np.eye(4)
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        return matrix
    meters = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not 0.0 < meters < np.inf:
        return matrix
    return np.asarray(pm.matmul(matrix, np.diag([meters, meters, meters, 1.0])))


def _placed_meshes(stage: Any) -> Iterator[tuple[Any, FloatArray]]:
    """Mesh prims that are shown, each with its (4, 4) matrix to the world."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())
    prims = iter(prims)
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


def _read_mesh(path: PathLike, prim: Any, matrix: FloatArray, *, is_alone: bool) -> UsdPart | None:
    """One mesh in its own space, or None where it has no face."""
    from pxr import Usd, UsdGeom

    usd_mesh = UsdGeom.Mesh(prim)
    time = Usd.TimeCode.EarliestTime()
    points = numbers_of(path, usd_mesh.GetPointsAttr().Get(time) or (), np.float64)
    counts = _integers(path, usd_mesh.GetFaceVertexCountsAttr().Get(time))
    point_of = _integers(path, usd_mesh.GetFaceVertexIndicesAttr().Get(time))
    if points.size == 0 or len(counts) == 0:
        return None
    if points.ndim != 2 or points.shape[1] != 3:
        _fail(path, prim, f"its points have the shape {points.shape}, not 3 numbers each")
    if counts.min() < 0 or counts.sum() != len(point_of):
        _fail(path, prim, f"its faces count {counts.sum()} corners, and {len(point_of)} are there")
    if point_of.size and (point_of.min() < 0 or point_of.max() >= len(points)):
        _fail(path, prim, f"a corner is none of its {len(points)} points")
    slots, polygons = triangulated(path, points, point_of, counts)
    holes = _integers(path, usd_mesh.GetHoleIndicesAttr().Get(time))
    kept = ~np.isin(polygons, holes)
    slots, polygons = slots[kept], polygons[kept]
    if len(slots) == 0:
        return None
    if usd_mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        slots = slots[:, ::-1]
    corners = UsdCorners(
        path=path,
        point_of=point_of,
        polygon_of=np.repeat(np.arange(len(counts)), counts),
        slots=slots,
        n_points=len(points),
    )
    groups, holders = _groups(path, prim, len(counts))
    own, names = prim_name(prim), [prim_name(holder) for holder in holders]
    prefix = "" if is_alone else f"{own}/"
    names = [name if name == own else f"{prefix}{name}" for name in names]
    mesh = Mesh(
        positions=points,
        faces=point_of[slots].astype(np.int32),
        polygon_of=polygons.astype(np.int32),
        face_groups=groups[polygons].astype(np.int32),
        group_names=tuple(names),
        name=Path(path).name,
        **read_primvars(prim, corners),
        **read_colors(prim, corners),
    )
    return UsdPart(mesh, prim, holders, matrix)


def _groups(
    path: PathLike, prim: Any, n_polygons: int
) -> tuple[npt.NDArray[np.int64], tuple[Any, ...]]:
    """Group of each polygon, and the prims of the groups: subsets, else the mesh itself."""
    from pxr import Usd, UsdGeom

    time = Usd.TimeCode.EarliestTime()
    groups = np.full(n_polygons, -1)
    holders: list[Any] = []
    for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)):
        if subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
            continue
        faces = _integers(path, subset.GetIndicesAttr().Get(time))
        faces = faces[(faces >= 0) & (faces < n_polygons)]
        groups[faces] = len(holders)
        holders.append(subset.GetPrim())
    if (groups < 0).any():
        groups[groups < 0] = len(holders)
        holders.append(prim)
    return groups, tuple(holders)


def prim_name(prim: Any) -> str:
    """Return the name of a prim that programs display."""
    return str(prim.GetDisplayName() or prim.GetName())


def _integers(path: PathLike, values: Any) -> npt.NDArray[np.int64]:
    return numbers_of(path, () if values is None else values, np.int64).ravel()


def _fail(path: PathLike, prim: Any, what: str) -> None:
    raise FileFormatError(f"{path}: {prim.GetPath()}: {what}; export it again")
