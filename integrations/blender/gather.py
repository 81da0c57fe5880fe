# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of the scene as arrays, with modifiers applied, as Blender shades them."""

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from .process import WorkError

AnyArray = npt.NDArray[Any]


def read(items: Any, name: str, dtype: Any, width: int = 1) -> AnyArray:
    """Return one property of all items of a collection: (n,) or (n, width)."""
    values = np.empty(len(items) * width, dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def mesh_arrays(data: bpy.types.Mesh, name: str, *, colors: bool = False) -> dict[str, AnyArray]:
    """Return the arrays of a Blender mesh; `name`: of its object. Raise if it has no faces.

    Triangles are Blender's own, so that texbake bakes, and computes tangents, on the surface that
    Blender draws. Corners are Blender's loops.
    """
    if len(data.polygons) == 0:
        raise WorkError(f"{name}: it has no faces")
    data.calc_loop_triangles()
    # Attributes are copied at once, and properties of elements one by one.
    arrays = {
        "name": np.array(name),
        "count": np.array(len(data.polygons)),
        "positions": read(data.attributes["position"].data, "vector", np.float32, 3),
        "vertices": read(data.attributes[".corner_vert"].data, "value", np.int32),
        "triangles": read(data.loop_triangles, "loops", np.int32, 3),
        "polygon_of": read(data.loop_triangle_polygons, "value", np.int32),
        "normals": read(data.corner_normals, "vector", np.float32, 3),
    }
    if "material_index" in data.attributes:
        arrays["materials"] = read(data.polygons, "material_index", np.int32)
    if data.uv_layers:
        # The active one is the first.
        layers = sorted(data.uv_layers, key=lambda layer: layer != data.uv_layers.active)
        for number, layer in enumerate(layers):
            arrays[f"uv{number}"] = read(layer.uv, "vector", np.float32, 2)
        arrays["uv_names"] = np.array([layer.name for layer in layers])
    layer = data.color_attributes.active_color if colors else None
    if layer is not None:
        kind = "colors" if layer.domain == "POINT" else "corner_colors"
        arrays[kind] = read(layer.data, "color", np.float32, 4)
    return arrays


def marked_edges(data: bpy.types.Mesh) -> dict[str, AnyArray]:
    """Return the edges that are marked as seams, and those that are sharp, as pairs of vertices."""
    edges = read(data.edges, "vertices", np.int32, 2)
    marks = {"seams": "use_seam", "sharp": "use_edge_sharp"}
    return {kind: edges[read(data.edges, mark, np.bool_)] for kind, mark in marks.items()}


def object_arrays(
    item: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    *,
    layers: bool = True,
    colors: bool = False,
) -> dict[str, AnyArray]:
    """Return the arrays of an object, with its modifiers applied, in its own space.

    `layers`: with UV maps and colors, for which Blender applies the modifiers again.
    """
    evaluated = item.evaluated_get(depsgraph)
    data = evaluated.to_mesh(preserve_all_data_layers=layers, depsgraph=depsgraph)
    try:
        arrays = mesh_arrays(data, item.name, colors=colors)
    finally:
        evaluated.to_mesh_clear()
    arrays["matrix"] = np.array(item.matrix_world, np.float64)
    arrays["is_even"] = np.array(_is_even(arrays["matrix"]))
    return arrays


def _is_even(matrix: AnyArray) -> bool:
    """Whether a matrix scales all directions alike."""
    products = matrix[:3, :3].T @ matrix[:3, :3]
    size = np.trace(products) / 3.0
    return bool(np.abs(products - size * np.eye(3)).max() <= 1e-5 * size)


def mean_scale(matrix: AnyArray) -> float:
    """Return the factor by which a matrix scales lengths, on average."""
    return float(abs(np.linalg.det(matrix[:3, :3])) ** (1.0 / 3.0))
