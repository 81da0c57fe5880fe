"""A .glb or USD file as Blender has it, in a Python that has `bpy` 5.0.1.

    python blender_asset.py JOB.json

A job names a `file` and what is wanted of it: `picture`, an .exr file, for which `width`, `height`,
`fov` (vertical, radians), `world_from_camera`, `to_light` and `light` are as for
`peer_gltf_threejs`; `export`, a .glb, .usda or .usdz file to export what was imported to; and
`mesh`, an .npz file of its triangles: positions (F, 3, 3) and uvs (F, 3, 2), Y up.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

# Z up, as Blender has it, of Y up.
Z_FROM_Y = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))


def read(path):
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
    else:
        bpy.ops.wm.usd_import(filepath=path)


def export(path):
    if path.endswith(".glb"):
        bpy.ops.export_scene.gltf(filepath=path, export_tangents=True)
    else:
        bpy.ops.wm.usd_export(filepath=path)


def triangles():
    """Corners of all triangles in the world, Y up."""
    positions, uvs = [], []
    for thing in bpy.context.scene.objects:
        if thing.type != "MESH":
            continue
        mesh = thing.data
        mesh.calc_loop_triangles()
        matrix = np.array(Z_FROM_Y.inverted() @ thing.matrix_world)
        for triangle in mesh.loop_triangles:
            corners = np.array([mesh.vertices[i].co[:] for i in triangle.vertices])
            positions.append(corners @ matrix[:3, :3].T + matrix[:3, 3])
            if mesh.uv_layers:
                uvs.append([mesh.uv_layers[0].data[i].uv[:] for i in triangle.loops])
    return np.array(positions), np.array(uvs)


def draw(job):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    # A box of one pixel, as the others have it.
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.image_settings.color_depth = "32"
    scene.world = bpy.data.worlds.new("dark")
    scene.world.color = (0, 0, 0)
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle = 0.0
    sun.energy = np.pi  # white reflects 1 / pi of it
    sun.color = job["light"]
    lamp = bpy.data.objects.new("sun", sun)
    toward = Z_FROM_Y.to_3x3() @ Vector(job["to_light"])
    lamp.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit = "VERTICAL"
    lens.angle = job["fov"]
    camera = bpy.data.objects.new("camera", lens)
    rows = np.reshape(job["world_from_camera"], (4, 4)).tolist()
    camera.matrix_world = Z_FROM_Y @ Matrix(rows)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.filepath = job["picture"]
    bpy.ops.render.render(write_still=True)


job = json.loads(Path(sys.argv[1]).read_text())
bpy.ops.wm.read_factory_settings(use_empty=True)
read(job["file"])
if "mesh" in job:
    positions, uvs = triangles()
    np.savez(job["mesh"], positions=positions, uvs=uvs)
if "export" in job:
    export(job["export"])
if "picture" in job:
    draw(job)
