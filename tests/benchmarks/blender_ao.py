"""Bake one ambient occlusion map with Blender, for the benchmark to run in a Python that has `bpy`.

Writes the map as a .npy of (size, size) floats, row 0 at the top, and prints the seconds of the
bake: by the clock, and of all its processors.
"""

import os
import sys
import time

import bpy
import numpy as np


def imported(path):
    operator = bpy.ops.wm.ply_import if path.endswith(".ply") else bpy.ops.wm.obj_import
    operator(filepath=path, forward_axis="Y", up_axis="Z")
    thing = bpy.context.selected_objects[0]
    thing.data.shade_smooth()
    return thing


def bake_target(low, size):
    """Give the low-poly mesh a material whose active image takes the bake."""
    image = bpy.data.images.new("map", size, size, float_buffer=True, is_data=True)
    material = bpy.data.materials.new("baked")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.nodes.active = texture
    low.data.materials.clear()
    low.data.materials.append(material)
    return image


def main(high_path, low_path, out, size, samples, distance):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    high, low = imported(high_path), imported(low_path)
    image = bake_target(low, int(size))
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", int(samples)
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.world = bpy.data.worlds.new("world")
    scene.world.light_settings.distance = 1000.0  # farther than the mesh is wide
    settings = scene.render.bake
    settings.use_selected_to_active = True
    settings.cage_extrusion = float(distance)
    settings.max_ray_distance = 2 * float(distance)
    settings.margin = 0
    bpy.ops.object.select_all(action="DESELECT")
    high.select_set(True)
    low.select_set(True)
    bpy.context.view_layer.objects.active = low
    start, spent = time.perf_counter(), sum(os.times()[:2])
    bpy.ops.object.bake(type="AO")
    seconds, spent = time.perf_counter() - start, sum(os.times()[:2]) - spent
    pixels = np.empty(4 * int(size) ** 2, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    np.save(out, pixels.reshape(int(size), int(size), 4)[::-1, :, 0])
    print(seconds, spent)


main(*sys.argv[1:])
