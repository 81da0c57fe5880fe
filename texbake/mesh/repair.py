"""Safe repairs of a mesh: those that move nothing on its surface.

Vertices of one object at one position are joined; unused vertices, faces without area and duplicate
faces go; neighbors are wound alike, and closed parts face outwards. Holes, edges with three faces
and parts that intersect stay; `texbake.check` names them. A second repair changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.compose import face_fields, turned_over, used_rows
from texbake.mesh.frame import LocalFrame
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.objects import joined_objects, moving_alike, vertex_objects
from texbake.mesh.options import RepairOptions
from texbake.mesh.topology import duplicate_faces, edge_neighbors, wind_alike
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass


@dataclass(frozen=True)
class RepairReport:
    """What `repair` did."""

    n_faces: int  # polygons of the repaired mesh
    counts: Mapping[str, int]  # how many vertices or polygons each repair changed, by its name


def repair(mesh: MeshLike, options: RepairOptions | None = None) -> tuple[Mesh, RepairReport]:
    """Repair a mesh without moving its surface.

    Parameters
    ----------
    mesh : Mesh
    options
        None for all repairs.

    Returns
    -------
    mesh : Mesh
        Faces keep their order, texture coordinates, normals, groups and colors. Faces that are
        flipped take their normals with them.
    report : RepairReport

    Raises
    ------
    MeshError
        No face has an area.
    """
    mesh = as_mesh(mesh)
    options = options or RepairOptions()
    if options.join_objects:
        mesh = joined_objects(mesh)
    counts = {}
    if not options.coordinates:
        mesh = mesh.replace(uvs=None, uv_faces=None, uv_sets={}, tangents=None)
    if options.merge:
        mesh, counts["vertices merged"] = _merged(mesh)
    if options.degenerate:
        flat = degenerate_faces(mesh)
        if flat.all():
            raise MeshError(f"{mesh.name}: no face has an area")
        counts["faces without area"] = mesh.count_polygons(flat)
        mesh = _kept(mesh, ~flat)
    if options.duplicates:
        twice = duplicate_faces(mesh.faces)
        counts["duplicate faces"] = mesh.count_polygons(twice)
        mesh = _kept(mesh, ~twice)
    if options.merge:  # those of the faces that were removed, which nothing uses any more
        mesh, n_unused = _merged(mesh)
        counts["vertices merged"] += n_unused
    if options.winding:
        turned = misoriented(mesh)
        counts["faces turned"] = mesh.count_polygons(turned)
        mesh = turned_over(mesh, turned)
    mesh = with_normals(mesh, options.normals, angle=options.angle)
    return mesh, RepairReport(mesh.n_polygons, counts)


def _merged(mesh: Mesh) -> tuple[Mesh, int]:
    """Join vertices of one position, color, object and motion; leave out those without a face."""
    columns = [mesh.positions, mesh.colors, vertex_objects(mesh)]
    firsts = weld_rows(np.column_stack([each for each in columns if each is not None]))
    faces = moving_alike(mesh, firsts)[mesh.faces]
    used, compact = used_rows(faces, mesh.n_vertices)
    merged = mesh.replace(
        positions=mesh.positions[used],
        deformation=None if mesh.deformation is None else mesh.deformation.of(used),
        faces=compact,
        colors=None if mesh.colors is None else mesh.colors[used],
        uv_sets=mesh.uv_sets,
        polygon_of=mesh.polygon_of,
    )
    return merged, mesh.n_vertices - merged.n_vertices


def _kept(mesh: Mesh, keep: BoolArray) -> Mesh:
    return mesh if keep.all() else mesh.replace(**face_fields(mesh, keep))


def misoriented(mesh: Mesh) -> BoolArray:
    """(F,) bool: faces to flip so that neighbors agree and closed parts face outwards."""
    n = mesh.n_faces
    pairs = edge_neighbors(mesh.faces)
    first, second = pairs.first, pairs.second
    parts, flips = wind_alike(n, (first, second), pairs.agree)
    is_torn = pairs.agree == (flips[first] ^ flips[second])
    is_one_sided = np.zeros(n, dtype=np.bool_)
    is_one_sided[parts[first[is_torn]]] = True
    is_open = is_one_sided.copy()
    is_open[parts[pairs.at_other_edges]] = True
    of_closed = ~is_open[parts]
    corners = LocalFrame.around(mesh).to_local(mesh.positions)[mesh.faces[of_closed]]
    a, b, c = np.moveaxis(corners, 1, 0)
    cones = pm.vecdot(a, np.cross(b, c))  # volumes between the faces and the middle of the mesh
    volumes = np.bincount(parts[of_closed], cones * np.where(flips[of_closed], -1, 1), n)
    most_turned = 2 * np.bincount(parts, flips, n) > np.bincount(parts, minlength=n)
    inside_out = np.where(is_open, most_turned, volumes < 0.0)
    return np.asarray((flips ^ inside_out[parts]) & ~is_one_sided[parts])
