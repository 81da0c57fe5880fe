"""Every option of `export_asset`, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.baking.options import CONVENTIONS, THREADS_OPTION
from texbake.errors import OptionError, quoted
from texbake.schema import CheckedOptions, Option, option

TARGETS = ("blender", "unreal", "unity", "godot", "threejs")
TEXTURES = ("png", "dds")
MESH_FORMATS = ("glb", "obj", "usda", "usdc", "usdz")
UPS = ("y", "z")
# Maps that have a place in a program's material; all others are copied.
KINDS = ("normal", "displacement", "base-color", "ao", "roughness", "metalness", "emissive",
         "opacity", "bent-normal")  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ExportOptions(CheckedOptions):
    """How `export_asset` writes an asset for another program."""

    to: Annotated[str, Option("Program that reads the files.", choices=TARGETS)]
    name: str | None = option(
        None,
        "Name of the asset, which file names begin with.",
        metavar="NAME",
        default="the mesh file's name",
    )
    mesh_format: str | None = option(
        None, "Format of the mesh.", choices=MESH_FORMATS, default="what the program reads best"
    )
    textures: str = option(
        "png",
        "Format of the textures; dds is block-compressed with mip levels, for Godot.",
        choices=TEXTURES,
    )
    up: str = option("y", "Axis of the mesh that points up.", choices=UPS)
    meters_per_unit: float = option(
        1.0,
        "Length of a model unit, such as 0.01 for a mesh in centimeters.",
        metavar="M",
        above=0,
        unit="meters",
    )
    convention: str = option(
        "opengl",
        "Green channel of normal maps whose files do not say it: +Y up (opengl) or +Y down "
        "(directx).",
        choices=CONVENTIONS,
    )
    compress: bool = option(
        False, "Compress a GLB file with meshoptimizer (EXT_meshopt_compression)."
    )
    layers: bool = option(False, "Also write all maps, unchanged, as the layers of one EXR file.")
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name is not None and (not self.name.strip() or set(self.name) & set("/\\\0")):
            raise OptionError(f"name: {quoted(self.name)} is not a file name; leave out slashes")
