"""Safe repairs of a mesh: those that move nothing on its surface.

Vertices of one object at one position are joined, and those that no face uses removed; faces
without area and duplicate faces are removed; neighbors are flipped so that they wind alike, and
closed parts so that they face outwards. What cannot be repaired without changing the surface
(holes, edges with three faces, parts that intersect) is left as it is; `texbake.check` names it. A
mesh that was repaired is not changed by another repair.

Based on: Herbert Edelsbrunner, John Harer, "Computational Topology", American Mathematical Society,
2010 (the orientable double cover, by which all faces are oriented at once).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.compose import CORNERS, turned_over
from texbake.mesh.frame import LocalFrame
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.objects import joined_objects, vertex_objects
from texbake.mesh.options import RepairOptions
from texbake.mesh.topology import degenerate_faces, duplicate_faces, edge_neighbors
from texbake.mesh.uv_sets import sets_by_corner
from texbake.mesh.weld import weld_rows


@dataclass(frozen=True)
class RepairReport:
    """What `repair` did.

    Attributes
    ----------
    n_faces : int
        Polygons of the repaired mesh.
    counts : dict of str to int
        How many vertices or polygons each repair changed, by its name.
    """

    n_faces: int
    counts: Mapping[str, int]


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
    """Join vertices of one position, color and object, and leave out those that no face uses."""
    columns = [mesh.positions, mesh.colors, vertex_objects(mesh)]
    faces = weld_rows(np.column_stack([each for each in columns if each is not None]))[mesh.faces]
    used, compact = np.unique(faces, return_inverse=True)
    colors = None if mesh.colors is None else mesh.colors[used]
    merged = mesh.replace(
        positions=mesh.positions[used],
        faces=compact.reshape(faces.shape).astype(np.int32),
        colors=colors,
        uv_sets=mesh.uv_sets,
        polygon_of=mesh.polygon_of,
    )
    return merged, mesh.n_vertices - merged.n_vertices


def _kept(mesh: Mesh, keep: npt.NDArray[np.bool_]) -> Mesh:
    if keep.all():
        return mesh
    fields = (*CORNERS, "tangents", "polygon_of", "face_groups")
    kept = {name: getattr(mesh, name) for name in fields if getattr(mesh, name) is not None}
    changes: dict[str, Any] = {name: values[keep] for name, values in kept.items()}
    return mesh.replace(**changes, uv_sets=sets_by_corner(mesh, keep))


def misoriented(mesh: Mesh) -> npt.NDArray[np.bool_]:
    """(F,) bool: faces to flip so that neighbors agree and closed parts face outwards.

    A part without an inside keeps the side that most of its faces show, and one with a single side,
    such as a Möbius strip, is left as it is. Each face is two nodes of a graph, one as it is and
    one flipped; neighbors that agree are linked like with like, others crosswise. A connected
    component is then one way to orient a part.

    Kernel: `core/union_find.c`.
    """
    n = mesh.n_faces
    pairs = edge_neighbors(mesh.faces)
    first, second, crossed = pairs.first, pairs.second, np.where(pairs.agree, 0, n)
    nodes = np.concatenate([first, first + n]).astype(np.int32)
    neighbors = np.concatenate([second + crossed, second + (n - crossed)]).astype(np.int32)
    components = np.arange(2 * n, dtype=np.int32)
    core.merge_labels(components, nodes, neighbors)
    as_is, over = components[:n], components[n:]
    parts = np.minimum(as_is, over)
    flags: npt.NDArray[np.bool_] = as_is > over
    is_open = np.zeros(2 * n, dtype=np.bool_)
    is_open[parts[pairs.at_other_edges]] = True
    is_open[parts[as_is == over]] = True
    volumes = np.bincount(parts, weights=_cone_volumes(mesh) * np.where(flags, -1, 1))
    most_turned = 2 * np.bincount(parts, weights=flags) > np.bincount(parts)
    inside_out = np.where(is_open[: len(volumes)], most_turned, volumes < 0.0)
    inside_out[parts[as_is == over]] = False
    turned: npt.NDArray[np.bool_] = flags ^ inside_out[parts]
    return turned


def _cone_volumes(mesh: Mesh) -> npt.NDArray[np.float64]:
    """(F,) signed volumes between each face and the middle of the mesh, in its local frame."""
    corners = LocalFrame.around(mesh).to_local(mesh.positions)[mesh.faces]
    volumes: npt.NDArray[np.float64] = pm.vecdot(
        corners[:, 0], np.cross(corners[:, 1], corners[:, 2])
    )
    return volumes
