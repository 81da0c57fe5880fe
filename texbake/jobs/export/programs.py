"""What to set in each of the programs that assets are exported to.

Based on: what Blender 5.0.1 and three.js r187 show of exported files, and what is generally known
of Unreal Engine 5, Unity (URP and HDRP) and Godot 4.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from texbake.baking.options import CONVENTIONS
from texbake.errors import OptionError, quoted
from texbake.files import replacing
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, CheckedOptions, Option, option
from texbake.targets import PROGRAMS, SETTINGS


@dataclass(frozen=True, kw_only=True)
class ExportedMap:
    """A map in the exported folder."""

    kind: str  # `orm` or `mask-map` for a packed map
    tile: str  # number of its UDIM tile; empty without one
    path: Path
    mid: float = 0.0  # of heights: the value at the surface
    scale: float = 1.0  # of heights: meters from black to white; 1 in a float file
    flips: bool = False  # of a normal map: whether green points opposite to the program's
    alpha: str = "opaque"  # of a base color: the alpha mode of its fourth channel


TEXTURES = ("png", "dds")
MESH_FORMATS = ("glb", "obj", "usda", "usdc", "usdz")
UPS = ("y", "z")
# Maps that have a place in a program's material; all others are copied.
KINDS = ("normal", "displacement", "base-color", "ao", "roughness", "metalness", "emissive",
         "opacity", "bent-normal")  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ExportOptions(CheckedOptions):
    """How `export_asset` writes an asset for another program."""

    to: Annotated[str, Option("Program that reads the files.", choices=tuple(PROGRAMS))]
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
    materialx: bool = option(
        False, "Also write the material as a MaterialX document, an OpenPBR surface."
    )
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name is not None:
            check_asset_name(self.name)


def check_asset_name(name: str) -> None:
    """Raise `OptionError` for a name that is no file name, or that no text file can hold."""
    if not name.strip() or set(name) & set("/\\"):
        raise OptionError(f"name: {quoted(name)} is not a file name; leave out slashes")
    if re.search("[\0-\x1f\x7f\ud800-\udfff]", name):
        raise OptionError(
            f"name: {quoted(name)} has control characters or is not UTF-8; give another name"
        )


# What to do with each map in each program. `{file}` is its name; for heights `{mid}` is the value
# of the surface, `{m}` and `{cm}` are black to white in meters and centimeters, `{bias}` is
# meters at black. `{held}` is filled in for maps that the mesh file contains; `{flip}` says
# whether v points up, as in all files but glTF; `{y}`, `{switch}` and `{sign}` are where green
# points, and how the program has to turn it.
_STEPS: dict[str, dict[str, str]] = {
    "blender": {
        "mesh": "File > Import > glTF 2.0: {file}.",
        "usd": "File > Import > Universal Scene Description: {file}.",
        "obj": "File > Import > Wavefront: {file}, Forward Axis -Z, Up Axis Y. It has no material; "
        "make one from the maps below.",
        "normal": "{file}: Image Texture, Color Space Non-Color -> Normal Map node, Tangent Space "
        "-> Normal of the Principled BSDF. Green is {y}; Blender needs +Y.",
        "displacement": "{file}: Image Texture, Non-Color -> Height of a Displacement node, "
        "Midlevel 0, Scale 1 -> Displacement of the Material Output. Heights are meters. Material "
        "Settings > Surface > Displacement: Displacement Only; add a Subdivision Surface modifier "
        "(Simple) or adaptive subdivision. Leave out the normal map, or its detail counts twice.",
        "base-color": "{file}: Image Texture, sRGB -> Base Color.",
        "ao": "{file}: Non-Color; multiply it with the base color if you want it.",
        "roughness": "{file}: Non-Color -> Roughness.",
        "metalness": "{file}: Non-Color -> Metallic.",
        "emissive": "{file}: sRGB -> Emission Color, Emission Strength 1.",
        "opacity": "{file}: Non-Color -> Alpha.",
        "tiles": "Image Texture > open the tile 1001 with Detect UDIMs on.",
    },
    "unreal": {
        "imports": "{file} imports the mesh and the textures and makes a material: Tools > Execute "
        "Python Script, with the plugin Python Editor Script Plugin. To do it by hand:",
        "mesh": "Import {file} (glTF), Recompute Normals and Recompute Tangents off; or "
        "recompute tangents with Use MikkTSpace on. Build Settings: Use Full Precision UVs and Use "
        "High Precision Tangent Basis on.",
        "usd": "Import {file} with the USD Importer plugin.",
        "obj": "Import {file} with an import uniform scale of 100: its unit is the meter, and the "
        "format does not say so. Recompute tangents with Use MikkTSpace on.",
        "normal": "{file}: Compression Settings Normalmap (DXT5, BC5), sRGB off. Green is {y}: "
        "turn Flip Green Channel {switch}.",
        "displacement": "{file}: Compression Settings Grayscale, sRGB off. Material > Displacement "
        "(Nanite): Magnitude {cm:.6g}, Center {mid:.6g}. For world position offset or parallax: "
        "(height - {mid:.6g}) * {cm:.6g} cm.",
        "orm": "{file}: Compression Settings Masks (no sRGB), sRGB off. R -> Ambient Occlusion, "
        "G -> Roughness, B -> Metallic.",
        "ao": "{file}: Masks, sRGB off; the red channel of the ORM map has it already.",
        "base-color": "{file}: sRGB on -> Base Color.",
        "emissive": "{file}: sRGB on -> Emissive Color.",
        "opacity": "{file}: Masks, sRGB off -> Opacity Mask; Blend Mode Masked.",
        "bent-normal": "{file}: Normalmap, sRGB off -> BentNormal material output.",
        "tiles": "Turn on Virtual Texture Support, and import the tile 1001; the others follow.",
    },
    "unity": {
        "imports": "{file}, in its folder Editor, chooses the import settings of the textures and "
        "the model when you put all files under Assets, and makes a material: Assets > texbake. To "
        "do it by hand:",
        "mesh": "Put {file} under Assets. Model: Scale Factor 1. Normals: "
        "Import; Tangents: Calculate Mikktspace. Materials: None; make one from the maps below.",
        "usd": "Import {file} with the package com.unity.importer.usd, or export again as obj.",
        "glb": "Put {file} under Assets, with the package com.unity.cloud.gltfast installed.",
        "normal": "{file}: Texture Type Normal map, Create from Grayscale off, Flip Green Channel "
        "{switch} (green is {y}) -> Normal Map, scale 1.",
        "displacement": "{file}: sRGB off, Format R 16 bit. HDRP: Height Map, Displacement Mode "
        "Vertex or Pixel, Parametrization Amplitude, Base {mid:.6g}, Amplitude {cm:.6g} (cm).",
        "mask-map": "{file}: sRGB off. HDRP: Mask Map. URP: Metallic Map with Source Metallic "
        "Alpha and Smoothness 1, and the same file as Occlusion Map (its green channel).",
        "ao": "{file}: sRGB off; the green channel of the mask map has it already.",
        "base-color": "{file}: sRGB on -> Base Map.",
        "emissive": "{file}: sRGB on -> Emission.",
        "opacity": "{file}: put it into the alpha channel of the base map, and set Alpha Clipping.",
        "bent-normal": "{file}: Normal map, HDRP: Bent Normal Map.",
        "thickness": "{file}: sRGB off. HDRP: Thickness Map of a Translucent material.",
        "tiles": "Unity does not support UDIM tiles: use one material per tile.",
    },
    "godot": {
        "imports": "The .import files set the compression of the textures when Godot first imports "
        "them. To do it by hand:",
        "mesh": "Put {file} into the project. Tangents are those of the file.",
        "usd": "Godot does not read USD; export again as glb.",
        "obj": "Put {file} into the project. It has no material; make one from the maps below.",
        "normal": "{file}: Import > Compress > Normal Map: Enable. StandardMaterial3D > Normal Map "
        "Enabled, Scale 1. Green is {y}: turn Normal Map Invert Y {switch}.",
        "orm": "{file}: ORMMaterial3D > ORM > Texture.",
        "displacement": "{file}: for parallax only. Height > Enabled, Scale {cm:.6g} (cm from "
        "black to white), Flip Texture off, Deep Parallax on. Level {mid:.6g} is the surface.",
        "ao": "{file}: {held}Ambient Occlusion > Texture, Channel Red.",
        "base-color": "{file}: Albedo > Texture.",
        "emissive": "{file}: Emission Enabled > Texture.",
        "opacity": "{file}: put it into the alpha of the albedo, Transparency Alpha Scissor.",
        "tiles": "Godot does not support UDIM tiles: use one surface and material per tile.",
    },
    "threejs": {
        "mesh": "new GLTFLoader().loadAsync('{file}').",
        "usd": "new USDLoader().loadAsync('{file}'); the .glb keeps more.",
        "obj": "new OBJLoader().loadAsync('{file}'). It has no material: assign the maps yourself.",
        "normal": "{file}: {held}texture.flipY = {flip}, colorSpace = "
        "NoColorSpace; material.normalMap, normalScale (1, {sign}), geometry with tangents.",
        "orm": "{file}: {held}flipY = {flip}, NoColorSpace; aoMap, "
        "roughnessMap and metalnessMap are all this texture, roughness and metalness 1.",
        "displacement": "{file}: flipY = {flip}, NoColorSpace; material.displacementMap, "
        "displacementScale = {m:.9g}, displacementBias = {bias:.9g}. Browsers keep 8 bits of it; "
        "it moves vertices alone, so give the mesh enough of them.",
        "ao": "{file}: {held}flipY = {flip}, NoColorSpace; aoMap.",
        "base-color": "{file}: {held}flipY = {flip}, SRGBColorSpace; map.",
        "emissive": "{file}: {held}flipY = {flip}, SRGBColorSpace; emissiveMap, emissive white.",
        "opacity": "{file}: flipY = {flip}, NoColorSpace; material.alphaMap, alphaTest 0.5.",
        "tiles": "three.js has no UDIM tiles: use one material per tile.",
    },
    "gltf-web": {
        "mesh": "Open {file} in any viewer of glTF 2.0.",
        "usd": "{file}: viewers of glTF do not read USD; export again as glb.",
        "obj": "{file}: viewers of glTF do not read OBJ; export again as glb.",
        "normal": "{file}: {held}normalTexture, scale 1. Green is {y}; glTF needs +Y.",
        "orm": "{file}: {held}metallicRoughnessTexture and occlusionTexture, factors 1.",
        "ao": "{file}: {held}occlusionTexture, strength 1.",
        "base-color": "{file}: {held}baseColorTexture.",
        "emissive": "{file}: {held}emissiveTexture, emissiveFactor 1.",
        "displacement": "{file}: glTF has no displacement; the normal map shows the detail. White "
        "is {m:.6g} m above black; level {mid:.6g} is the surface ({cm:.6g} cm from black to "
        "white).",
        "tiles": "glTF has no UDIM tiles: use one material per tile.",
    },
}
_MESHOPT = "It is compressed: loader.setMeshoptDecoder(MeshoptDecoder) before it is loaded."
# Maps that the material in a mesh file has.
_IN_MATERIAL = {
    "base-color": "base color", "normal": "normal map", "orm": "ORM", "ao": "occlusion",
    "roughness": "roughness", "metalness": "metalness", "emissive": "emissive",
}  # fmt: skip
_HELD = "in the GLB already. By hand: "
_OTHER = "{file}: data, sRGB off; no place of its own in the material."


def write_settings(
    folder: Path,
    options: ExportOptions,
    mesh_file: Path,
    maps: Sequence[ExportedMap],
    imports: Sequence[Path],
    *,
    n_levels: int = 1,
    notes: Sequence[str] = (),
) -> Path:
    """Write what to set in a program, or which `imports` do it, and return the path."""
    target, steps = PROGRAMS[options.to], _STEPS[options.to]
    flips = any(written.flips for written in maps)
    is_up = (target.convention == "opengl") != flips
    is_glb, has_imports = mesh_file.suffix == ".glb", bool(imports) and "imports" in steps
    holds = is_glb and target.embeds and not any(written.tile for written in maps)
    lines = [
        f"{mesh_file.stem} for {target.title}",
        "",
        f"Axes      {target.axes}",
        f"Tangents  {target.tangents}",
        f"Green     {'+Y (OpenGL)' if is_up else '-Y (DirectX)'}",
        "",
        *([steps["imports"].format(file=imports[0].name), ""] if has_imports else []),
        "Mesh",
        f"  {_mesh_step(steps, mesh_file)}",
    ]
    kinds = {written.kind for written in maps}
    held = [name for kind, name in _IN_MATERIAL.items() if kind in kinds]
    if holds and held:
        lines.append(f"  Its material already has: {', '.join(held)}.")
    if options.compress:
        lines.append(f"  {_MESHOPT}")
    if n_levels > 1:
        lines.append(
            f"  It holds {n_levels} levels of detail (MSFT_lod); a reader without support for them "
            "shows the finest."
        )
    lines += ["", "Maps"] if maps else []
    words = {"held": _HELD if holds else "", "flip": "false" if is_glb else "true"}
    words |= {"y": "+Y" if is_up else "-Y", "switch": "on" if flips else "off"}
    words["sign"] = "-1" if flips else "1"
    lines += [f"  {_map_step(steps, written, words)}" for written in maps]
    if any(written.tile for written in maps):
        lines.append(f"  UDIM: {steps['tiles']}")
    if notes:
        lines += ["", "Notes", *(f"  {note}" for note in notes)]
    path = folder / SETTINGS
    with replacing(path) as temporary:
        temporary.write_text("".join(f"{_wrapped(line)}\n" for line in lines), encoding="utf-8")
    return path


def _wrapped(line: str) -> str:
    """Return a line as a paragraph with a hanging indent."""
    return textwrap.fill(
        line, 96, subsequent_indent=" " * 10, break_long_words=False, break_on_hyphens=False
    )  # so that names of files stay whole


def _mesh_step(steps: dict[str, str], mesh_file: Path) -> str:
    suffix = mesh_file.suffix[1:]
    kind = "usd" if suffix.startswith("usd") else suffix
    return steps.get(kind, steps["mesh"]).format(file=mesh_file.name)


def _map_step(steps: dict[str, str], written: ExportedMap, words: dict[str, str]) -> str:
    return steps.get(written.kind, _OTHER).format(
        file=written.path.name,
        mid=written.mid,
        m=written.scale,
        cm=100.0 * written.scale,
        bias=-written.mid * written.scale,
        **words,
    )
