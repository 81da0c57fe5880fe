"""Writing OBJ files with their materials: a .mtl file and images beside them.

`mtl` reads back what is written here. A channel is its image or its factor, never both, and an
image has one channel in it, as `texbake.texture.mtl_images` makes it.

Based on: Wavefront Technologies, "MTL material format", 1995; Dirk Guenther, "MTL extension for
physically based rendering", Clara.io, 2015.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from texbake.files import PathLike, appearing_together, replacing
from texbake.mesh.files.mtl import IMAGES, VALUES
from texbake.mesh.files.obj_write import plain_name, write_obj
from texbake.mesh.materials import ChannelImage, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh

MTL_CHANNELS = tuple(dict.fromkeys([*VALUES.values(), *IMAGES.values()]))
"""Channels that .mtl files have."""
# As programs write them; `mtl` reads them in any case.
_SPELLINGS = {
    "kd": "Kd", "ke": "Ke", "d": "d", "pr": "Pr", "pm": "Pm", "map_kd": "map_Kd",
    "map_ke": "map_Ke", "map_d": "map_d", "map_pr": "map_Pr", "map_pm": "map_Pm", "norm": "norm",
}  # fmt: skip


@appearing_together()
def write_obj_materials(mesh: Mesh, path: PathLike, materials: Materials) -> tuple[Path, ...]:
    """Write an OBJ file, its .mtl file and their images; return the paths of all.

    If one of them cannot be written, none is. Only the channels of `MTL_CHANNELS` are written.
    """
    path = Path(path)
    library = path.with_suffix(".mtl")
    names = _unique_names(materials)
    images = _image_names(materials, path.stem)
    lines: list[str] = []
    for name, material in zip(names, materials.materials, strict=True):
        lines += [f"newmtl {name}", *_statements(material, images), ""]
    contents = {path.with_name(file): data for data, file in images.items()}
    contents[library] = "\n".join(lines).encode("utf-8", "replace")
    for file, content in contents.items():
        with replacing(file) as temporary:
            temporary.write_bytes(content)
    write_obj(
        mesh,
        path,
        library=library.name,
        face_materials=materials.face_materials,
        material_names=names,
    )
    return path, *contents


def _unique_names(materials: Materials) -> list[str]:
    names: list[str] = []
    for material in materials.materials:
        name = plain_name(material.name) or "material"
        number = 1
        while name in names:
            number += 1
            name = f"{plain_name(material.name) or 'material'} {number}"
        names.append(name)
    return names


def _image_names(materials: Materials, stem: str) -> dict[bytes, str]:
    """File names of images, each after the first channel that has it."""
    names: dict[bytes, str] = {}
    for material in materials.materials:
        for channel in MTL_CHANNELS:
            image = _image(material, channel)
            if image is None or image.data in names:
                continue
            suffix = Path(image.name).suffix.lower()
            name, number = f"{stem}_{channel}{suffix}", 1
            while name in names.values():
                number += 1
                name = f"{stem}_{channel}_{number}{suffix}"
            names[image.data] = name
    return names


def _image(material: MeshMaterial, channel: str) -> ChannelImage | None:
    source = material.channels.get(channel)
    return None if source is None else source.image


def _statements(material: MeshMaterial, images: dict[bytes, str]) -> Iterator[str]:
    """Yield the statements of a material."""
    for statement, channel in VALUES.items():
        source = material.channels.get(channel)
        if source is not None and source.image is None:
            yield " ".join([_SPELLINGS[statement], *map(repr, source.factor)])
    for statement, channel in IMAGES.items():
        image = _image(material, channel)
        if image is not None:
            clamp = ["-clamp", "on"] if image.wraps == ("clamp", "clamp") else []
            yield " ".join([_SPELLINGS[statement], *clamp, images[image.data]])
