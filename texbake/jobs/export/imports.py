"""Files that import an asset: scripts for Unreal and Unity, settings for Godot, a MaterialX file.

Based on: Unreal Engine 5's Python API; Unity 2022's AssetPostprocessor; the `.import` files of
Godot 4, which reads their `params` when it first imports the file beside them.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from pprint import pformat
from string import Template

from texbake.files import make_folder, replacing
from texbake.jobs.export.programs import ExportedMap, ExportOptions
from texbake.mesh.files.openpbr import materialx_document, openpbr_nodes
from texbake.targets import PROGRAMS

_MASKS = ("TC_MASKS", "SAMPLERTYPE_MASKS")
_COLOR = ("TC_DEFAULT", "SAMPLERTYPE_COLOR")
# By kinds of maps: compression and sampler of Unreal, and places of the sampler's outputs.
_UNREAL: dict[str, tuple[tuple[str, str], dict[str, str]]] = {
    "normal": (("TC_NORMALMAP", "SAMPLERTYPE_NORMAL"), {"RGB": "MP_NORMAL"}),
    "base-color": (_COLOR, {"RGB": "MP_BASE_COLOR"}),
    "emissive": (_COLOR, {"RGB": "MP_EMISSIVE_COLOR"}),
    "orm": (_MASKS, {"R": "MP_AMBIENT_OCCLUSION", "G": "MP_ROUGHNESS", "B": "MP_METALLIC"}),
    "opacity": (_MASKS, {"R": "MP_OPACITY_MASK"}),
    "displacement": (("TC_GRAYSCALE", "SAMPLERTYPE_LINEAR_GRAYSCALE"), {}),
    "bent-normal": (("TC_NORMALMAP", "SAMPLERTYPE_NORMAL"), {}),
}
# By alpha modes: the place of the fourth channel.
_UNREAL_ALPHA = {"mask": {"A": "MP_OPACITY_MASK"}, "blend": {"A": "MP_OPACITY"}}
# Names in Unity's shaders, and the keywords that switch them on.
_UNITY = {
    "normal": (("_NormalMap", "_BumpMap"), ("_NORMALMAP",)),
    "base-color": (("_BaseColorMap", "_BaseMap", "_MainTex"), ()),
    "mask-map": (
        ("_MaskMap", "_MetallicGlossMap", "_OcclusionMap"),
        ("_MASKMAP", "_METALLICSPECGLOSSMAP", "_METALLICGLOSSMAP", "_OCCLUSIONMAP"),
    ),
    "emissive": (("_EmissiveColorMap", "_EmissionMap"), ("_EMISSION",)),
    "bent-normal": (("_BentNormalMap",), ("_BENTNORMALMAP",)),
    "thickness": (("_ThicknessMap",), ("_THICKNESSMAP",)),
}
_UNITY_MASK = ["_AlphaClip", "_AlphaCutoffEnable", "_Mode"]  # 1 cuts out by alpha
_COLORS, _NORMALS = ("base-color", "emissive"), ("normal", "bent-normal")


def write_imports(
    folder: Path,
    options: ExportOptions,
    mesh_file: Path,
    maps: Sequence[ExportedMap],
    levels: Sequence[str] = (),
) -> list[Path]:
    """Write the files that import an asset and its `levels` into a program; return their paths."""
    asset = options.name or mesh_file.stem
    own = [written for written in maps if written.tile in ("", "1001")]
    texts: dict[str, str] = {}
    if options.to == "unreal":
        texts[_unreal_name(asset)] = _unreal_script(asset, mesh_file, own, levels)
    elif options.to == "unity":
        texts[f"Editor/{_identifier(asset)}Import.cs"] = _unity_script(asset, mesh_file, own)
    elif options.to == "godot":
        # Godot loads .dds files as they are.
        imported = [each for each in own if each.path.suffix != ".dds"]
        texts = {f"{each.path.name}.import": _godot_preset(each) for each in imported}
    if options.materialx and maps:
        texts[f"{asset}.mtlx"] = _material_of(asset, maps, PROGRAMS[options.to].convention)
    for name, text in texts.items():
        make_folder((folder / name).parent)
        with replacing(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def _identifier(name: str) -> str:
    """ASCII letters, digits and underscores, with a checksum of names in other characters."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name)
    word = word if word[:1].isalpha() else f"A{word}"
    return word if word == name else f"{word}_{zlib.crc32(name.encode()):08x}"


def _template(name: str) -> Template:
    return Template((Path(__file__).parent / "templates" / name).read_text(encoding="utf-8"))


def _in_comment(text: str) -> str:
    return re.sub(r"[^\w .()-]", "_", text)


def _unreal_name(asset: str) -> str:
    return f"import_{asset}.py"


def _unreal_script(
    asset: str, mesh_file: Path, maps: Sequence[ExportedMap], levels: Sequence[str]
) -> str:
    textures = {}
    for written in maps:
        (compression, sampler), places = _UNREAL.get(written.kind, (_MASKS, {}))
        textures[written.path.name] = (
            *(written.kind in _COLORS, written.flips), compression, sampler,
            places | _UNREAL_ALPHA.get(written.alpha, {}),
        )  # fmt: skip
    return _template("unreal.py.txt").substitute(
        asset=_in_comment(asset), identifier=_identifier(asset), mesh=repr(mesh_file.name),
        textures=pformat(textures, width=96, sort_dicts=False),
        levels=[_unreal_name(level) for level in levels],
    )  # fmt: skip


def _unity_script(asset: str, mesh_file: Path, maps: Sequence[ExportedMap]) -> str:
    known = [(written, _UNITY[written.kind]) for written in maps if written.kind in _UNITY]

    def listed(names: Sequence[str]) -> str:
        return ", ".join(json.dumps(name) for name in names)  # C# has the same escapes

    is_mask = any(written.alpha == "mask" for written in maps)
    return _template("unity.cs.txt").substitute(
        asset=_in_comment(asset), identifier=_identifier(asset), mesh=json.dumps(mesh_file.name),
        flips=str(any(m.flips for m in maps)).lower(),
        normals=listed([m.path.name for m in maps if m.kind in _NORMALS]),
        data=listed([m.path.name for m in maps if m.kind not in (*_NORMALS, *_COLORS)]),
        textures=", ".join(
            f"new[] {{ {listed([m.path.name, *names])} }}" for m, (names, _) in known
        ),
        keywords=listed(
            [word for _, (_, words) in known for word in words] + is_mask * ["_ALPHATEST_ON"]
        ),
        ones=listed(["_Smoothness", "_GlossMapScale", *(is_mask * _UNITY_MASK)]),
    )  # fmt: skip


def _godot_preset(written: ExportedMap) -> str:
    """Return import settings: two channels for normals, no compression for heights, mip maps."""
    is_heights = written.kind == "displacement"
    values = {
        "compress/mode": 0 if is_heights else 2,
        "compress/normal_map": 1 if written.kind in _NORMALS else 2,
        "process/normal_map_invert_y": str(written.flips).lower(),
        "mipmaps/generate": "true",
        "detect_3d/compress_to": 0,
    }
    lines = "\n".join(f"{key}={value}" for key, value in values.items())
    return f'[remap]\n\nimporter="texture"\ntype="CompressedTexture2D"\n\n[params]\n\n{lines}\n'


def _of_all_tiles(written: ExportedMap) -> str:
    """Return the name of a map's file, with MaterialX's word for the number of its tile."""
    if not written.tile:
        return written.path.name
    before, _, after = written.path.name.rpartition(written.tile)
    return f"{before}<UDIM>{after}"


def _material_of(asset: str, maps: Sequence[ExportedMap], convention: str) -> str:
    heights = next((each for each in maps if each.kind == "displacement"), None)
    nodes = openpbr_nodes(
        {each.kind: _of_all_tiles(each) for each in maps},
        convention=convention,
        mid=0.0 if heights is None else heights.mid,
        scale=1.0 if heights is None else heights.scale,
    )
    return materialx_document(nodes, _identifier(asset))
