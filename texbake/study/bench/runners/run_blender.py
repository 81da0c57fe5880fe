"""Do one job with Blender, in a Python that has `bpy`: `run_blender.py JOB`."""

import json
import math
import sys

import bpy
import numpy as np


def imported(path):
    """Import a mesh file as it is, smooth-shaded."""
    operator = bpy.ops.wm.ply_import if path.endswith(".ply") else bpy.ops.wm.obj_import
    operator(filepath=path, forward_axis="Y", up_axis="Z")
    thing = bpy.context.selected_objects[0]
    thing.data.shade_smooth()
    return thing


def use_cycles(samples):
    """Draw and bake with Cycles on the processor; return the scene."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    return scene


def prepare_bake(job):
    """Select a high-poly mesh and a low-poly one with an image; return the scene and the image."""
    high, low = imported(job["high"]), imported(job["low"])
    size = job["size"]
    image = bpy.data.images.new("map", size, size, float_buffer=True, is_data=True)
    material = bpy.data.materials.new("baked")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.nodes.active = texture
    low.data.materials.clear()
    low.data.materials.append(material)
    scene = use_cycles(job["samples"])
    settings = scene.render.bake
    settings.use_selected_to_active = True
    settings.cage_extrusion = job["distance"]
    settings.max_ray_distance = 2.0 * job["distance"]
    settings.margin = job["padding"]
    bpy.ops.object.select_all(action="DESELECT")
    high.select_set(True)
    low.select_set(True)
    bpy.context.view_layer.objects.active = low
    return scene, image


def light_everywhere(scene):
    """Let light come from every side, from farther than any mesh is wide."""
    scene.world = bpy.data.worlds.new("world")
    scene.world.light_settings.distance = 1000.0


def save(scene, image, path):
    """Write an image with its values unchanged."""
    files = scene.render.image_settings
    files.color_mode = "RGB"
    if path.endswith(".exr"):
        files.file_format, files.color_depth = "OPEN_EXR", "32"
    else:
        files.file_format, files.color_depth = "PNG", "16"
    scene.view_settings.view_transform = "Raw"
    image.save_render(path, scene=scene)


def bake_normals(job):
    """Bake a normal map in tangent space."""
    scene, image = prepare_bake(job)
    bpy.ops.object.bake(type="NORMAL")
    save(scene, image, job["out"])


def bake_displacement(job):
    """Blender bakes no heights between two meshes; it bakes the positions of the hits."""
    scene, image = prepare_bake(job)
    bpy.ops.object.bake(type="POSITION")
    save(scene, image, job["out"])


def bake_ao(job):
    """Bake ambient occlusion."""
    scene, image = prepare_bake({**job, "samples": job["rays"]})
    light_everywhere(scene)
    bpy.ops.object.bake(type="AO")
    save(scene, image, job["out"])


def unwrap(job):
    """Write texture coordinates by corner."""
    thing = imported(job["mesh"])
    margin = job["gap"] / job["size"]
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(island_margin=margin, margin_method="FRACTION")
    if job["method"] == "minimum-stretch":
        bpy.ops.uv.select_all(action="SELECT")
        bpy.ops.uv.seams_from_islands(mark_seams=True)
        bpy.ops.uv.unwrap(method="MINIMUM_STRETCH")
        bpy.ops.uv.pack_islands(margin=margin, margin_method="FRACTION", shape_method="CONCAVE")
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = thing.data
    corners = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers.active.uv.foreach_get("vector", corners)
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    faces = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", faces)
    np.savez(
        job["out"],
        positions=positions.reshape(-1, 3),
        faces=faces.reshape(-1, 3),
        corners=corners.reshape(-1, 3, 2),
    )


def simplify(job):
    """Write a mesh of about this many triangles."""
    thing = imported(job["mesh"])
    modifier = thing.modifiers.new("decimate", "DECIMATE")
    modifier.ratio = job["faces"] / len(thing.data.polygons)
    export(job)


def remesh(job):
    """Write a mesh of the surface of voxels."""
    thing = imported(job["mesh"])
    modifier = thing.modifiers.new("remesh", "REMESH")
    modifier.mode, modifier.voxel_size = "VOXEL", max(thing.dimensions) / job["voxels"]
    export(job)


def export(job):
    """Write the selected mesh, with its modifiers."""
    bpy.ops.wm.ply_export(
        filepath=job["out"], apply_modifiers=True, export_selected_objects=True,
        export_normals=False, export_uv=False, export_triangulated_mesh=True,
        forward_axis="Y", up_axis="Z",
    )  # fmt: skip


def preview(job):
    """One lamp infinitely far away, a white diffuse surface, no shadows and no bounces."""
    from mathutils import Matrix, Vector

    thing = imported(job["mesh"])
    material = bpy.data.materials.new("white")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    surface, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    links.new(surface.outputs[0], output.inputs["Surface"])
    thing.data.materials.clear()
    thing.data.materials.append(material)

    lamp = bpy.data.lights.new("lamp", "SUN")
    lamp.energy, lamp.angle, lamp.use_shadow = math.pi, 0.0, False
    light = bpy.data.objects.new("lamp", lamp)
    light.rotation_euler = Vector(job["light"]).to_track_quat("-Z", "Y").to_euler()
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.sensor_fit, camera.data.angle_y = "VERTICAL", math.radians(job["fov"])
    camera.data.clip_start, camera.data.clip_end = 0.01, 1000.0
    right, up, back = (Vector(axis) for axis in job["axes"])
    camera.matrix_world = Matrix.Translation(job["eye"]) @ Matrix((right, up, back)).transposed(
    ).to_4x4()  # fmt: skip
    for item in light, camera:
        bpy.context.collection.objects.link(item)

    scene = use_cycles(job["samples"])
    scene.camera = camera
    scene.cycles.max_bounces, scene.cycles.pixel_filter_type = 0, "BOX"
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes.clear()  # black
    scene.render.resolution_x = scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    files = scene.render.image_settings
    files.file_format, files.color_mode, files.color_depth = "OPEN_EXR", "RGB", "32"
    scene.view_settings.view_transform = "Raw"
    scene.render.filepath = job["out"]
    bpy.ops.render.render(write_still=True)


def version(job):
    """Print the version."""
    print("VERSION", bpy.app.version_string)


if __name__ == "__main__":
    bpy.ops.wm.read_factory_settings(use_empty=True)
    job = json.loads(sys.argv[1])
    globals()[job["task"].replace("-", "_")](job)
