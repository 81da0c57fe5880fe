"""What differs between the programs that assets are exported to: one table.

Based on: what Blender 5.0.1 and three.js r187 show of exported files, and what is generally known
of Unreal Engine 5, Unity (URP and HDRP) and Godot 4. `texbake.jobs.export.settings` tells what
to set.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Target:
    """What a program expects of an asset.

    Attributes
    ----------
    title
        Its name for people.
    axes
        Its up axis and unit, and what its importer does to get there.
    tangents
        Where its tangent basis comes from.
    mesh_format
        What it reads best without an extension of its own.
    mesh_name, map_name
        Names of files, of `{asset}` and `{map}`.
    words
        What it calls a map in a file's name, where that is not our name.
    tile_mark
        What stands before the number of a UDIM tile; empty where it knows none.
    convention
        Green channel of normal maps: `opengl` or `directx`.
    normal_bits
        Most bits a channel that it keeps of a normal map.
    heights
        `float`, heights in meters as they are, in EXR; or `codes`, 16-bit PNG with a middle.
    packing
        `orm`, `mask-map`, or none: what occlusion, roughness and metalness go into.
    embeds
        Whether the mesh's file carries the material with its images.
    textures
        Formats of textures that it takes.
    reads_meshopt
        Whether it opens meshes that are coded by EXT_meshopt_compression.
    """

    title: str
    axes: str
    tangents: str
    mesh_format: str = "glb"
    mesh_name: str = "{asset}"
    map_name: str = "{asset}_{map}"
    words: dict[str, str] = field(default_factory=dict)
    tile_mark: str = ""
    convention: str = "opengl"
    normal_bits: int = 8
    heights: str = "codes"
    packing: str | None = "orm"
    embeds: bool = True
    textures: tuple[str, ...] = ("png",)
    reads_meshopt: bool = False

    def mesh_stem(self, asset: str) -> str:
        """Name of the mesh's file without its suffix."""
        return self.mesh_name.format(asset=asset)

    def map_stem(self, asset: str, kind: str, tile: str = "") -> str:
        """Name of a map's file without its suffix.

        >>> PROGRAMS["unreal"].map_stem("rock", "normal", "1002")
        'T_rock_N.1002'
        """
        stem = self.map_name.format(asset=asset, map=self.words.get(kind, kind))
        return f"{stem}{self.tile_mark or '_'}{tile}" if tile else stem


PROGRAMS = {
    "blender": Target(
        title="Blender",
        axes="Z up, meters; its glTF importer turns the file's Y up.",
        tangents="MikkTSpace, which Blender computes itself from normals and coordinates.",
        tile_mark=".",
        normal_bits=16,
        heights="float",
        packing=None,
    ),
    "unreal": Target(
        title="Unreal Engine",
        axes="Z up, centimeters, left-handed; its glTF importer turns and scales the file.",
        tangents="MikkTSpace; take the file's, or let it recompute with MikkTSpace on.",
        mesh_name="SM_{asset}",
        map_name="T_{asset}_{map}",
        words={
            "normal": "N", "base-color": "BC", "orm": "ORM", "displacement": "H", "ao": "AO",
            "roughness": "R", "metalness": "M", "emissive": "E", "opacity": "O",
            "bent-normal": "BN",
        },
        tile_mark=".",
        convention="directx",
        normal_bits=16,
        embeds=False,
    ),
    "unity": Target(
        title="Unity",
        axes="Y up, meters, left-handed; its importer mirrors x.",
        tangents="MikkTSpace, which Unity's importer computes.",
        mesh_format="obj",
        words={
            "normal": "Normal", "base-color": "BaseMap", "mask-map": "MaskMap",
            "displacement": "Height", "emissive": "Emission", "ao": "Occlusion",
            "bent-normal": "BentNormal", "opacity": "Opacity", "thickness": "Thickness",
        },
        normal_bits=16,
        packing="mask-map",
        embeds=False,
    ),
    "godot": Target(
        title="Godot",
        axes="Y up, meters, as the file is.",
        tangents="MikkTSpace, those of the file.",
        words={"base-color": "albedo", "displacement": "height", "emissive": "emission"},
        textures=("png", "dds"),
    ),
    "threejs": Target(
        title="three.js",
        axes="Y up, meters, as the file is.",
        tangents="MikkTSpace, those of the file.",
        reads_meshopt=True,
    ),
}  # fmt: skip
