"""A material as nodes of MaterialX: an OpenPBR surface that reads maps, for .mtlx and USD files.

Based on: MaterialX Specification 1.39; Academy Software Foundation, OpenPBR Surface 1.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

from texbake.records import dataclass

# Type, kind of the input ("node", "value" or "file"), and the input.
Input = tuple[str, str, str]
# By kinds of maps: the input of the surface that an image feeds.
_WHOLE = {
    "base-color": ("base_color", "color3"), "emissive": ("emission_color", "color3"),
    "roughness": ("specular_roughness", "float"), "metalness": ("base_metalness", "float"),
    "opacity": ("geometry_opacity", "float"),
}  # fmt: skip
# ... and the inputs that the channels of an image feed.
_PACKED = {
    "orm": ("vector3", {"specular_roughness": 1, "base_metalness": 2}),
    "mask-map": ("vector4", {"base_metalness": 0, "smoothness": 3}),
}


@dataclass(frozen=True)
class Node:
    """A node: its category, its name, its type, and its inputs."""

    category: str
    name: str
    type: str
    inputs: dict[str, Input]


class _Graph:
    def __init__(self, maps: Mapping[str, str]) -> None:
        self.maps, self.nodes = maps, list[Node]()

    def add(self, category: str, name: str, type_: str, **inputs: Input) -> Input:
        named = {key.rstrip("_"): value for key, value in inputs.items()}
        self.nodes.append(Node(category, name.replace("-", "_"), type_, named))
        return type_, "node", self.nodes[-1].name

    def image(self, kind: str, type_: str) -> Input:
        return self.add("image", f"{kind}_map", type_, file=("filename", "file", self.maps[kind]))


def openpbr_nodes(
    maps: Mapping[str, str], *, convention: str = "opengl", mid: float = 0.0, scale: float = 1.0
) -> list[Node]:
    """Nodes of a material, which is the last; `mid` and `scale` describe the heights."""
    graph, surface = _Graph(maps), dict[str, Input]()
    for kind, (place, type_) in _WHOLE.items():
        if kind in maps:
            surface[place] = graph.image(kind, type_)
    if "emissive" in maps:
        surface["emission_luminance"] = ("float", "value", "1")
    for kind, (type_, places) in _PACKED.items():
        if kind not in maps:
            continue
        source = graph.image(kind, type_)
        for place, index in places.items():
            number = ("integer", "value", str(index))
            value = graph.add("extract", place, "float", in_=source, index=number)
            if place == "smoothness":
                place = "specular_roughness"
                value = graph.add("invert", place, "float", in_=value)
            surface[place] = value
    if "normal" in maps:
        source = graph.image("normal", "vector3")
        if convention == "directx":  # MaterialX reads +Y
            turned = ("vector3", "value", "1, -1, 1")
            source = graph.add("multiply", "mirrored", "vector3", in1=source, in2=turned)
            moved = ("vector3", "value", "0, 1, 0")
            source = graph.add("add", "plus_y", "vector3", in1=source, in2=moved)
        surface["geometry_normal"] = graph.add("normalmap", "normal", "vector3", in_=source)
    found = {"surfaceshader": graph.add("open_pbr_surface", "surface", "surfaceshader", **surface)}
    if "displacement" in maps:
        level = ("float", "value", repr(mid))
        above = graph.add(
            "subtract", "above", "float", in1=graph.image("displacement", "float"), in2=level
        )
        found["displacementshader"] = graph.add(
            "displacement", "heights", "displacementshader", displacement=above,
            scale=("float", "value", repr(scale)),
        )  # fmt: skip
    graph.add("surfacematerial", "material", "material", **found)
    return graph.nodes


def materialx_document(nodes: list[Node], name: str) -> str:
    """Return a MaterialX document; the names of its nodes begin with the name of the asset."""
    document = ElementTree.Element("materialx", version="1.39", colorspace="lin_rec709")
    for node in nodes:
        written = ElementTree.SubElement(
            document, node.category, name=f"{name}_{node.name}", type=node.type
        )
        for key, (type_, meaning, value) in node.inputs.items():
            item = ElementTree.SubElement(written, "input", name=key, type=type_)
            if meaning == "node":
                item.set("nodename", f"{name}_{value}")
            else:
                item.set("value", value)
            if meaning == "file" and node.type == "color3":
                item.set("colorspace", "srgb_texture")
    ElementTree.indent(document)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(document, "unicode") + "\n"
