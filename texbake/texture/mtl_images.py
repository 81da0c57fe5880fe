"""Materials with the channels that .mtl files have, and an image for each of them.

MTL has no statement for a component of an image, so that roughness in the green of a glTF image,
for instance, becomes a gray image of its own.
"""

from __future__ import annotations

from dataclasses import replace

from texbake.errors import FileFormatError
from texbake.mesh.files.conversion import media_type
from texbake.mesh.files.mtl import MTL_CHANNELS
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
)
from texbake.texture.channel_codes import components_of, image_codes
from texbake.texture.encoding import quantize_unsigned
from texbake.texture.png_files import png_parts

# Formats that programs read beside .mtl files, by their media types.
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg"}


def mtl_images(
    materials: Materials, *, threads: int | None = None
) -> tuple[Materials, tuple[str, ...]]:
    """Return materials as .mtl files have them."""
    lost: dict[str, None] = {}
    made: dict[tuple[str, tuple[int, ...]], ChannelImage] = {}
    changed = []
    for material in materials.materials:
        channels = {}
        for name, source in material.channels.items():
            if name not in MTL_CHANNELS:
                if source != ChannelSource(CHANNELS[name].default) and any(source.factor):
                    lost[name] = None
                continue
            found = _source(name, source, made, lost, threads)
            if found is not None:
                channels[name] = found
        changed.append(MeshMaterial(name=material.name, channels=channels))
    return replace(materials, materials=tuple(changed)), tuple(lost)


def _source(
    name: str,
    source: ChannelSource,
    made: dict[tuple[str, tuple[int, ...]], ChannelImage],
    lost: dict[str, None],
    threads: int | None,
) -> ChannelSource | None:
    """Return a channel as .mtl files have it; None where only its image would say it."""
    image = source.image
    if image is None:
        return source
    if not any(source.factor):
        return ChannelSource(source.factor)
    if image.uv_set or image.placing != UNPLACED:
        lost["texture transforms and further UV sets"] = None
        return None if name == "normal" else ChannelSource(source.factor)
    if "mirror" in image.wraps or image.wraps[0] != image.wraps[1]:
        lost["wrapping"] = None
    key = image.name, image.components
    if key not in made:
        try:
            made[key] = _plain_image(name, image, threads)
        except FileFormatError:
            lost[f"the image {image.name}"] = None
            return None if name == "normal" else ChannelSource(source.factor)
    if set(source.factor) != {1.0}:
        lost["factors of images"] = None
    found = replace(made[key], wraps=image.wraps)
    return ChannelSource((1.0,) * len(source.factor), found)


def _plain_image(name: str, image: ChannelImage, threads: int | None) -> ChannelImage:
    """Image file of the one channel that is read from it."""
    width = len(CHANNELS[name].default)
    components = tuple(range(width))
    suffix = _SUFFIXES.get(media_type(image.data) or "")
    if suffix is not None and image.components == components:
        return replace(image, name=f"{name}{suffix}")
    codes, bits = image_codes(image, is_color=CHANNELS[name].is_color, threads=threads)
    stored = quantize_unsigned(components_of(codes, image.components), bits, threads=threads)
    data = b"".join(png_parts(stored, srgb=CHANNELS[name].is_color, threads=threads))
    return replace(image, data=data, name=f"{name}.png", components=components)
