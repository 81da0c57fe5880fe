"""Bake one normal map with Blender, for the benchmark to run in a Python that has `bpy` 5.0.1.

Prints one JSON object: seconds of the import, the bake and the save, and the peak memory in bytes.
"""

import itertools
import json
import resource
import sys
import time

import bpy


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


def main(high_path, low_path, out, size, distance, margin):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    times = [time.perf_counter()]
    high, low = imported(high_path), imported(low_path)
    times.append(time.perf_counter())
    image = bake_target(low, int(size))
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    settings = scene.render.bake
    settings.use_selected_to_active = True
    settings.cage_extrusion = float(distance)
    settings.max_ray_distance = 2 * float(distance)
    settings.margin = int(margin)
    bpy.ops.object.select_all(action="DESELECT")
    high.select_set(True)
    low.select_set(True)
    bpy.context.view_layer.objects.active = low
    bpy.ops.object.bake(type="NORMAL")
    times.append(time.perf_counter())
    files = scene.render.image_settings
    files.file_format, files.color_mode, files.color_depth = "PNG", "RGB", "16"
    scene.view_settings.view_transform = "Raw"
    image.save_render(out, scene=scene)
    times.append(time.perf_counter())
    seconds = [later - earlier for earlier, later in itertools.pairwise(times)]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(json.dumps({"import": seconds[0], "bake": seconds[1], "save": seconds[2], "peak": peak}))


if __name__ == "__main__":
    main(*sys.argv[1:])
