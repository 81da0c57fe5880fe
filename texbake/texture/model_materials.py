"""Reading materials of model files; damaged images count as missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import texbake.mesh.materials as of_mesh
from texbake.errors import FileFormatError, first_few, shortened, warn_of
from texbake.files import PathLike
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh
from texbake.texture.image import require_whole


def read_materials(path: PathLike, mesh: MeshLike, *, variants: bool = False) -> Materials | None:
    """Read the materials of a mesh file: of OBJ with its .mtl files, glTF, FBX and USD.

    A warning names each image that is missing or damaged, and its material keeps the factors of its
    channels.

    Parameters
    ----------
    path
        The file that the mesh was read from.
    mesh
        As it was read.
    variants
        Whether to read the materials of all variants of a glTF file (KHR_materials_variants), which
        `write_mesh` writes to a GLB file. By default, materials are those shown without a variant.

    Returns
    -------
    Materials or None
        None where the format or the file has none.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is damaged, or its images have too many pixels together.
    """
    materials = of_mesh.read_materials(path, mesh)
    if materials is not None and not variants:
        materials = materials.in_variant(None)
    if materials is None or as_mesh(mesh).uvs is None:
        return materials  # no image lies on the mesh
    materials, lines = without_damaged_images(materials)
    for line in lines:
        warn_of(path, line)
    return materials


def model_materials(path: PathLike, mesh: Mesh, *, variants: bool = False) -> Materials | None:
    """Return the materials of a model file, or else its vertex colors; None if it has neither."""
    found = read_materials(path, mesh, variants=variants)
    if found is not None and mesh.uvs is None and found.has_images:
        warn_of(path, "it has no texture coordinates; its images are left out")
        found = found.without_images()
    if found is not None and any(material.channels for material in found.materials):
        return found
    if mesh.colors is None:
        return found
    return Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        # As rough as every mesh without materials, of which this is the one material.
        materials=(MeshMaterial(name=mesh.name, channels={"roughness": ChannelSource((0.5,))}),),
        has_vertex_colors=True,
        missing=() if found is None else found.missing,
        missing_images=() if found is None else found.missing_images,
    )


def without_damaged_images(materials: Materials) -> tuple[Materials, tuple[str, ...]]:
    """Return materials without images that cannot be decoded, and warnings about these."""
    reasons: dict[str, str] = {}
    lines: list[tuple[str, str]] = []
    changed = []
    for material in materials.materials:
        channels = dict(material.channels)
        for name, source in material.channels.items():
            if source.image is None or not (reason := _damage(source.image, reasons)):
                continue
            line = f"{shortened(material.name)}: {reason}; the material keeps its factors"
            lines.append((name, line))
            if name in ("normal", "occlusion"):
                del channels[name]
            else:
                channels[name] = ChannelSource(source.fallback or source.factor)
        extensions = {}
        for owner, properties in material.extensions.items():
            extensions[owner] = dict(properties)
            for key, value in properties.items():
                if isinstance(value, ChannelImage) and (reason := _damage(value, reasons)):
                    line = f"{shortened(material.name)}: {reason}; written without its {key}"
                    lines.append((key, line))
                    del extensions[owner][key]
        changed.append(replace(material, channels=channels, extensions=extensions))
    damaged = [Path(name).name for name, reason in reasons.items() if reason]
    found = replace(
        materials,
        materials=tuple(changed),
        missing=(*materials.missing, *lines),
        missing_images=(*materials.missing_images, *damaged),
    )
    return found, first_few(line for _, line in lines)


def _damage(image: ChannelImage, known: dict[str, str]) -> str:
    """Return why an image cannot be decoded, "" if it can; `known` keeps the answers."""
    if image.name not in known:
        try:
            require_whole(image.data, image.name)
            known[image.name] = ""
        except FileFormatError as error:
            known[image.name] = str(error)
    return known[image.name]
