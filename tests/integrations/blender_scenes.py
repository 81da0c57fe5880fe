"""Runs in Blender's Python: installs the extension, then does what each line of stdin says.

    blender/bin/python blender_scenes.py EXTENSION.zip

A line is a JSON list of the name of a function below and its arguments; the answer is one line.
BLENDER_USER_RESOURCES names a folder for the settings of this Blender.
"""

import json
import math
import os
import sys
import time
import traceback
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
from mathutils import Euler, Matrix

MODULE = "bl_ext.user_default.texbake"
R = Euler((0.3, 0.5, 0.7)).to_matrix().to_4x4()
MATRICES = {
    "plain": Matrix(),
    "turned": Matrix.Translation((3, -2, 1)) @ R,
    "large": R @ Matrix.Scale(2, 4),
    "small": Matrix.Scale(0.01, 4),
    "mirrored": Matrix.Diagonal((-1, 1, 1, 1)),
    "turned and mirrored": Matrix.Translation((3, -2, 1)) @ R @ Matrix.Diagonal((1, 1, -1, 1)),
    "uneven": R @ Matrix.Diagonal((2, 1, 1, 1)),
}


def part(name):
    """Return a module of the extension."""
    return __import__(f"{MODULE}.{name}", fromlist=["*"])


def clear():
    """Empty the scene."""
    bpy.ops.wm.read_homefile(use_empty=True)


def choose(*items):
    """Select objects; the last is the active one."""
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[-1]


def with_sets(options):
    """Return options of an operator, whose lists were sets before they became JSON."""
    return {key: set(value) if isinstance(value, list) else value for key, value in options.items()}


def tried(operator, **options):
    """Run an operator; return what it answers, or its report of an error."""
    try:
        (answer,) = getattr(bpy.ops.texbake, operator)(**with_sets(options))
    except RuntimeError as error:
        return str(error).removeprefix("Error: ").strip()
    return answer


def waved(subdivisions=4):
    """Add a waved sphere with colors: the high-poly mesh."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions)
    high = bpy.context.object
    high.name = "high"
    bpy.ops.object.shade_smooth()
    points = np.empty(3 * len(high.data.vertices), np.float32)
    high.data.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    points *= (
        1 + 0.03 * np.sin(9 * points[:, :1]) * np.sin(9 * points[:, 1:2]) + 0.02 * points[:, :1]
    )
    high.data.vertices.foreach_set("co", points.ravel())
    layer = high.data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
    layer.data.foreach_set("color", np.tile(np.float32([0.5, 0.25, 0.125, 1]), len(layer.data)))
    high.data.update()
    return high


def ball(n=16):
    """Add a sphere of quads with triangles at its poles: the low-poly mesh."""
    # Blender's own has its faces in another order each time.
    rows = [(np.sin(v), np.cos(v)) for v in np.linspace(0, np.pi, n // 2 + 1)[1:-1]]
    around = [(np.cos(u), np.sin(u)) for u in np.linspace(0, 2 * np.pi, n, endpoint=False)]
    points = [(r * x, r * y, -z) for r, z in rows for x, y in around]
    points += [(0, 0, -1), (0, 0, 1)]
    faces, uvs = [], []
    for row in range(-1, len(rows)):
        for k in range(n):
            s, t = [k / n, (k + 1) / n], [(row + 1) / (n / 2), (row + 2) / (n / 2)]
            below, above = (
                [n * r + k, n * r + (k + 1) % n] if 0 <= r < len(rows) else [len(points) - end]
                for r, end in ((row, 2), (row + 1, 1))
            )
            faces.append([*below, *above[::-1]])
            middle = [(s[0] + s[1]) / 2]
            low_s, high_s = (s if len(ends) == 2 else middle for ends in (below, above))
            uvs += [(x, t[0]) for x in low_s] + [(x, t[1]) for x in high_s[::-1]]
    data = bpy.data.meshes.new("low")
    data.from_pydata(points, [], faces)
    data.uv_layers.new(name="UVMap")
    data.attributes["UVMap"].data.foreach_set("vector", np.float32(uvs).ravel())
    return added("low", data)


def pair(high_matrix="plain", low_matrix="plain"):
    """Make a scene of a waved sphere and a sphere of quads and triangles, both selected."""
    clear()
    high, low = waved(), ball()
    low.data.shade_smooth()
    high.matrix_world, low.matrix_world = MATRICES[high_matrix], MATRICES[low_matrix]
    bpy.context.view_layer.update()
    choose(high, low)
    return high, low


def added(name, data=None):
    """Add an object to the scene, a lamp if it has no data."""
    item = bpy.data.objects.new(name, data or bpy.data.lights.new(name, "SUN"))
    bpy.context.collection.objects.link(item)
    return item


def monkey_and_torus():
    """Make a scene of two objects, both selected."""
    clear()
    bpy.ops.mesh.primitive_monkey_add()
    one = bpy.context.object
    bpy.ops.mesh.primitive_torus_add()
    choose(one, bpy.context.object)
    return one, bpy.context.object


def pixels(image):
    """Return the colors of an image, (H, W, 3)."""
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[..., :3]


def write_obj(path, item):
    """Write an object with its modifiers: Blender's exporters round, or compute other normals."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    data = evaluated.to_mesh()
    layer = data.uv_layers.active
    lines = [f"v {v.co.x!r} {v.co.y!r} {v.co.z!r} 0.5 0.25 0.125" for v in data.vertices]
    lines += [f"vt {uv.vector.x!r} {uv.vector.y!r}" for uv in layer.uv]
    lines += ["vn {!r} {!r} {!r}".format(*normal.vector) for normal in data.corner_normals]
    for polygon in data.polygons:
        corners = zip(polygon.vertices, polygon.loop_indices, strict=True)
        lines.append("f " + " ".join(f"{v + 1}/{i + 1}/{i + 1}" for v, i in corners))
    path.write_text("\n".join([*lines, ""]))
    evaluated.to_mesh_clear()


def bake_pair(folder, matrix, options, modifier=False):
    """Bake a pair; write the maps, and the meshes as Blender's own exporter does."""
    high, low = pair(matrix, matrix)
    if modifier:
        high.modifiers.new("Subdivision", "SUBSURF").levels = 1
    for item in high, low:  # readers of files choose other diagonals
        item.modifiers.new("Triangulate", "TRIANGULATE")
    answer = tried("bake", **options)
    for image in bpy.data.images:
        Path(folder, f"{image.name}.png").write_bytes(image.packed_file.data)
    for item in high, low:
        write_obj(Path(folder, f"{item.name}.obj"), item)
    return answer


def own_bake(low, size, distance):
    """Return the normals that Blender's own operator bakes."""
    image = bpy.data.images.new("own", size, size, float_buffer=True, is_data=True)
    nodes = low.active_material.node_tree.nodes
    nodes.active = texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    settings = scene.render.bake
    settings.use_selected_to_active, settings.margin = True, 0
    settings.cage_extrusion, settings.max_ray_distance = distance, 0.0
    bpy.ops.object.bake(type="NORMAL")
    return 2.0 * pixels(image) - 1.0


def angle_to_own_bake(high_matrix, low_matrix):
    """Return the mean and the 99th percentile of the angles between both bakes, in degrees."""
    _, low = pair(high_matrix, low_matrix)
    # Blender's distances are in the space of the object, the extension's in that of the scene.
    scale = abs(low.matrix_world.determinant()) ** (1 / 3)
    answer = tried(
        "bake", maps={"normal"}, size=128, padding=0, front=0.3 * scale, back=0.3 * scale
    )
    assert answer == "FINISHED", answer
    ours = 2.0 * pixels(bpy.data.images["low_normal"]) - 1.0
    own = own_bake(low, 128, 0.3)
    lengths = np.linalg.norm(own, axis=-1)
    cosines = (ours * own).sum(axis=-1) / np.linalg.norm(ours, axis=-1) / np.maximum(lengths, 0.1)
    angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))[lengths > 0.5]
    return float(angles.mean()), float(np.percentile(angles, 99))


def tangents(folder):
    """Write the arrays of a mesh with custom normals and seams, and Blender's own tangents."""
    clear()
    bpy.ops.mesh.primitive_monkey_add()
    item = bpy.context.object
    bpy.ops.object.shade_smooth()
    data = item.data
    vectors = np.array([normal.vector for normal in data.vertex_normals])
    data.normals_split_custom_set_from_vertices(vectors + 0.2 * np.sin(7.0 * vectors[:, ::-1]))
    arrays = part("gather").object_arrays(item, bpy.context.evaluated_depsgraph_get())
    np.savez(Path(folder, "arrays.npz"), **arrays)
    data.calc_tangents(uvmap=data.uv_layers.active.name)
    directions = part("gather").read(data.loops, "tangent", np.float32, 3)
    signs = part("gather").read(data.loops, "bitangent_sign", np.float32)
    np.savez(Path(folder, "tangents.npz"), directions=directions, signs=signs)
    return item.name


def nodes_of(target):
    """Bake for a target; return the images, and the colors that reach the normal map's node."""
    _, low = pair()
    answer = tried("bake", maps={"normal", "displacement", "ao"}, size=64, target=target)
    tree = low.active_material.node_tree
    shader = tree.nodes["Principled BSDF"].inputs["Normal"].links[0].from_node
    source = shader.inputs["Color"].links[0].from_node
    images = {
        image.name: [image.colorspace_settings.name, image.packed_file.data[24]]
        for image in bpy.data.images
    }
    return {
        "answer": answer, "images": images, "before normal": source.type,
        "uv map": shader.uv_map, "displaced": tree.nodes["Material Output"].inputs[2].is_linked,
    }  # fmt: skip


def displacement():
    """Bake heights alone; return the distances of the displaced vertices from the wave."""
    _, low = pair()
    answer = tried("bake", maps={"displacement"}, size=64)
    tree = low.active_material.node_tree
    node = tree.nodes["Material Output"].inputs["Displacement"].links[0].from_node
    return answer, node.space, [node.inputs[i].default_value for i in (1, 2)]


def every_map():
    """Bake all maps on the second of two UV maps; return images, and the UV maps of nodes."""
    _, low = pair()
    layer = low.data.uv_layers.new(name="second")
    low.data.uv_layers.active = layer
    names = [name for name, *_ in part("settings").MAPS]
    answer = tried("bake", maps=set(names), size=32, rays=16)
    nodes = low.active_material.node_tree.nodes
    found = {node.uv_map for node in nodes if node.type in ("UVMAP", "NORMAL_MAP")}
    images = sorted(image.name.removeprefix("low_") for image in bpy.data.images)
    return answer, images == sorted(names), sorted(found)


def materials():
    """Bake to an object that shares a material; return names of materials, and how many links."""
    high, low = pair()
    shared = bpy.data.materials.new("shared")
    high.data.materials.append(shared)
    low.data.materials.append(shared)
    first = tried("bake", maps={"normal"}, size=64)
    second = tried("bake", maps={"normal"}, size=64)
    return {
        "answers": [first, second],
        "high": high.active_material.name,
        "low": low.active_material.name,
        "textures": [sum(n.type == "TEX_IMAGE" for n in item.active_material.node_tree.nodes)
                     for item in (high, low)],
        "images": [image.name for image in bpy.data.images],
    }  # fmt: skip


def saved(folder, name="low", sizes=(64,)):
    """Bake into files beside the .blend file, once for each size."""
    _, low = pair()
    low.name = name
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder, "scene.blend")))
    for size in sizes:
        answer = tried("bake", maps={"normal"}, size=size, save="FILES", target="unreal")
    image = bpy.data.images[0]
    return answer, image.filepath, image.packed_file is None, list(image.size)


def page_script(page, folder):
    """Run the script of a page of the documentation, with small images; return their names."""
    clear()
    choose(waved())
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder, "scene.blend")))
    script = Path(page).read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    exec(script.replace("2048", "64"), {})
    return sorted(image.name for image in bpy.data.images)


def unwrap_cylinder(in_edit_mode):
    """Unwrap a cylinder with seams around its caps and down its side."""
    clear()
    bpy.ops.mesh.primitive_cylinder_add(vertices=24)
    item = bpy.context.object
    caps = [set(p.vertices) for p in item.data.polygons if len(p.vertices) == 24]
    for edge in item.data.edges:
        ends = set(edge.vertices)
        edge.use_seam = any(ends <= cap for cap in caps) or ends == {0, 1}
    item.data.uv_layers.new(name="other")
    if in_edit_mode:
        bpy.ops.object.mode_set(mode="EDIT")
    answer = tried("unwrap", size=256, uv_map="atlas")
    mode = item.mode
    bpy.ops.object.mode_set(mode="OBJECT")
    layer = item.data.uv_layers.active
    cut = set()
    for edge in item.data.edges:
        sides = {
            tuple(tuple(round(x, 5) for x in layer.uv[loop].vector) for _, loop in sorted(
                (item.data.loops[i].vertex_index, i) for i in polygon.loop_indices
                if item.data.loops[i].vertex_index in edge.vertices))
            for polygon in item.data.polygons if edge.key in polygon.edge_keys
        }  # fmt: skip
        if len(sides) == 2:
            cut.add(edge.index)
    seams = {edge.index for edge in item.data.edges if edge.use_seam}
    return {"answer": answer, "layer": layer.name, "mode": mode, "seams kept": seams <= cut,
            "others cut": len(cut - seams)}  # fmt: skip


def unwrap_together():
    """Unwrap two objects into one texture; return whether their islands overlap, and the range."""
    items = monkey_and_torus()
    answer = tried("unwrap", size=128)
    arrays = [part("gather").mesh_arrays(item.data, "") for item in items]
    hit = np.zeros((2, 512, 512), bool)
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 400)
    for number, each in enumerate(arrays):
        points = np.einsum("wc,fcx->fwx", weights, each["uv0"][each["triangles"]]).reshape(-1, 2)
        x, y = np.clip(np.floor(512 * points), 0, 511).astype(int).T
        hit[number, y, x] = True
    uvs = np.concatenate([each["uv0"] for each in arrays])
    return answer, int(hit.all(axis=0).sum()), float(uvs.min()), float(uvs.max())


def unwrap_without_room():
    """Unwrap two objects, the second of which has no room; return the answer and the UV maps."""
    one, other = monkey_and_torus()
    while len(other.data.uv_layers) < 8:
        other.data.uv_layers.new()
    answer = tried("unwrap", size=64, uv_map="atlas")
    return answer, [[layer.name for layer in one.data.uv_layers], len(other.data.uv_layers)]


def simplified(operator, options):
    """Make a mesh smaller; return what is known of the result."""
    clear()
    bpy.ops.mesh.primitive_cube_add()
    item = bpy.context.object
    item.name = "box"
    item.matrix_world = MATRICES["mirrored"]
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.subdivision_type = 4, "SIMPLE"
    for name in "red", "blue":
        item.data.materials.append(bpy.data.materials.new(name))
    item.data.polygons[0].material_index = 1
    item.data.shade_smooth()
    item.data.set_sharp_from_angle(angle=math.radians(30))
    bpy.context.view_layer.update()
    answer = tried(operator, **options)
    made = bpy.context.object
    points = np.array([vertex.co for vertex in made.data.vertices])
    counts = np.bincount([p.material_index for p in made.data.polygons], minlength=2).tolist()
    volume = sum(
        float(np.dot(points[p.vertices[0]], np.cross(points[p.vertices[1]], points[p.vertices[2]])))
        for p in made.data.polygons
    ) / 6  # fmt: skip
    uses = np.bincount(part("gather").read(made.data.loops, "edge_index", np.int32))
    return {
        "answer": answer, "name": made.name, "matrix": made.matrix_world == item.matrix_world,
        "faces": len(made.data.polygons), "counts": counts,
        "materials": [slot.material.name for slot in made.material_slots], "volume": volume,
        "sharp": sum(edge.use_edge_sharp for edge in made.data.edges),
        "uv maps": [layer.name for layer in made.data.uv_layers],
        "selected": sorted(o.name for o in bpy.context.selected_objects),
        "size": list(made.dimensions), "closed": bool((uses == 2).all()),
    }  # fmt: skip


def lightened(folder):
    """Lighten a model with a JPEG texture and a metallic factor."""
    clear()
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
    item = bpy.context.object
    item.name = "ball"
    source = bpy.data.images.new("paint", 64, 64)
    ramp = np.ones((64, 64, 4), np.float32)
    ramp[..., 0], ramp[..., 1] = np.linspace(0, 1, 64), np.linspace(0, 1, 64)[:, None]
    source.pixels.foreach_set(ramp.ravel())
    source.filepath_raw, source.file_format = str(Path(folder, "paint.jpg")), "JPEG"
    source.save()
    bpy.data.images.remove(source)
    image = bpy.data.images.load(str(Path(folder, "paint.jpg")))
    material = bpy.data.materials.new("painted")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(texture.outputs[0], shader.inputs["Base Color"])
    item.data.materials.append(material)
    answer = tried("lighten", faces=200, size=64)
    made = bpy.context.object
    shader = made.active_material.node_tree.nodes["Principled BSDF"]
    baked = shader.inputs["Base Color"].links[0].from_node.image
    return {
        "answer": answer, "name": made.name, "faces": len(made.data.polygons),
        "color": pixels(baked).mean(axis=(0, 1)).tolist(),
        "kept": image.file_format, "size": list(made.dimensions),
    }  # fmt: skip


def checked(with_modifier):
    """Check a grid whose first face is folded onto the second one in the texture."""
    clear()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4)
    item = bpy.context.object
    layer, first, second = item.data.uv_layers.active, *(p for p in item.data.polygons[:2])
    for one, other in zip(first.loop_indices, second.loop_indices, strict=True):
        layer.uv[one].vector = layer.uv[other].vector
    if with_modifier:
        item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        bpy.ops.object.mode_set(mode="EDIT")
    answer = tried("check", size=256)
    found = [[f.severity, f.name, f.counted] for f in bpy.context.window_manager.texbake_findings]
    names = [name for _, name, _ in found]
    mode = item.mode
    number = names.index("overlapping-coordinates")
    again = tried("select_finding", number=number)
    mode_again = item.mode
    bpy.ops.object.mode_set(mode="OBJECT")
    chosen = [p.index for p in item.data.polygons if p.select]
    return {"answer": answer, "found": found, "mode": mode, "selected": chosen, "again": again,
            "mode again": mode_again}  # fmt: skip


def undone(operator, options, in_edit_mode=False):
    """Undo an operator; return the state of the scene before it, after it, and after undo."""

    def state():
        items = {}
        for item in sorted(bpy.data.objects, key=lambda item: item.name):
            uvs = part("gather").read(item.data.uv_layers[0].uv, "vector", np.float32, 2)
            found = item.active_material
            count = 0 if found is None else len(found.node_tree.nodes)
            items[item.name] = [float(uvs.sum()), item.mode, count]
        return {"objects": items, "images": len(bpy.data.images)}

    pair()
    if in_edit_mode:
        bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="before")
    before = state()
    getattr(bpy.ops.texbake, operator)("EXEC_DEFAULT", True, **with_sets(options))
    after = state()
    bpy.ops.ed.undo()
    return before, after, state()


def _nothing_selected():
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = None


def _no_uvs():
    data = bpy.data.objects["low"].data
    data.uv_layers.remove(data.uv_layers[0])
    data.update()


def _camera_active():
    choose(bpy.data.objects["low"], added("camera", bpy.data.cameras.new("camera")))


def _no_faces():
    bpy.data.objects["low"].data = bpy.data.meshes.new("empty")


def _flat_scale():
    bpy.data.objects["low"].scale = (1, 1, 0)
    bpy.context.view_layer.update()


def _no_wheel():
    part("process").folder_of = lambda package: None


def _broken_wheel():
    broken = Path(os.environ["BLENDER_USER_RESOURCES"], "broken")
    (broken / "texbake").mkdir(parents=True, exist_ok=True)
    (broken / "texbake" / "__init__.py").write_text("raise OSError('its core is for Windows')\n")
    part("process").folder_of = lambda package: str(broken)


def _no_folder():
    part("process").tempfile.tempdir = "/nowhere"


def _other_mesh():
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "other"
    choose(bpy.data.objects["high"], bpy.data.objects["low"])


def _in_edit_mode(spoil):
    def spoiled():
        spoil()
        added("lamp").select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")

    return spoiled


SPOILERS = {
    "other mesh": _other_mesh,
    "nothing selected": _nothing_selected,
    "low-poly mesh alone": lambda: choose(bpy.data.objects["low"]),
    "no UV map": _no_uvs,
    "active object is no mesh": _camera_active,
    "no faces": _no_faces,
    "scale of 0": _flat_scale,
    "wheel missing": _no_wheel,
    "wheel of another platform": _broken_wheel,
    "no temporary folder": _no_folder,
    "no UV map in edit mode": _in_edit_mode(_no_uvs),
    "no folder in edit mode": _in_edit_mode(_no_folder),
    "nothing wrong": lambda: None,
}


def refused(how, operator, options):
    """Spoil a scene; return the answer of an operator, and whether anything changed."""

    def state():
        items = [(item.name, item.mode, item.select_get()) for item in bpy.data.objects]
        return items, len(bpy.data.images), len(bpy.data.materials)

    pair()
    process = part("process")
    kept = process.folder_of
    SPOILERS[how]()
    before = state()
    answer = tried(operator, **options)
    process.folder_of, process.tempfile.tempdir = kept, None
    return answer, before == state() and not process.RUNNING


def skips_others():
    """Bake with a lamp in the selection."""
    high, low = pair()
    choose(added("lamp"), high, low)
    return tried("bake", maps={"normal"}, size=64), len(bpy.data.images)


def _work(size=4096):
    high, low = pair()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    gather = part("gather")
    options = {"maps": ["normal", "ao"], "size": size, "samples": 16, "target": "blender"}
    return part("process").Work(
        "bake", options, low=[gather.object_arrays(low, depsgraph)],
        high=[gather.object_arrays(high, depsgraph)],
    )  # fmt: skip


class Window:
    """Stands for a window: what the modal operator asks of its manager and its workspace."""

    def __init__(self):
        self.window_manager = self.workspace = self
        self.window, self.texts, self.calls = self, [], []

    @property
    def view_layer(self):
        """Return that of the scene."""
        return bpy.context.view_layer

    def status_text_set(self, text):
        """Keep a text of the status bar."""
        self.texts.append(text)

    def __getattr__(self, name):
        return lambda *_args, **_named: self.calls.append(name) or name


def modal(events, size=4096, mode="OBJECT"):
    """Run an operator in a mode by events, as a window does; return what happened."""
    operators = part("operators")
    reports = []

    class Probe(operators.Working):
        """An operator without a class of Blender."""

        def report(self, kinds, text):
            """Keep a report."""
            reports.append(text)

        def begin(self, context):
            """Start."""
            work = _work(size)
            bpy.ops.object.mode_set(mode=mode)
            self.leave_mode(context)
            assert bpy.context.object.mode == "OBJECT"
            if not events:
                work.close()
                raise part("process").WorkError("nothing to do")
            return work

        def end(self, context, work):
            """End."""
            return "the end"

    window, probe = Window(), Probe()
    context = window
    answers = []
    operators.bpy = SimpleNamespace(app=SimpleNamespace(background=False), ops=bpy.ops)
    try:
        answers += probe.invoke(context, None)
        work = probe._work
        if work is None:
            return {"answers": answers, "reports": reports, "mode": bpy.context.object.mode}
        for kind in events:
            deadline = time.monotonic() + 60
            while (
                kind == "progress" and work.stage in ("start", "") and time.monotonic() < deadline
            ):
                time.sleep(0.05)
                probe.modal(context, SimpleNamespace(type="TIMER", value=""))
            while kind == "end" and time.monotonic() < deadline and "FINISHED" not in answers:
                time.sleep(0.05)
                answers += probe.modal(context, SimpleNamespace(type="TIMER", value=""))
            if kind == "end":
                continue
            kind = "TIMER" if kind == "progress" else kind
            answers += probe.modal(context, SimpleNamespace(type=kind, value="PRESS"))
    finally:
        operators.bpy = bpy
    return {
        "answers": answers, "reports": reports, "texts": window.texts, "calls": window.calls,
        "ended": work.process.poll() is not None, "files": work.folder.exists(),
        "running": len(part("process").RUNNING), "mode": bpy.context.object.mode,
    }  # fmt: skip


def start_and_wait():
    """Start a long bake, print its process and its folder, and wait to be killed."""
    work = _work()
    while work.stage == "start":
        work.poll()
        time.sleep(0.05)
    print(json.dumps([work.process.pid, str(work.folder)]), flush=True)
    time.sleep(600)


def switched_off():
    """Disable and enable the extension, with a task at work."""
    work = _work()
    bpy.ops.preferences.addon_disable(module=MODULE)
    gone = not hasattr(bpy.types.Scene, "texbake")
    bpy.ops.preferences.addon_enable(module=MODULE)
    return gone, hasattr(bpy.types.Scene, "texbake"), work.process.poll() is not None


def menus():
    """Draw the menus and panels without a window; return the operators and properties in them."""
    clear()
    entry = bpy.context.window_manager.texbake_findings.add()
    entry.title, entry.severity = "a finding", "error"
    extension = __import__(MODULE, fromlist=["*"])
    layout = MagicMock()
    layout.column.return_value = layout
    drawn = SimpleNamespace(layout=layout)
    for draw in extension.draw_object_menu, extension.draw_uv_menu, extension.ObjectMenu.draw:
        draw(drawn, bpy.context)
    for panel in extension.PANELS:
        panel.draw(SimpleNamespace(layout=layout, group=panel.group), bpy.context)
    extension.FindingsPanel.draw(drawn, bpy.context)
    calls = [call.args for call in layout.operator.call_args_list]
    shown = [call.args[1] for call in layout.prop.call_args_list]
    known = hasattr(bpy.types, "TEXBAKE_PT_findings") and hasattr(bpy.types, "TEXBAKE_MT_object")
    return known, sorted({name for name, *_ in calls}), sorted(set(shown))


def main():
    """Install the extension, and answer lines."""
    answers = os.fdopen(os.dup(1), "w")  # Blender prints on stdout as well
    os.dup2(2, 1)
    result = bpy.ops.extensions.package_install_files(
        filepath=sys.argv[1], repo="user_default", enable_on_install=True
    )
    bpy.context.preferences.edit.use_global_undo = True
    print(json.dumps([sorted(result), None]), file=answers, flush=True)
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        try:
            answer = [globals()[name](*arguments), None]
        except Exception:
            answer = [None, traceback.format_exc()]
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    if sys.argv[2:]:
        bpy.ops.preferences.addon_enable(module=MODULE)
        start_and_wait()
    else:
        main()
