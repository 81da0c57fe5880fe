# SPDX-License-Identifier: GPL-3.0-or-later
"""Results in the scene: images, materials that use them, texture coordinates, meshes."""

import itertools
import re
import shutil
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .gather import AnyArray, read

_NODE = "texbake"  # what the names of nodes begin with
Socket = bpy.types.NodeSocket

COLORS = ("color", "id")  # codings of maps that are sRGB
MOST_UV_MAPS = 8  # of a mesh of Blender


def file_stem(title: str) -> str:
    """Return the title of a map, which may have any character, as a part of a path."""
    stem = re.sub(r'[\x00-\x1f"*/:<>?\\|]', "_", title)
    return stem.encode()[:200].decode(errors="ignore")


def earlier_image(title: str) -> bpy.types.Image | None:
    """Return the image of this title that an earlier bake made."""
    old = bpy.data.images.get((title, None))  # not one that is linked from another file
    return old if old is not None and old.get("texbake") == title else None


def save_file(file: Path, title: str, folder: Path) -> Path:
    """Copy a baked map into a folder; return its path.

    Only a file that the image of an earlier bake shows is replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stem, old = file_stem(title), earlier_image(title)
    own = None
    if old is not None and old.packed_file is None:
        own = Path(bpy.path.abspath(old.filepath_raw)).resolve()
    names = (f"{stem}.{number:03}.png" if number else f"{stem}.png" for number in itertools.count())
    paths = (folder / name for name in names)
    path = next(path for path in paths if not path.exists() or path.resolve() == own)
    part = folder / f".{path.name}.part"
    shutil.copyfile(file, part)
    return part.replace(path)


def load_image(file: Path, title: str, coding: str, *, packed: bool) -> bpy.types.Image:
    """Load a baked map, and pack it into the .blend file, or refer to its file."""
    old = earlier_image(title)
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "sRGB" if coding in COLORS else "Non-Color"
    if packed:
        image.pack()
        image.filepath_raw = f"//{file_stem(title)}.png"  # where unpacking writes it
    else:
        image.filepath_raw = bpy.path.relpath(str(file))
    image["texbake"] = title
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = title
    return image


def own_materials(item: bpy.types.Object) -> list[bpy.types.Material]:
    """Return the materials of an object, none of which another object uses."""
    data = item.data
    if not any(slot.material for slot in item.material_slots):
        material = bpy.data.materials.new(item.name)
        if not item.material_slots:
            data.materials.append(None)
        item.material_slots[0].material = material
    for slot in item.material_slots:
        elsewhere = slot.material is not None and any(
            other.data is not data and slot.material.name in other.material_slots
            for other in bpy.data.objects
        )
        if elsewhere or (slot.material and not slot.material.is_editable):
            slot.material = slot.material.copy()
    return list(dict.fromkeys(slot.material for slot in item.material_slots if slot.material))


class Wiring:
    """The nodes of a material that show baked maps."""

    def __init__(self, material: bpy.types.Material, uv_map: str) -> None:
        if bpy.app.version < (5, 0):  # later ones always use nodes
            material.use_nodes = True
        self.tree = material.node_tree
        self.uv_map = uv_map
        self.shader = self._first("BSDF_PRINCIPLED")
        self.output = self._first("OUTPUT_MATERIAL")
        self._rows = 0

    @property
    def works(self) -> bool:
        """Whether there is a shader to wire maps into."""
        return self.shader is not None and self.output is not None

    def wire(self, image: bpy.types.Image, baked: dict[str, Any], *, displaces: bool) -> None:
        """Show one map; `displaces`: whether a height map is linked to the output."""
        kind, convention = baked["name"], baked["convention"]
        for node in [n for n in self.tree.nodes if n.name.startswith(f"{_NODE} {kind}:")]:
            self.tree.nodes.remove(node)
        place = self._place()
        texture = self._node(kind, "ShaderNodeTexImage", place, 0)
        texture.image = image
        coordinates = self._node(kind, "ShaderNodeUVMap", place, -1)
        coordinates.uv_map = self.uv_map
        self._link(coordinates.outputs[0], texture.inputs["Vector"])
        color = texture.outputs["Color"]
        if kind == "normal":
            if convention == "directx":
                color = self._with_green_flipped(color, place)
            normal = self._node(kind, "ShaderNodeNormalMap", place, 4)
            normal.uv_map = self.uv_map
            self._link(color, normal.inputs["Color"])
            self._link(normal.outputs[0], self.shader.inputs["Normal"])
        elif kind == "displacement":
            heights = self._node(kind, "ShaderNodeDisplacement", place, 4)
            heights.space = "OBJECT"
            heights.inputs["Midlevel"].default_value = baked["height"][0]
            heights.inputs["Scale"].default_value = baked["height"][1]
            self._link(color, heights.inputs["Height"])
            if displaces:
                self._link(heights.outputs[0], self.output.inputs["Displacement"])
        elif kind == "vertex-color":
            self._link(color, self.shader.inputs["Base Color"])

    def _with_green_flipped(self, color: Socket, place: tuple[float, float]) -> Socket:
        parts = self._node("normal", "ShaderNodeSeparateColor", place, 1)
        flipped = self._node("normal", "ShaderNodeMath", place, 2)
        flipped.operation = "SUBTRACT"
        flipped.inputs[0].default_value = 1.0
        whole = self._node("normal", "ShaderNodeCombineColor", place, 3)
        self._link(color, parts.inputs[0])
        self._link(parts.outputs["Green"], flipped.inputs[1])
        for name in "Red", "Blue":
            self._link(parts.outputs[name], whole.inputs[name])
        self._link(flipped.outputs[0], whole.inputs["Green"])
        return whole.outputs[0]

    def _first(self, kind: str) -> bpy.types.Node | None:
        return next((node for node in self.tree.nodes if node.type == kind), None)

    def _place(self) -> tuple[float, float]:
        self._rows += 1
        x, y = self.shader.location
        return x - 1300.0, y - 320.0 * (self._rows - 1)

    def _node(
        self, kind: str, type_name: str, place: tuple[float, float], column: int
    ) -> bpy.types.Node:
        node = self.tree.nodes.new(type_name)
        node.name = f"{_NODE} {kind}: {type_name}"
        node.label = f"{kind} (texbake)" if type_name == "ShaderNodeTexImage" else ""
        node.location = place[0] + (300.0 if column > 0 else 220.0) * column, place[1]
        return node

    def _link(self, source: Socket, target: Socket) -> None:
        self.tree.links.new(source, target)


def show_maps(
    item: bpy.types.Object, maps: list[dict[str, Any]], images: list[bpy.types.Image], uv_map: str
) -> list[str]:
    """Wire maps into the materials of an object; return warnings."""
    names = [baked["name"] for baked in maps]
    warnings = []
    for material in own_materials(item):
        wiring = Wiring(material, uv_map)
        if not wiring.works:
            warnings.append(f"{material.name}: it has no Principled BSDF, so no map was linked")
            continue
        for baked, image in zip(maps, images, strict=True):
            # A normal map is for the surface without heights.
            wiring.wire(image, baked, displaces="normal" not in names)
    return warnings


def write_uvs(data: bpy.types.Mesh, name: str, uvs: AnyArray) -> None:
    """Write texture coordinates by loop into a UV map of a mesh."""
    # Through `uv_layers[name].uv`, Blender 5.0 would change its steps of undo as well.
    data.attributes[name].data.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())


def has_room(data: bpy.types.Mesh, name: str) -> bool:
    """Return whether a mesh has a UV map of this name, or fewer than the most possible."""
    return name in data.uv_layers or len(data.uv_layers) < MOST_UV_MAPS


def set_uvs(item: bpy.types.Object, name: str, uvs: AnyArray) -> None:
    """Write texture coordinates into a UV map, which is made if it is missing, and active then."""
    layers = item.data.uv_layers
    layer = layers.get(name) or layers.new(name=name, do_init=False)
    write_uvs(item.data, layer.name, uvs)
    layers.active = layers[layer.name]
    item.data.update()


def make_object(
    source: bpy.types.Object, arrays: dict[str, AnyArray], suffix: str, uv_map: str
) -> bpy.types.Object:
    """Make an object of a mesh beside its source, with its materials; return it."""
    name = f"{source.name}_{suffix}"
    data = bpy.data.meshes.new(name)
    faces = arrays["faces"]
    data.vertices.add(len(arrays["positions"]))
    data.vertices.foreach_set("co", arrays["positions"].ravel())
    data.loops.add(faces.size)
    data.loops.foreach_set("vertex_index", faces.ravel())
    data.polygons.add(len(faces))
    data.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    if "materials" in arrays:
        data.polygons.foreach_set("material_index", arrays["materials"])
    data.update(calc_edges=True)
    if "uvs" in arrays:
        write_uvs(data, data.uv_layers.new(name=uv_map, do_init=False).name, arrays["uvs"])
    if "colors" in arrays:
        layer = data.color_attributes.new("Color", "FLOAT_COLOR", "POINT")
        layer.data.foreach_set("color", arrays["colors"].ravel())
    mark_sharp(data, arrays.get("sharp"))
    data.validate()
    for slot in source.material_slots:
        data.materials.append(slot.material)
    made = bpy.data.objects.new(name, data)
    for collection in source.users_collection:
        collection.objects.link(made)
    made.matrix_world = source.matrix_world
    return made


def write_flags(data: bpy.types.Mesh, name: str, domain: str, flags: AnyArray) -> None:
    """Write booleans (n,) of the elements of a mesh into an attribute."""
    # A new attribute: Blender 5.0 crashes, or fails, where the old one has one value for all.
    if (old := data.attributes.get(name)) is not None:
        data.attributes.remove(old)
    new = data.attributes.new(name, "BOOLEAN", domain)
    new.data.foreach_set("value", np.asarray(flags, np.uint8))


def mark_sharp(data: bpy.types.Mesh, pairs: AnyArray | None) -> None:
    """Mark the edges between pairs of vertices (n, 2) as sharp."""
    if pairs is None or len(pairs) == 0:
        return
    edges = read(data.edges, "vertices", np.int32, 2)
    keys, wanted = (
        np.sort(rows, axis=1).astype(np.int64) @ np.array([len(data.vertices), 1])
        for rows in (edges, pairs)
    )
    write_flags(data, "sharp_edge", "EDGE", np.isin(keys, wanted))
