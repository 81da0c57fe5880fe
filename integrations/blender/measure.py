# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the extension with Blender's own bake: seconds, and pictures for docs/how-to/blender.md.

    make extension
    blender/bin/python integrations/blender/measure.py dist/blender/*-linux-x64.zip

Run it with the Python that has `bpy`. It prints the table of the page and writes the pictures. The
settings of the user's own Blender are not touched.
"""

import argparse
import math
import os
import sys
import tempfile
import time
from pathlib import Path

SIZES = (1024, 2048, 4096)
FACES = 1000
REACH = 0.06  # of rays, in front of the low-poly mesh and behind it
PICTURE = 360  # pixels per side
SHOWN_SIZE = 1440  # texels per side of the maps that are shown
PICTURES = Path(__file__).parents[2] / "docs" / "images" / "blender"
SHOWN = ("normal", "displacement", "ao", "curvature")


def start(extension):
    """Start a Blender with new settings, and install the extension."""
    os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp()
    import bpy

    bpy.ops.extensions.package_install_files(
        filepath=str(extension), repo="user_default", enable_on_install=True
    )
    bpy.ops.wm.read_homefile(use_empty=True)
    return bpy


def make_rock(bpy, subdivisions):
    """Add a rock by modifiers: a sphere, displaced by two textures."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6)
    rock = bpy.context.object
    rock.name = "rock"
    bpy.ops.object.shade_smooth()
    rock.modifiers.new("Subdivision", "SUBSURF").levels = subdivisions
    for kind, size, strength in (("CLOUDS", 0.9, 0.5), ("STUCCI", 0.16, 0.06)):
        texture = bpy.data.textures.new(kind, kind)
        texture.noise_scale = size
        modifier = rock.modifiers.new(kind, "DISPLACE")
        modifier.texture, modifier.strength = texture, strength
    material = bpy.data.materials.new("stone")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.42, 0.31, 0.22, 1.0)
    shader.inputs["Roughness"].default_value = 0.7
    rock.data.materials.append(material)
    return rock


def choose(bpy, *items):
    """Select objects; the last is the active one."""
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[-1]


def timed(function):
    """Return the seconds by the clock, and of all processors, that a function takes."""
    begun, before = time.perf_counter(), sum(os.times()[:4])
    function()
    return time.perf_counter() - begun, sum(os.times()[:4]) - before


def own_bake(bpy, low, size, margin=0):
    """Bake with Blender's operator; return the image, and the seconds of the bake alone."""
    image = bpy.data.images.new(f"own {size}", size, size, float_buffer=True, is_data=True)
    nodes = low.active_material.node_tree.nodes
    texture = nodes.get("own") or nodes.new("ShaderNodeTexImage")
    texture.name, texture.image = "own", image
    nodes.active = texture
    settings = bpy.context.scene.render.bake
    settings.use_selected_to_active, settings.margin = True, margin
    settings.cage_extrusion, settings.max_ray_distance = REACH, 2.0 * REACH
    return image, timed(lambda: bpy.ops.object.bake(type="NORMAL"))


def pixels(image):
    """Return the colors of an image, (H, W, 4), from the lowest row on."""
    import numpy as np

    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def normals(image):
    """Return the normals of a map, (n, 3)."""
    return 2.0 * pixels(image).reshape(-1, 4)[:, :3] - 1.0


def angle_between(ours, own):
    """Return the mean angle between two maps where both have data, in degrees."""
    import numpy as np

    lengths = np.linalg.norm(ours, axis=1) * np.linalg.norm(own, axis=1)
    flat = np.abs(ours - [0.0, 0.0, 1.0]).max(axis=1) < 1e-4
    cosines = (ours * own).sum(axis=1) / np.maximum(lengths, 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))[~flat & (lengths > 0.5)].mean())


def prepare_pictures(bpy, item):
    """Set up a camera that sees an object, a lamp, and Cycles on the processor."""
    from mathutils import Euler, Vector

    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 64
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = PICTURE
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.3, 0.32, 0.35)
    lamp = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    lamp.data.energy, lamp.data.angle = 3.5, 0.5
    lamp.rotation_euler = (math.radians(50), 0.0, math.radians(-35))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.12 * max(item.dimensions)
    camera.rotation_euler = Euler((math.radians(75), 0.0, 0.0))
    center = sum((Vector(corner) for corner in item.bound_box), Vector()) / 8.0
    camera.location = center - 10.0 * (camera.rotation_euler.to_matrix() @ Vector((0, 0, -1)))
    for each in camera, lamp:
        scene.collection.objects.link(each)
    scene.camera = camera


def rendered(bpy, item):
    """Return a picture of one object, (PICTURE, PICTURE, 4)."""
    for other in bpy.data.objects:
        other.hide_render = other.type == "MESH" and other is not item
    path = Path(tempfile.mkdtemp(), "picture.png")
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return pixels(bpy.data.images.load(str(path)))


def shown(image):
    """Return a map as a small picture."""
    step = image.size[0] // PICTURE
    values = pixels(image)[: step * PICTURE, : step * PICTURE]
    return values.reshape(PICTURE, step, PICTURE, step, 4).mean(axis=(1, 3))


def save_strip(bpy, pictures, path):
    """Write pictures side by side."""
    import numpy as np

    strip = np.concatenate(pictures, axis=1)
    strip[..., 3] = 1.0
    image = bpy.data.images.new("strip", strip.shape[1], strip.shape[0])
    image.pixels.foreach_set(np.ascontiguousarray(strip, np.float32).ravel())
    image.filepath_raw, image.file_format = str(path), "JPEG"
    image.save(quality=82)
    print(path)


def measured(bpy, low, sizes):
    """Return rows of the table: both bakes at each size."""
    rows = []
    for size in sizes:
        options = {"front": REACH, "back": REACH, "size": size, "padding": 0}
        ours = timed(lambda options=options: bpy.ops.texbake.bake(maps={"normal"}, **options))
        image, own = own_bake(bpy, low, size)
        degrees = angle_between(normals(bpy.data.images[f"{low.name}_normal"]), normals(image))
        cells = [f"{size}²", *(f"{s:.1f} s" for s in (*ours, *own))]
        rows.append([*cells, f"{own[1] / ours[1]:.1f}", f"{degrees:.3f}°"])
    return rows


def main(arguments):
    """Measure, and write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("extension", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=PICTURES, metavar="FOLDER")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    parser.add_argument("--subdivisions", type=int, default=3, help="3: 2 million triangles")
    chosen = parser.parse_args(arguments)
    bpy = start(chosen.extension.resolve())
    rock = make_rock(bpy, chosen.subdivisions)
    choose(bpy, rock)
    bpy.ops.texbake.simplify(faces=FACES)
    low = bpy.context.object
    choose(bpy, low)
    bpy.ops.texbake.unwrap(size=SHOWN_SIZE)
    prepare_pictures(bpy, low)
    pictures = [rendered(bpy, rock), rendered(bpy, low)]
    choose(bpy, rock, low)
    for item in rock, low:
        item.hide_render = False
    rows = measured(bpy, low, chosen.sizes)
    bpy.ops.texbake.bake(maps=set(SHOWN), size=SHOWN_SIZE, front=REACH, back=REACH)
    image, _ = own_bake(bpy, low, SHOWN_SIZE, margin=4)
    pictures.append(rendered(bpy, low))
    low.active_material.node_tree.nodes["texbake normal: ShaderNodeTexImage"].image = image
    pictures.append(rendered(bpy, low))
    chosen.output.mkdir(parents=True, exist_ok=True)
    maps = [shown(bpy.data.images[f"{low.name}_{name}"]) for name in SHOWN]
    save_strip(bpy, pictures, chosen.output / "rock.jpg")
    save_strip(bpy, maps, chosen.output / "maps.jpg")
    print(f"Blender {bpy.app.version_string}, {os.cpu_count()} processors")
    for row in rows:
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main(sys.argv[1:])
