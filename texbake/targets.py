"""What each program expects of an asset: one table for `run --preset`, `export --to` and `check`.

Based on: what Blender 5.0.1 and three.js r187 show of exported files, and what is generally known
of Unreal Engine 5, Unity (URP and HDRP) and Godot 4; the limits of glTF files on the web are those
that the Khronos Group recommends: Real-time Asset Creation Guidelines, 2020.
"""

from __future__ import annotations

from dataclasses import field, replace

from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What an asset should not exceed; None for no limit."""

    triangles: int | None = None
    texture: int = 4096  # texels per side of an image
    texels_per_meter: float | None = None  # at least, on average over the surface
    n_bytes: int | None = None  # of a file with its images


@dataclass(frozen=True, kw_only=True)
class Target:
    """What a program expects of an asset."""

    title: str  # its name
    axes: str  # its up axis and unit, and how its importer treats them
    tangents: str  # where its tangent basis comes from
    mesh_format: str = "glb"  # the format that it reads best without an extension
    # Patterns of file names.
    mesh_name: str = "{asset}"
    map_name: str = "{asset}_{map}"
    # The program's words for maps in file names, where they differ.
    words: dict[str, str] = field(default_factory=dict)
    # Separator before the number of a UDIM tile; empty if it does not support tiles.
    tile_mark: str = ""
    convention: str = "opengl"  # green channel of normal maps: `opengl` or `directx`
    normal_bits: int = 8  # bits per channel that it keeps of a normal map
    # `float`: heights in meters, as EXR; or `codes`: 16-bit PNG with a mid level.
    heights: str = "codes"
    # `orm`, `mask-map` or None: the map into which occlusion, roughness and metalness are packed.
    packing: str | None = "orm"
    embeds: bool = True  # whether the mesh file contains the material with its images
    textures: tuple[str, ...] = ("png",)  # texture formats that it reads
    # Texels per side of a map, and its padding at that size.
    size: int = 2048
    padding: int = 8
    limits: Limits = Limits()
    reads_meshopt: bool = False  # whether it reads meshes compressed by EXT_meshopt_compression

    def mesh_stem(self, asset: str) -> str:
        """Return the name of the mesh file without its suffix."""
        return self.mesh_name.format(asset=asset)

    def map_stem(self, asset: str, kind: str, tile: str = "") -> str:
        """Return the name of a map file without its suffix.

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
PROGRAMS["gltf-web"] = replace(
    PROGRAMS["threejs"],
    title="viewers of glTF on the web",
    size=1024,
    padding=4,
    limits=Limits(triangles=100_000, texture=2048, texels_per_meter=128.0, n_bytes=5_000_000),
)
# The files of `run` without a preset.
OWN_FILES = Target(
    title="texbake", axes="", tangents="", mesh_name="{asset}_low", mesh_format="obj",
    normal_bits=16, heights="float",
)  # fmt: skip
SETTINGS = "SETTINGS.txt"
