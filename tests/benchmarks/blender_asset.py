"""A .glb, .obj, .ply or USD file as Blender has it, in a Python that has `bpy` 5.0.1.

    python blender_asset.py JOB.json ...

A job names a `file` and what is wanted of it: `picture`, an .exr file, for which `width`, `height`,
`fov` (vertical, radians), `world_from_camera`, `to_light` and `light`, or `lights`, are as for
`peer_threejs`, and `engine`, CYCLES where it is not given; `export`, a .glb, .usda or .usdz
file to export what was imported to; `mesh`, an .npz file of its triangles: positions (F, 3, 3)
and uvs (F, 3, 2), Y up; and `polygons`, an .npz file of its polygons: names (P,) of objects and
sizes (P,), positions (C, 3), normals (C, 3) and uvs (C, 2) of their corners, Y up, and n_vertices.
With a `normal_map`, the picture is that of the normals, as colors (n + 1) / 2, Z up.
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
    elif path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path)
    elif path.endswith(".ply"):
        bpy.ops.wm.ply_import(filepath=path, forward_axis="NEGATIVE_Z", up_axis="Y")
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


def polygons():
    """Corners of all polygons in world space, Y up, with the names of their objects."""
    found = {key: [] for key in ("names", "sizes", "positions", "normals", "uvs")}
    n_vertices = 0
    for thing in bpy.context.scene.objects:
        if thing.type != "MESH":
            continue
        mesh = thing.data
        n_vertices += len(mesh.vertices)
        matrix = np.array(Z_FROM_Y.inverted() @ thing.matrix_world)
        upright = np.linalg.inv(matrix[:3, :3]).T
        for polygon in mesh.polygons:
            found["names"].append(thing.name)
            found["sizes"].append(polygon.loop_total)
            for loop in polygon.loop_indices:
                place = np.array(mesh.vertices[mesh.loops[loop].vertex_index].co[:])
                normal = upright @ np.array(mesh.corner_normals[loop].vector[:])
                found["positions"].append(matrix[:3, :3] @ place + matrix[:3, 3])
                found["normals"].append(normal / np.linalg.norm(normal))
                if mesh.uv_layers:
                    found["uvs"].append(mesh.uv_layers[0].data[loop].uv[:])
    return {"n_vertices": n_vertices, **{key: np.array(rows) for key, rows in found.items()}}


def show_normals(path):
    """Make everything emit (n + 1) / 2 of its normals as color, Z up, with a normal map."""
    material = bpy.data.materials.new("map")
    material.use_nodes = True
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    light, code = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeVectorMath")
    code.operation = "MULTIPLY_ADD"
    code.inputs[1].default_value = code.inputs[2].default_value = (0.5, 0.5, 0.5)
    image, normal = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeNormalMap")
    image.image = bpy.data.images.load(path)
    image.image.colorspace_settings.name = "Non-Color"
    link(image.outputs["Color"], normal.inputs["Color"])
    link(normal.outputs["Normal"], code.inputs[0])
    link(code.outputs["Vector"], light.inputs["Color"])
    link(light.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
    for thing in bpy.context.scene.objects:
        if thing.type == "MESH":
            thing.data.materials.clear()
            thing.data.materials.append(material)


def add_light(scene, light):
    """Add a light; its color is what a white surface that faces it reflects, at distance 1."""
    kinds = {"directional": "SUN", "point": "POINT", "spot": "SPOT"}
    lamp = bpy.data.lights.new(light["kind"], kinds[light["kind"]])
    if light["kind"] == "directional":
        lamp.angle = 0.0
        lamp.energy = np.pi  # white reflects 1 / pi of it
    else:
        lamp.shadow_soft_size = 0.0
        lamp.energy = 4.0 * np.pi**2
    if light["kind"] == "spot":
        lamp.spot_size, lamp.spot_blend = light["angle"], light["blend"]
    lamp.color = light["color"]
    lamp.use_shadow = light.get("shadow", True)
    thing = bpy.data.objects.new(light["kind"], lamp)
    if "to_light" in light:
        toward = Z_FROM_Y.to_3x3() @ Vector(light["to_light"])
        thing.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()
    if "position" in light:
        thing.location = Z_FROM_Y @ Vector(light["position"])
    scene.collection.objects.link(thing)


def draw(job):
    scene = bpy.context.scene
    scene.render.engine = job.get("engine", "CYCLES")
    scene.eevee.taa_render_samples = 16
    scene.render.filter_size = 1.0
    scene.cycles.device = "CPU"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    # Light passes through glass, but does not bounce between surfaces.
    scene.cycles.max_bounces = scene.cycles.transmission_bounces = 12
    scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 0
    scene.eevee.use_raytracing = True
    for material in bpy.data.materials:
        material.use_raytrace_refraction = True
    # A box of one pixel, as the others have it.
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.image_settings.color_depth = "32"
    scene.world = None  # a new one shines in gray since Blender 5.0, whatever its color
    for thing in [thing for thing in scene.objects if thing.type == "LIGHT"]:
        bpy.data.objects.remove(thing)
    sun = {"kind": "directional", "to_light": job.get("to_light"), "color": job.get("light")}
    for light in job.get("lights", [sun]):
        add_light(scene, light)
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


def do(job):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    read(job["file"])
    if "mesh" in job:
        positions, uvs = triangles()
        np.savez(job["mesh"], positions=positions, uvs=uvs)
    if "polygons" in job:
        np.savez(job["polygons"], **polygons())
    if "normal_map" in job:
        show_normals(job["normal_map"])
    if "export" in job:
        export(job["export"])
    if "picture" in job:
        draw(job)


for path in sys.argv[1:]:
    do(json.loads(Path(path).read_text()))
