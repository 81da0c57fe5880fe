"""Unwrap one mesh with Blender, in a Python that has `bpy` 5.0.1.

    python blender_unwrap.py MESH.npz OUT.npz smart|minimum-stretch SIZE GAP

The input has `positions` and `faces`, the output `corners` (F, 3, 2). "smart" is Smart UV Project
with its default options; "minimum-stretch" uses its islands as seams, unwraps them by minimum
stretch and packs them. Prints one JSON object: seconds without reading and writing.
"""

import json
import sys
import time

import bpy
import numpy as np


def made_mesh(positions, faces):
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.astype(np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    thing = bpy.data.objects.new("mesh", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    return thing


def unwrap(method, margin):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(island_margin=margin, margin_method="FRACTION")
    if method == "minimum-stretch":
        bpy.ops.uv.select_all(action="SELECT")
        bpy.ops.uv.seams_from_islands(mark_seams=True)
        bpy.ops.uv.unwrap(method="MINIMUM_STRETCH")
        bpy.ops.uv.pack_islands(margin=margin, margin_method="FRACTION", shape_method="CONCAVE")
    bpy.ops.object.mode_set(mode="OBJECT")


def main(path, out, method, size, gap):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    arrays = np.load(path)
    thing = made_mesh(arrays["positions"], arrays["faces"])
    start = time.perf_counter()
    unwrap(method, float(gap) / float(size))
    seconds = time.perf_counter() - start
    layer = thing.data.uv_layers.active.uv
    corners = np.empty(2 * len(layer), np.float32)
    layer.foreach_get("vector", corners)
    np.savez(out, corners=corners.reshape(-1, 3, 2).astype(np.float64))
    print(json.dumps({"seconds": seconds}))


if __name__ == "__main__":
    main(*sys.argv[1:])
