"""Counts and measures of a mesh, as ``texbake info`` prints them."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.frame import unit_scale
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import duplicate_faces, face_components, find_edges, genus
from texbake.records import dataclass

_BLOCK = 1 << 16  # faces measured at once


@dataclass(frozen=True, kw_only=True)
class UvInfo:
    """Texture coordinates of a mesh; counts of faces are those of polygons with such a triangle."""

    n_uvs: int
    # Least and greatest coordinates that faces use.
    bounds: tuple[tuple[float, float], tuple[float, float]]
    n_out_of_tile: int  # faces with a corner outside the unit square
    n_without_area: int  # faces whose three coordinates lie on one line
    n_mirrored: int  # faces that are clockwise in texture space


@dataclass(frozen=True, kw_only=True)
class GroupInfo:
    """A group and how many polygons it has."""

    name: str
    n_faces: int


@dataclass(frozen=True, kw_only=True)
class MeshInfo:
    """Counts and measures of a mesh, all plain Python values, of faces as polygons.

    Except for `n_split_vertices`, vertices of one object at one position count as one.
    """

    name: str
    n_vertices: int
    # polygons of the file, and the triangles that they are cut into
    n_faces: int
    n_triangles: int
    # least and greatest coordinates of the vertices that faces use, in model units
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    # of the bounding box, and of all faces together; in model units and their squares
    diagonal: float
    area: float
    uvs: UvInfo | None
    n_normals: int | None  # None if the mesh has no normals, as `uvs` for texture coordinates
    has_tangents: bool
    has_colors: bool
    groups: tuple[GroupInfo, ...]
    n_components: int  # shells of the mesh: connected pieces that share no vertex
    # Edges of one face; of more than two; of two that do not agree on which side is outside. The
    # latter two leave out degenerate and duplicate faces, as `check` does.
    n_boundary_edges: int
    n_non_manifold_edges: int
    n_misoriented_edges: int
    # faces without area; faces with the same three vertices as an earlier one
    n_degenerate_faces: int
    n_duplicate_faces: int
    # vertices of no face; vertices at the place of an earlier one of their object
    n_unused_vertices: int
    n_split_vertices: int
    closed: bool  # every edge has exactly two faces
    # number of handles over all components; None where the mesh is not a closed, consistently
    # oriented manifold
    genus: int | None

    def to_json(self) -> str:
        """Return all of it as one JSON object, indented; an area that is infinite becomes null."""
        area = self.area if math.isfinite(self.area) else None
        return json.dumps({**asdict(self), "area": area}, indent=2, allow_nan=False)


def mesh_info(mesh: MeshLike) -> MeshInfo:
    """Count and measure a mesh.

    Examples
    --------
    >>> info = mesh_info(Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]]))
    >>> info.area, info.n_boundary_edges, info.closed
    (0.5, 3, False)
    """
    mesh = as_mesh(mesh)
    firsts = weld_vertices(mesh)
    is_first = firsts == np.arange(len(firsts))
    faces = mesh.faces if is_first.all() else firsts[mesh.faces]
    edges = find_edges(faces)
    without_area, repeated = degenerate_faces(mesh), duplicate_faces(faces)
    is_surface = ~(without_area | repeated)
    surface = edges if is_surface.all() else find_edges(faces[is_surface])
    used = mesh.used_vertices
    low, high = mesh.bounds.tolist()
    return MeshInfo(
        name=mesh.name,
        n_vertices=mesh.n_vertices,
        n_faces=mesh.n_polygons,
        n_triangles=mesh.n_faces,
        bounds=(tuple(low), tuple(high)),
        diagonal=mesh.diagonal,
        area=_area(mesh),
        uvs=_uv_info(mesh),
        n_normals=None if mesh.normals is None else len(mesh.normals),
        has_tangents=mesh.tangents is not None,
        has_colors=mesh.colors is not None,
        groups=_groups(mesh),
        n_components=face_components(faces, mesh.n_vertices)[1],
        n_boundary_edges=int(edges.boundary.sum()),
        n_non_manifold_edges=int(surface.non_manifold.sum()),
        n_misoriented_edges=int(surface.misoriented.sum()),
        n_degenerate_faces=mesh.count_polygons(without_area),
        n_duplicate_faces=mesh.count_polygons(repeated),
        n_unused_vertices=int((~used).sum()),
        n_split_vertices=int((~is_first).sum()),
        closed=edges.closed,
        genus=genus(faces, edges, mesh.n_vertices),
    )


def _area(mesh: Mesh) -> float:
    """Of all faces; infinite where float64 does not hold it."""
    scale = unit_scale(float(np.abs(mesh.bounds).max()))
    area = 0.0
    for start in range(0, mesh.n_faces, _BLOCK):
        a, b, c = mesh.positions[mesh.faces[start : start + _BLOCK].T] * scale
        area += 0.5 * float(pm.norm(np.cross(b - a, c - a), axis=1).sum())
    return area / scale / scale


def _groups(mesh: Mesh) -> tuple[GroupInfo, ...]:
    if mesh.face_groups is None:
        return ()
    groups = mesh.face_groups
    if mesh.polygon_of is not None:
        groups = groups[np.diff(mesh.polygon_of, prepend=-1) > 0]
    counts = np.bincount(groups, minlength=len(mesh.group_names)).tolist()
    return tuple(
        GroupInfo(name=name, n_faces=count)
        for name, count in zip(mesh.group_names, counts, strict=True)
    )


def _uv_info(mesh: Mesh) -> UvInfo | None:
    if mesh.uvs is None:
        return None
    corners = mesh.corner_uvs()
    low, high = corners.min(axis=(0, 1)).tolist(), corners.max(axis=(0, 1)).tolist()
    outside = ((corners < 0.0) | (corners > 1.0)).any(axis=(1, 2))
    edges = corners[:, 1:] / 2.0 - corners[:, :1] / 2.0
    # Each face made about 1 large, which changes no sign, and no product overflows.
    edges = np.ldexp(edges, -np.frexp(np.abs(edges).max(axis=(1, 2)))[1][:, None, None])
    areas = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return UvInfo(
        n_uvs=len(mesh.uvs),
        bounds=(tuple(low), tuple(high)),
        n_out_of_tile=mesh.count_polygons(np.asarray(outside)),
        n_without_area=mesh.count_polygons(areas == 0.0),
        n_mirrored=mesh.count_polygons(areas < 0.0),
    )
