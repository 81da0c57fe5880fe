"""Texture coordinates by face corner: what a mapping returns, how a mesh stores them, their areas.

A mapping may cover one group of faces alone; the other faces then keep the coordinates they have.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError, UvError
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.weld import unique_rows
from texbake.records import dataclass

_NAMES_SHOWN = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Projected:
    """Texture coordinates of the corners of faces."""

    corners: FloatArray  # (F, 3, 2) float64; (s, t) of each corner, finite
    # Counts of special cases by name, such as "faces touching a pole"; zeros are left out.
    tallies: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # for the report
    padding: int | None = None  # texels of space around each chart
    stacked: BoolArray | None = None  # (F,); faces that lie on others on purpose

    def __post_init__(self) -> None:
        happened = {name: count for name, count in self.tallies.items() if count}
        object.__setattr__(self, "tallies", happened)


def with_coordinates(mesh: Mesh, corners: FloatArray) -> Mesh:
    """Give a mesh coordinates (F, 3, 2) by corner, equal ones of a vertex once; drop tangents."""
    uvs, uv_faces = joined_corners(mesh.faces, corners)
    return mesh.replace(uvs=uvs, uv_faces=uv_faces, tangents=None)


def joined_corners(faces: IntArray, corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Weld coordinates (F, 3, 2) of corners at a vertex into uvs (T, 2) and uv_faces (F, 3)."""
    # Rows are welded by values of one type; a vertex index is exact as a float64.
    rows = np.empty((faces.size, 3))
    rows[:, 0] = faces.ravel()
    rows[:, 1:] = corners.reshape(-1, 2) + 0.0  # -0.0 becomes 0.0
    used, uv_faces = unique_rows(rows)
    return np.ascontiguousarray(rows[used, 1:]), uv_faces.reshape(-1, 3)


def of_whole_mesh(part: Projected, faces: BoolArray) -> Projected:
    """Coordinates of the chosen `faces` (F,), with `stacked` by the faces of the mesh."""
    if part.stacked is None:
        return part
    stacked = np.zeros(len(faces), dtype=bool)
    stacked[faces] = part.stacked
    return replace(part, stacked=stacked)


def faces_of_group(mesh: Mesh, name: str) -> BoolArray:
    """(F,) bool: the faces of a group."""
    if not mesh.group_names or mesh.face_groups is None:
        raise OptionError(f"only: {mesh.name} has no groups, so none is named {name}")
    ids = [i for i, known in enumerate(mesh.group_names) if known == name]
    chosen = np.isin(mesh.face_groups, ids)
    if not chosen.any():
        names = ", ".join(mesh.group_names[:_NAMES_SHOWN])
        more = ", ..." if len(mesh.group_names) > _NAMES_SHOWN else ""
        raise OptionError(f"only: {mesh.name} has no faces in a group {name}; it has {names}{more}")
    return chosen


def selected(mesh: Mesh, chosen: BoolArray) -> Mesh:
    """Mesh of the chosen faces; all vertices stay, used or not."""

    def kept(by_face: AnyArray | None) -> AnyArray | None:
        return None if by_face is None else by_face[chosen]

    return mesh.replace(
        faces=mesh.faces[chosen],
        uv_faces=kept(mesh.uv_faces),
        normal_faces=kept(mesh.normal_faces),
        tangents=kept(mesh.tangents),
        polygon_of=kept(mesh.polygon_of),
        face_groups=kept(mesh.face_groups),
    )


# In model units or texture tiles. Its fourth power, the square of an area, is still finite.
_LONGEST = 1e75


def signed_areas(corners: FloatArray) -> FloatArray:
    """(F,) areas of triangles (F, 3, 2) in the texture, negative where mirrored."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0)


def surface_areas(corners: FloatArray) -> FloatArray:
    """(F,) areas of triangles (F, 3, 3) in space."""
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(pm.norm(crosses, axis=1) / 2.0)


def unmeasurable_size(mesh: Mesh) -> tuple[float, float] | None:
    """Length and greatest coordinate of a mesh whose squared areas leave float64; else None."""
    with np.errstate(over="ignore"):
        low, high = mesh.bounds
        length = float((high - low).max())
        farthest = float(np.abs(mesh.bounds).max())
    if farthest > _LONGEST or 0.0 < length < 1.0 / _LONGEST:
        return length, farthest
    return None


def check_measurable(mesh: Mesh) -> None:
    """Raise `MeshError` if areas, or their squares, would leave the range of float64."""
    size = unmeasurable_size(mesh)
    if size is not None:
        length, farthest = size
        raise MeshError(
            f"{mesh.name}: it is {length:.3g} model units long and extends up to {farthest:.3g} "
            "from the origin, so its areas cannot be computed; scale it first"
        )


def has_measurable_uvs(mesh: Mesh) -> bool:
    """Whether areas in the texture, and their squares, stay within the range of float64."""
    return mesh.uvs is None or float(np.abs(mesh.corner_uvs()).max()) <= _LONGEST


def measurable_uvs(mesh: Mesh) -> FloatArray:
    """(F, 3, 2) float64: texture coordinates of the corners, checked so that areas are finite."""
    corners = mesh.corner_uvs()
    if not float(np.abs(corners).max()) <= _LONGEST:
        raise UvError(
            f"{mesh.name}: its texture coordinates lie up to {np.abs(corners).max():.3g} tiles "
            "from the origin, so areas in the texture cannot be computed; make new ones with: "
            f"texbake unwrap {mesh.name} -o OUT"
        )
    return corners
