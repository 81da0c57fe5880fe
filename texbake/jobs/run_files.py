"""The files of `run`: their names for the program that reads them, and how they are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.result import BakedMap, BakeResult, WrittenMap
from texbake.files import PathLike, check_writable, make_folder, replacing, scratch_folder
from texbake.jobs.export.imports import write_imports
from texbake.jobs.export.maps import PACKED, Converter, SourceMap
from texbake.jobs.export.programs import (
    ExportedMap,
    ExportOptions,
    check_asset_name,
    write_settings,
)
from texbake.jobs.material_transfer import (
    channels_of_images,
    encoded_channels,
    image_names,
    image_of,
    shared_materials,
)
from texbake.jobs.options import RunOptions
from texbake.mesh.files import write_mesh
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import ChannelSource, Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import with_shading_normals
from texbake.metadata import DISPLACEMENT_MID, DISPLACEMENT_SCALE
from texbake.progress import Progress, Stages
from texbake.texture.encoding import decode_srgb


def files_of_levels(
    folder: PathLike, high: Mesh, channels: Sequence[str], options: RunOptions
) -> list[dict[str, Path]]:
    """Return the files of each level of detail by their keys, the finest first."""
    folder, asset = make_folder(folder), Path(high.name).stem or "mesh"
    if options.preset is not None:
        check_asset_name(asset)
    images = image_names(channels)
    files = [
        {key: folder / file for key, file in names.items()}
        for names in options.names_of_levels(asset, images)
    ]
    for path in (path for named in files for path in named.values()):
        check_writable(path)
    return files


def mesh_name(files: Mapping[str, Path]) -> str:
    """Return the name of the file of the mesh."""
    return (files.get("mesh") or files["glb"]).name


def coded_map(baked: BakeResult, name: str, options: RunOptions) -> BakedMap:
    """Return a map with the bits per channel of its file."""
    made = baked.maps[name]
    if name != "normal":
        return made
    return replace(made, options=replace(made.options, bits=options.chosen("bits")))


def write_asset(
    baked: BakeResult,
    meshes: tuple[Mesh, Mesh],
    materials: Materials | None,
    files: dict[str, Path],
    options: RunOptions,
    progress: Progress,
) -> None:
    """Write a low-poly mesh with all of its maps, given the high-poly mesh and itself."""
    _, low = meshes
    with Stages(progress).stage("write maps"):
        if "mesh" in files:
            write_mesh(with_shading_normals(low, threads=options.threads), files["mesh"])
        written = {
            name: coded_map(baked, name, options).write(files[name]) for name in options.own_maps
        }
    notes = []
    if materials is not None:
        notes = _write_materials(baked, meshes, materials, files, options)
    else:
        if "glb" in files:
            _write_plain(baked, low, files, options)
        if options.packs_occlusion:
            notes = _pack_occlusion(baked, files["orm"], options)
    if options.preset is not None:
        _write_settings(files, written, notes, options, materials)


def _write_plain(baked: BakeResult, low: Mesh, files: dict[str, Path], options: RunOptions) -> None:
    """Write the low-poly mesh with its normal map and the base color of the options."""
    if not options.target.embeds:
        write_mesh(low, files["glb"])
        return
    # glTF normal maps are +Y whatever the user's other programs need, and have 8 bits.
    with scratch_folder() as folder:
        normal_map = folder / files["normal"].name
        baked.maps["normal"].write(normal_map, bits=8, convention="opengl")
        color = decode_srgb(np.array(options.base_color)).tolist()
        textures = {"normal_map": normal_map}
        if options.preset is not None and "ao" in files:
            textures["orm"] = folder / "orm.png"
            _pack_occlusion(baked, textures["orm"], options, packing="orm")
        write_mesh(low, files["glb"], base_color=color, **textures)


def _pack_occlusion(
    baked: BakeResult, path: Path, options: RunOptions, *, packing: str | None = None
) -> list[str]:
    """Write the occlusion into its channel of a packed map; return what the others hold."""
    with scratch_folder() as folder:
        occlusion = folder / "ao.png"
        baked.maps["ao"].write(occlusion)
        _write_packed({"ao": SourceMap("ao", "", occlusion)}, path, options, packing)
    return [f"{path.name}: only occlusion was baked; roughness is 0.5 and metalness 0."]


def _write_materials(
    baked: BakeResult,
    meshes: tuple[Mesh, Mesh],
    materials: Materials,
    files: dict[str, Path],
    options: RunOptions,
) -> list[str]:
    """Write images and mesh of materials; return what images do not say."""
    high, low = meshes
    asset, threads = Path(high.name).stem, options.threads
    # A program that reads no material from the mesh file takes every value from an image.
    images = image_names(channels_of_images(materials, embeds=options.target.embeds))
    whole = () if options.target.embeds else images
    channels = encoded_channels(baked.maps, materials, asset, threads=threads, whole=whole)
    for name in images:
        image = image_of(name, channels)
        if image is None:  # one value everywhere, which becomes a factor
            files.pop(name)
            continue
        if name == "orm" and options.target.packing == "mask-map":
            write_mask_map(image.data, files[name], options)
            continue
        with replacing(files[name]) as temporary:
            temporary.write_bytes(image.data)
    if not options.target.embeds:
        if "glb" in files:
            write_mesh(low, files["glb"])
        notes = _notes_of(channels, files)
        if options.packs_occlusion and not images:
            notes += _pack_occlusion(baked, files["orm"], options)
        return notes
    shared = shared_materials(low, high, materials, channels, asset, threads=threads)
    write_glb(low, files["glb"], materials=shared)
    return []


def _notes_of(channels: Mapping[str, ChannelSource], files: Mapping[str, Path]) -> list[str]:
    notes = []
    if "alpha" in channels and "base_color" in files:
        notes.append(f"{files['base_color'].name}: its alpha channel is the opacity.")
    if "emissive" in channels and max(channels["emissive"].factor) > 1.0:
        factor = max(channels["emissive"].factor)
        notes.append(f"{files['emissive'].name}: multiply it by {factor:.6g}.")
    return notes


def write_mask_map(orm: bytes, path: Path, options: RunOptions) -> None:
    """Write the channels of an ORM image as Unity packs them."""
    with scratch_folder() as folder:
        image = folder / "orm.png"
        image.write_bytes(orm)
        parts = {
            kind: SourceMap(kind, "", image, channel) for channel, kind in enumerate(PACKED["orm"])
        }
        _write_packed(parts, path, options)


def _write_packed(
    parts: Mapping[str, SourceMap], path: Path, options: RunOptions, packing: str | None = None
) -> None:
    """Write maps as the channels of one image, as the program packs them."""
    converter = Converter(folder=path.parent, asset=path.stem, options=_export_options(options))
    converter.write_packed(parts, packing or str(options.target.packing), path)


def _export_options(options: RunOptions) -> ExportOptions:
    assert options.preset is not None
    return ExportOptions(to=options.preset, threads=options.threads)


def _write_settings(
    files: dict[str, Path],
    written: Mapping[str, WrittenMap],
    notes: list[str],
    options: RunOptions,
    materials: Materials | None,
) -> None:
    """Write import files, and with those of the finest level the settings of all levels."""
    maps, convention = [], options.chosen("convention")
    modes = {item.alpha_mode for item in materials.materials} if materials is not None else ()
    alpha = next((mode for mode in ("blend", "mask") if mode in modes), "opaque")
    for name, found in written.items():
        keys = {"mid": DISPLACEMENT_MID, "scale": DISPLACEMENT_SCALE}
        heights: dict[str, Any] = {
            word: float(found.metadata[key]) for word, key in keys.items() if key in found.metadata
        }
        flips = name in ("normal", "bent-normal") and convention != options.target.convention
        # A material of the model has its own occlusion, or none.
        kind = f"baked-{name}" if name == "ao" and materials is not None else name
        maps.append(ExportedMap(kind=kind, tile="", path=files[name], flips=flips, **heights))
    packing = options.target.packing
    for name in ("base_color", "orm", "emissive"):
        if name in files:
            kind = (packing or name) if name == "orm" else name.replace("_", "-")
            own_alpha = alpha if name == "base_color" else "opaque"
            maps.append(ExportedMap(kind=kind, tile="", path=files[name], alpha=own_alpha))
    mesh_file = files.get("glb") or files["mesh"]
    asset = mesh_file.stem.removeprefix(options.target.mesh_name.removesuffix("{asset}"))
    folder, exported = mesh_file.parent, replace(_export_options(options), name=asset)
    counts = (options.levels or ()) if "settings" in files else ()
    levels = [f"{asset}_lod{number}" for number, _ in enumerate(counts, 1)]
    imports = write_imports(folder, exported, mesh_file, maps, levels)
    if convention != options.target.convention:
        notes.append(f"{files['normal'].name}: green is {convention}, as you chose it.")
    for number, path in enumerate(imports):
        files[f"import{number or ''}"] = path
    if "settings" not in files:
        return
    own = "maps and import files" if imports else "maps"
    remedy = "The script adds it" if options.preset == "unreal" else "Set it up as the finest"
    for level, n_faces in zip(levels, counts, strict=True):
        name = options.target.mesh_stem(level) + mesh_file.suffix
        notes.append(
            f"{name}: the level of detail of {n_faces:,} triangles. {remedy}; it has its own "
            f"{own}, with {level.removeprefix(f'{asset}_')} in their names."
        )
    write_settings(folder, exported, mesh_file, maps, imports, notes=notes)
