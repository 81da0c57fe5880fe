"""Make the files of this folder: a low-poly mesh, and what Blender 5.0.1 bakes and computes for it.

Blender runs in an environment of its own (Python 3.11: pip install bpy==5.0.1), whose Python
BLENDER_PYTHON names:

    BLENDER_PYTHON=... python tests/cases/make.py

Blender's results belong to the meshes of `tests/models.py`: after a change of `creature` or
`fused`, run this again.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SIZE, DISTANCE = 256, 0.06


def tangent_cases():
    """Meshes on which tangent spaces are split, shared, mirrored, and missing."""
    from tests import models
    from texbake.mesh.shapes import uv_sphere

    yield "figure", models.read_mesh(HERE / "figure_low.obj")
    ball = uv_sphere(10, 16)
    mirrored = ball.uvs.copy()
    mirrored[:, 0] = 0.5 - np.abs(mirrored[:, 0] - 0.5)
    yield "mirrored ball", ball.replace(uvs=mirrored)
    cells = models.model("fused cells")
    # Corners on a coarse grid: whole faces are mirrored, turned, or squeezed to a line or a point.
    random = np.random.default_rng(5)
    grid = np.stack(np.divmod(np.arange(16), 4), axis=1) / 4.0
    vertices = random.integers(0, 16, cells.n_vertices)[cells.faces]
    corners = np.where(random.random((cells.n_faces, 1)) < 0.3, 5, vertices)
    # No normal is along x, where texbake's default tangent differs from Blender's.
    turn = np.array([[2.0, -2, 1], [1, 2, 2], [-2, -1, 2]]) / 3.0
    yield (
        "fused cells",
        cells.replace(
            positions=(cells.positions[:, None] * turn).sum(axis=2), uvs=grid, uv_faces=corners
        ),
    )
    yield "quads", quads(np.random.default_rng(6))


def quads(random, n=9):
    """A rough sheet of quadrilaterals and triangles, partly mirrored, badly mapped or in pieces."""
    from texbake.mesh.mesh import Mesh
    from texbake.mesh.polygons import triangulated

    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    points = np.stack([u, v, 0.1 * np.sin(5 * u) * np.cos(7 * v)], axis=2).reshape(-1, 3)
    points += random.normal(0, 0.02, points.shape)
    points[1 : n + 1 : 2] = points[:n:2][: len(points[1 : n + 1 : 2])]
    uvs = np.stack([abs(u - 0.3) + 0.2 * v * v, v + 0.1 * u], axis=2)
    uvs[:, n // 2 :] += random.normal(0, 0.08, (n + 1, n + 1 - n // 2, 2))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)
    corners = np.take_along_axis(corners, (np.arange(4) + random.integers(0, 4, (n * n, 1))) % 4, 1)
    sizes = np.where(random.random(n * n) < 0.8, 4, 3)
    charts = uvs.reshape(-1, 2)[corners]
    charts[-n:] = random.random((n, 4, 2))
    is_there = np.arange(4) < sizes[:, None]
    flat = corners[is_there]
    slots, polygons = triangulated("quads", points, flat, sizes)
    return Mesh(
        positions=points, faces=flat[slots], uvs=charts[is_there], uv_faces=slots,
        polygon_of=polygons,
    )  # fmt: skip


def tangents_by_blender(path):
    """Runs in Blender: add normals, tangents and signs to the arrays of a file."""
    import bpy

    arrays = dict(np.load(path))
    positions, faces = arrays["positions"], arrays["faces"]
    sizes = arrays.get("sizes", np.full(len(faces), 3))
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(sizes))
    mesh.polygons.foreach_set("loop_start", (np.cumsum(sizes) - sizes).astype(np.int32))
    mesh.uv_layers.new(name="uv").data.foreach_set("uv", arrays["uvs"].ravel())
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    mesh.calc_tangents(uvmap="uv")
    for name, attribute, width in (
        ("normals", "normal", 3), ("tangents", "tangent", 3), ("signs", "bitangent_sign", 1)
    ):  # fmt: skip
        values = np.empty(faces.size * width, np.float32)
        mesh.loops.foreach_get(attribute, values)
        arrays[name] = values.reshape((*faces.shape, width) if width > 1 else faces.shape)
    arrays["signs"] = arrays["signs"].astype(np.int8)
    np.savez_compressed(path, **arrays)


def bake_by_blender(high, low, out):
    """Runs in Blender: bake the normals of a mesh onto another, one ray per texel, no margin."""
    import bpy

    def read(path):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
        (found,) = bpy.context.selected_objects
        found.data.shade_smooth()
        return found

    bpy.ops.wm.read_factory_settings(use_empty=True)
    high_object, low_object = read(high), read(low)
    image = bpy.data.images.new("baked", SIZE, SIZE, float_buffer=True, is_data=True)
    material = bpy.data.materials.new("low")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    low_object.data.materials.clear()
    low_object.data.materials.append(material)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    bake = scene.render.bake
    bake.use_selected_to_active, bake.margin = True, 0
    bake.cage_extrusion, bake.max_ray_distance = DISTANCE, 2 * DISTANCE
    bpy.ops.object.select_all(action="DESELECT")
    high_object.select_set(True)
    low_object.select_set(True)
    bpy.context.view_layer.objects.active = low_object
    bpy.ops.object.bake(type="NORMAL")
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "16"
    settings.compression = 100
    scene.view_settings.view_transform = "Raw"
    image.save_render(out, scene=scene)


def make_all():
    sys.path.insert(0, str(HERE.parents[1]))
    from tests import models
    from texbake import simplify, unwrap, write_mesh
    from texbake.mesh.polygons import outlines

    def blender(*arguments):
        subprocess.run([os.environ["BLENDER_PYTHON"], __file__, *map(str, arguments)], check=True)

    low = simplify(models.creature(64), 1000, quality="best")
    low = unwrap(low, size=SIZE, padding=2)
    write_mesh(low.replace(positions=low.positions.round(5), uvs=low.uvs.round(6)),
               HERE / "figure_low.obj")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        high = Path(folder) / "high.obj"
        write_mesh(models.model("bumpy figure"), high)
        blender("bake", high, HERE / "figure_low.obj", HERE / "figure_normal.png")
    for case, mesh in tangent_cases():
        path = HERE / f"{case.replace(' ', '_')}_tangents.npz"
        arrays = {"positions": mesh.positions, "faces": mesh.faces, "uvs": mesh.corner_uvs()}
        if mesh.polygon_of is not None:  # corner after corner, instead of three a face
            polygons = outlines(mesh)
            arrays["sizes"] = polygons.sizes.astype(np.int32)
            arrays["faces"] = mesh.faces.ravel()[polygons.slots]
            arrays["uvs"] = mesh.corner_uvs().reshape(-1, 2)[polygons.slots]
        for name in ("positions", "uvs"):
            arrays[name] = arrays[name].astype(np.float32)
        np.savez(path, **arrays)
        blender("tangents", path)


if __name__ == "__main__":
    what, *arguments = sys.argv[1:] or ["all"]
    {"all": make_all, "tangents": tangents_by_blender, "bake": bake_by_blender}[what](*arguments)
