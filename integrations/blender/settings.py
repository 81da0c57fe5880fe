# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user can choose: the same properties for the operators and for the panel."""

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

MAPS = (
    ("normal", "Normal", "Surface normals in tangent space"),
    ("displacement", "Displacement", "Distances along the smooth normals"),
    ("ao", "Ambient Occlusion", "How much light from all sides reaches the surface"),
    ("bent-normal", "Bent Normal", "Mean direction that is not occluded"),
    ("curvature", "Curvature", "White edges and black grooves"),
    ("thickness", "Thickness", "How thick the model is below the surface"),
    ("position", "Position", "Surface points in the space of the active object"),
    ("object-id", "Object ID", "A color for each high-poly object"),
    ("vertex-color", "Vertex Color", "Active color attribute of the high-poly objects"),
)
TARGETS = (
    ("blender", "Blender", "OpenGL normal maps and 16 bits per channel"),
    ("gltf-web", "glTF", "OpenGL normal maps and 8 bits per channel"),
    ("unreal", "Unreal", "DirectX normal maps with 16 bits; names such as T_rock_N"),
    ("unity", "Unity", "OpenGL normal maps with 16 bits; names such as rock_Normal"),
    ("godot", "Godot", "OpenGL normal maps and 8 bits per channel"),
)
SAMPLES = (
    *((str(n), str(n), f"{n} rays per texel") for n in (1, 4, 16, 64)),
    ("adaptive", "Adaptive", "Up to 64 rays per texel, where neighboring samples differ"),
)
SAVE = (
    ("PACK", "Packed", "Pack the images into the .blend file"),
    ("FILES", "Files", "Save the images in the folder textures beside the .blend file"),
)
QUALITIES = (
    ("fast", "Fast", "Keeps vertices where they are"),
    ("best", "Best", "Moves vertices, which is slower and closer to the surface"),
)
UNWRAP_QUALITIES = (
    ("fast", "Fast", "For large scans"),
    ("good", "Good", "Charts with little stretch"),
    ("best", "Best", "Fewer charts and tighter packing"),
)
SEAMS = (
    ("MARKED", "Marked", "Cut only at edges that are marked as seams, if possible; texbake chooses "
     "where to cut a mesh without any"),
    ("UV", "UV Map", "Cut along the seams of the UV map"),
    ("FREE", "Free", "texbake chooses where to cut"),
    ("PACK", "Only Pack", "Keep the UV islands, and only pack them"),
)  # fmt: skip
UV_SEAMS = (
    ("auto", "Auto", "Keep seams if the number of triangles can be reached with them"),
    ("keep", "Keep", "Keep seams, with more triangles if necessary"),
    ("drop", "Drop", "Drop texture coordinates"),
)
SURFACES = (
    ("auto", "Auto", "Closed or open, whichever fits the mesh"),
    ("closed", "Closed", "Fill all holes"),
    ("open", "Open", "Keep open boundaries"),
)


def size() -> Any:
    """Return the property that all sizes of textures share."""
    return IntProperty(
        name="Size", default=1024, min=16, max=16384, description="Side of the texture in texels"
    )


def padding() -> Any:
    """Return the property that all paddings share."""
    return IntProperty(
        name="Padding", default=4, min=0, max=256,
        description="Width in texels around each UV island that is filled with its colors",
    )  # fmt: skip


def distance(name: str, text: str) -> Any:
    """Return the property of a distance along rays."""
    return FloatProperty(
        name=name, default=0.0, min=0.0, subtype="DISTANCE", unit="LENGTH", precision=4,
        description=f"{text}; 0: chosen at each vertex from the meshes",
    )  # fmt: skip


class BakeSettings:
    """How maps are baked."""

    maps: EnumProperty(
        name="Maps",
        items=MAPS,
        options={"ENUM_FLAG"},
        default={"normal"},
        description="Maps to bake",
    )
    size: size()
    samples: EnumProperty(name="Samples", items=SAMPLES, default="1", description="Rays per texel")
    padding: padding()
    target: EnumProperty(
        name="Target", items=TARGETS, description="Program that the images are for"
    )
    cage: StringProperty(
        name="Cage", description="Mesh where rays start: the active mesh, moved outwards"
    )
    front: distance("Front", "Distance outside the active object at which rays start")
    back: distance("Back", "Distance inside the active object at which rays end")
    rays: IntProperty(
        name="Occlusion Rays", default=64, min=1, max=4096,
        description="Rays per texel for ambient occlusion, bent normals and thickness, rounded to "
        "a power of two",
    )  # fmt: skip
    save: EnumProperty(name="Images", items=SAVE, description="Where the images are stored")
    wire: BoolProperty(
        name="Link to Material", default=True,
        description="Show the maps in the materials of the active object",
    )  # fmt: skip


class UnwrapSettings:
    """How texture coordinates are made."""

    size: size()
    padding: padding()
    quality: EnumProperty(name="Quality", items=UNWRAP_QUALITIES, default="good")
    seams: EnumProperty(name="Seams", items=SEAMS)
    sharp: BoolProperty(
        name="Sharp Edges", default=False,
        description="Also cut at edges that are marked as sharp",
    )  # fmt: skip
    uv_map: StringProperty(
        name="UV Map",
        description="UV map to write, created if it is missing; empty: the active one",
    )


class SimplifySettings:
    """How many triangles are left."""

    faces: IntProperty(
        name="Triangles", default=0, min=0, soft_max=1_000_000,
        description="Number of triangles to reach; 0: use the ratio",
    )  # fmt: skip
    ratio: FloatProperty(
        name="Ratio", default=0.1, min=0.0001, max=1.0, subtype="FACTOR",
        description="Share of the triangles to keep",
    )  # fmt: skip
    quality: EnumProperty(name="Quality", items=QUALITIES, default="best")
    seams: EnumProperty(name="UV Seams", items=UV_SEAMS, default="auto")


class RemeshSettings:
    """How a surface is wrapped."""

    resolution: IntProperty(
        name="Resolution", default=256, min=8, max=1024,
        description="Voxels along the longest side of the mesh",
    )  # fmt: skip
    surface: EnumProperty(name="Surface", items=SURFACES, default="auto")
    close: FloatProperty(
        name="Close Gaps", default=1.0, min=0.0, max=100.0, subtype="PERCENTAGE",
        description="Width of gaps that are closed, as a share of the diagonal",
    )  # fmt: skip
    sharp_edges: BoolProperty(
        name="Sharp Edges", default=False, description="Keep corners and edges sharp"
    )
    faces: IntProperty(
        name="Triangles", default=0, min=0, soft_max=1_000_000,
        description="Number of triangles to simplify the result to; 0: do not simplify it",
    )  # fmt: skip


class LightenSettings:
    """How small a textured model is made."""

    faces: IntProperty(
        name="Triangles", default=0, min=0, soft_max=1_000_000,
        description="Number of triangles to reach; 0: a tenth, but at least 5,000",
    )  # fmt: skip
    size: IntProperty(
        name="Size", default=0, min=0, max=16384,
        description="Side of the images in texels; 0: as large as the images of the model need",
    )  # fmt: skip


class CheckSettings:
    """What a bake is checked for."""

    size: size()
    padding: padding()


GROUPS = {
    "bake": BakeSettings, "unwrap": UnwrapSettings, "simplify": SimplifySettings,
    "remesh": RemeshSettings, "lighten": LightenSettings, "check": CheckSettings,
}  # fmt: skip
# What the panel edits.
_PANELS = {
    name: type(f"Texbake{name.title()}", (group, bpy.types.PropertyGroup), {})
    for name, group in GROUPS.items()
}


class TexbakeSettings(bpy.types.PropertyGroup):
    """The settings of the panel that a scene stores, by the names of the operators."""

    __annotations__ = {name: PointerProperty(type=panel) for name, panel in _PANELS.items()}


CLASSES = (*_PANELS.values(), TexbakeSettings)
