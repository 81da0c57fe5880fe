"""Every choice of exporting an asset, with its default, written once."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError

TARGETS = ("blender", "unreal", "unity", "godot", "threejs")
TEXTURES = ("png", "dds")
MESH_FORMATS = ("glb", "obj", "usda", "usdc", "usdz")
CONVENTIONS = ("opengl", "directx")
UPS = ("y", "z")


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """What `export_asset` does where the caller does not say otherwise.

    Attributes
    ----------
    target : str
        The program that the folder is for: `blender`, `unreal`, `unity`, `godot` or `threejs`.
    name : str, optional
        Of the asset, which file names begin with. None: that of the mesh's file.
    mesh_format : str, optional
        `glb`, `obj`, `usda`, `usdc` or `usdz`. None: what the target reads best.
    textures : str
        `png`, or `dds` for block-compressed textures with mip levels, where the target takes them.
    up : str
        Axis of the mesh that is up: `y` or `z`. Files are written as their format has it.
    meters_per_unit : float
        Meters of a model unit, such as 0.01 for a mesh in centimeters.
    convention : str
        Green channel of normal maps that do not say it themselves: `opengl` or `directx`.
    compress : bool
        Code a GLB by EXT_meshopt_compression.
    layers : bool
        Also write all maps as the layers of one EXR file, as they were given.
    threads : int, optional
        None: every processor.
    """

    target: str
    name: str | None = None
    mesh_format: str | None = None
    textures: str = "png"
    up: str = "y"
    meters_per_unit: float = 1.0
    convention: str = "opengl"
    compress: bool = False
    layers: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        for option, value, known in (
            ("target", self.target, TARGETS),
            ("textures", self.textures, TEXTURES),
            ("up", self.up, UPS),
            ("convention", self.convention, CONVENTIONS),
            ("mesh_format", self.mesh_format, (None, *MESH_FORMATS)),
        ):
            if value not in known:
                words = ", ".join(word for word in known if word is not None)
                raise OptionError(f"{option}: {value!r} is not known; it is one of {words}")
        if not 0.0 < self.meters_per_unit < math.inf:
            raise OptionError(f"meters_per_unit: {self.meters_per_unit} is no length above 0")
        if self.name is not None and (not self.name.strip() or set(self.name) & set("/\\\0")):
            raise OptionError(f"name: {self.name!r} is no name of a file; leave out slashes")
