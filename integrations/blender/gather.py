# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of the scene as arrays, with modifiers applied, as Blender shades them."""

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix

AnyArray = npt.NDArray[Any]


def read(items: Any, name: str, dtype: Any, width: int = 1) -> AnyArray:
    """Return one property of all items of a collection: (n,) or (n, width)."""
    values = np.empty(len(items) * width, dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def mesh_arrays(data: bpy.types.Mesh, *, colors: bool = False) -> dict[str, AnyArray]:
    """Return the arrays of a Blender mesh.

    Triangles are Blender's own, so that texbake bakes, and computes tangents, on the surface that
    Blender draws. Corners are Blender's loops.
    """
    data.calc_loop_triangles()
    triangles = data.loop_triangles
    arrays = {
        "positions": read(data.vertices, "co", np.float32, 3),
        "vertices": read(data.loops, "vertex_index", np.int32),
        "triangles": read(triangles, "loops", np.int32, 3),
        "polygon_of": read(triangles, "polygon_index", np.int32),
        "normals": read(data.corner_normals, "vector", np.float32, 3),
        "materials": read(data.polygons, "material_index", np.int32),
        "sizes": read(data.polygons, "loop_total", np.int32),
    }
    edges = read(data.edges, "vertices", np.int32, 2)
    arrays["seams"] = edges[read(data.edges, "use_seam", np.bool_)]
    arrays["sharp"] = edges[read(data.edges, "use_edge_sharp", np.bool_)]
    if data.uv_layers:
        names = [layer.name for layer in data.uv_layers]
        active = max(data.uv_layers.active_index, 0)
        for number, name in enumerate([names[active], *names[:active], *names[active + 1 :]]):
            arrays[f"uv{number}"] = read(data.uv_layers[name].uv, "vector", np.float32, 2)
        arrays["uv_names"] = np.array([names[active], *names[:active], *names[active + 1 :]])
    layer = data.color_attributes.active_color if colors else None
    if layer is not None:
        name = "colors" if layer.domain == "POINT" else "corner_colors"
        arrays[name] = read(layer.data, "color", np.float32, 4)
    return arrays


def object_arrays(
    item: bpy.types.Object, depsgraph: bpy.types.Depsgraph, *, colors: bool = False
) -> dict[str, AnyArray]:
    """Return the arrays of an object, with its modifiers applied, in its own space."""
    evaluated = item.evaluated_get(depsgraph)
    data = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    try:
        arrays = mesh_arrays(data, colors=colors)
    finally:
        evaluated.to_mesh_clear()
    arrays["matrix"] = np.array(item.matrix_world, np.float64)
    arrays["name"] = np.array(item.name)
    return arrays


def is_even(matrix: Matrix) -> bool:
    """Whether a matrix scales all directions alike."""
    linear = np.array(matrix, np.float64)[:3, :3]
    products = linear.T @ linear
    size = np.trace(products) / 3.0
    return bool(np.abs(products - size * np.eye(3)).max() <= 1e-5 * size)


def mean_scale(matrix: Matrix) -> float:
    """Return the factor by which a matrix scales lengths, on average."""
    return float(abs(np.linalg.det(np.array(matrix, np.float64)[:3, :3])) ** (1.0 / 3.0))
