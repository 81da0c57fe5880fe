"""Scale, rotate, move and subdivide a mesh, or flip its faces.

Based on: E. Catmull, J. Clark, "Recursively generated B-spline surfaces on arbitrary topological
meshes", Computer-Aided Design 10 (6), 1978; borders after H. Biermann, A. Levin, D. Zorin,
"Piecewise smooth subdivision surfaces with normal control", SIGGRAPH 2000.

When polygons are divided, edges of one polygon, or of more than two, are sharp: they become cubic
curves. A vertex with one polygon, or with another number of sharp edges than two, stays where it
is. Texture coordinates are smoothed alike, but stay on the borders of their charts, as by default
in Blender. Creases that a file stores are not read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.compose import transformed, turned_over
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh, UvSet, check_face_count
from texbake.mesh.options import MOST_SUBDIVISIONS, UNITS, TransformOptions
from texbake.mesh.polygons import Outlines, next_corners, outlines, triangulated
from texbake.mesh.weld import row_sums, unique_rows

# Takes a mesh whose z axis points up to one whose y axis does.
Y_FROM_Z = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def transform(mesh: MeshLike, options: TransformOptions | None = None) -> Mesh:
    """Scale, rotate, move or subdivide a mesh, or flip its faces.

    Parameters
    ----------
    mesh : Mesh
    options
        None leaves the mesh as it is.

    Returns
    -------
    Mesh
        Texture coordinates, groups and colors stay; normals and tangents follow.

    Raises
    ------
    OptionError
        Positions are not finite numbers any more.
    """
    mesh = as_mesh(mesh)
    options = options or TransformOptions()
    mesh = subdivide(mesh, options.subdivide)
    matrix = transform_matrix(options)
    if not np.array_equal(matrix, np.eye(4)):
        with np.errstate(over="ignore", invalid="ignore"):
            largest = np.abs(matrix[:3, :3]).max() * np.abs(mesh.positions).max()
            if not np.isfinite(largest + np.abs(matrix).max()):
                raise OptionError("scale, move: positions would not be finite numbers any more")
        mesh = transformed(mesh, matrix)
    if options.flip:
        mesh = turned_over(mesh, np.ones(mesh.n_faces, np.bool_))
    return with_normals(mesh, options.normals, angle=options.angle)


def transform_matrix(options: TransformOptions) -> FloatArray:
    """(4, 4) map of all options but `flip`."""
    factor = options.scale * UNITS.get(options.units or "m", 1.0)
    linear = factor * (Y_FROM_Z if options.up == "z" else np.eye(3))
    for axis, angle in enumerate(options.rotate):
        linear = pm.matmul(_rotation(axis, angle), linear)
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = options.move
    return matrix


def _rotation(axis: int, degrees: float) -> FloatArray:
    """(3, 3) rotation about an axis, counter-clockwise; exact for quarter turns."""
    quarters = degrees / 90.0
    if quarters == round(quarters):
        cos, sin = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters % 4)]
    else:
        cos, sin = pm.cos(np.radians(degrees)), pm.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cos
    matrix[first, second], matrix[second, first] = -sin, sin
    return matrix


def subdivide(mesh: MeshLike, levels: int = 1) -> Mesh:
    """Subdivide a mesh after Catmull and Clark."""
    mesh = as_mesh(mesh)
    if not 0 <= levels <= MOST_SUBDIVISIONS:
        raise OptionError(f"subdivide: {levels} is not a number from 0 to {MOST_SUBDIVISIONS}")
    for _ in range(levels):
        mesh = _once(mesh)
    return mesh


def _once(mesh: Mesh) -> Mesh:
    polygons = outlines(mesh)
    n = len(polygons.slots)
    check_face_count(2 * n, mesh.name)
    rows = mesh.positions
    if mesh.colors is not None:
        rows = np.concatenate([rows, mesh.colors.astype(np.float64)], axis=1)
    refined, quads = _refined(rows, mesh.faces, polygons)
    positions = np.ascontiguousarray(refined[:, :3])
    corners, parents = triangulated(mesh.name, positions, quads.ravel(), np.full(n, 4))
    changes: dict[str, Any] = {"positions": positions, "faces": quads.ravel()[corners]}
    changes |= dict.fromkeys(("normals", "normal_faces", "tangents"))
    if mesh.colors is not None:
        changes["colors"] = np.clip(refined[:, 3:], 0.0, 1.0)
    if mesh.uvs is not None and mesh.uv_faces is not None:
        changes["uvs"], ids = _refined(mesh.uvs, mesh.uv_faces, polygons, keep_borders=True)
        changes["uv_faces"] = ids.ravel()[corners]
    sets = {}
    for name, item in mesh.uv_sets.items():
        uvs, ids = _refined(item.uvs, item.faces, polygons, keep_borders=True)
        sets[name] = UvSet(uvs, ids.ravel()[corners].astype(np.int32))
    if mesh.face_groups is not None:
        of_corner = np.repeat(mesh.face_groups[polygons.firsts], polygons.sizes)
        changes["face_groups"] = of_corner[parents]
    return mesh.replace(**changes, uv_sets=sets, polygon_of=parents)


def _refined(
    values: FloatArray, ids: IntArray, polygons: Outlines, *, keep_borders: bool = False
) -> tuple[FloatArray, Int64Array]:
    """Smoothed values (m, K) of vertices, edges and polygons, and quads (C, 4) of corners."""
    sizes, n = polygons.sizes, len(values)
    corners = ids.ravel()[polygons.slots].astype(np.int64)
    polygon_of = np.repeat(np.arange(len(sizes)), sizes)
    following = next_corners(sizes)
    keys = np.sort(np.stack([corners, corners[following]], axis=1), axis=1).astype(np.int32)
    at, numbers = unique_rows(keys)
    edge_of = numbers.astype(np.int64)
    heads = keys[at]
    is_sharp = np.bincount(edge_of) != 2

    centers = row_sums(polygon_of, values[corners], len(sizes)) / sizes[:, None]
    middles = values[heads].sum(axis=1) / 2
    around = row_sums(edge_of, centers[polygon_of], len(at))
    edges = np.where(is_sharp[:, None], middles, middles / 2 + around / 4)

    counts = np.bincount(corners, minlength=n)
    inner = row_sums(corners, centers[polygon_of], n)
    sharp_heads, others = heads[is_sharp].ravel(), heads[is_sharp][:, ::-1].ravel()
    n_sharp = np.bincount(sharp_heads, minlength=n)
    # Every edge of a vertex without sharp ones leaves it once, along one of its polygons.
    inner += row_sums(corners, 2 * middles[edge_of], n)
    number = np.maximum(counts, 1)[:, None]
    smooth = (inner / number + (number - 3) * values) / number
    curve = 0.75 * values + row_sums(sharp_heads, values[others], n) / 8
    is_curve = (n_sharp == 2) & (counts > 1) & (not keep_borders)
    points = np.where(((n_sharp == 0) & (counts > 0))[:, None], smooth, values)
    points = np.where(is_curve[:, None], curve, points)

    before = np.empty_like(following)
    before[following] = np.arange(len(corners))
    quads = np.stack([corners, n + edge_of, n + len(at) + polygon_of, n + edge_of[before]], axis=1)
    return np.concatenate([points, edges, centers]), quads
