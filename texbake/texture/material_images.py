"""Images of materials, read from model files, and written as glTF and .mtl files read them.

An image that already has the layout that the file needs is kept byte for byte. For glTF, the
channels of others are put into one PNG image for each texture of a material. MTL has no statement
for a component of an image, so that each channel becomes a gray image of its own. Integer codes
keep their values; floats become codes of 16 bits.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError
from texbake.mesh.files.channels import SLOTS, FileChannel, Slot, is_scale, same_place
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
from texbake.records import dataclass
from texbake.texture.encoding import encode_srgb, quantize_unsigned
from texbake.texture.image import FloatImage, Image, decode_image
from texbake.texture.pack import resized
from texbake.texture.png_files import png_parts

_ALPHA = 3


def image_codes(
    image: ChannelImage, *, is_color: bool, threads: int | None = None
) -> tuple[FloatImage, int]:
    """Codes (H, W, C) in [0, 1], sRGB of floats if `is_color`, and the bits that hold them."""
    found = decode_image(image.data, image.name, color=False, threads=threads)
    pixels = found.pixels
    if found.is_float:
        pixels = np.clip(np.nan_to_num(pixels), 0.0, 1.0)
        pixels = encode_srgb(pixels).astype(np.float32) if is_color else pixels
    return pixels, 8 if found.bits == 8 else 16


def components_of(pixels: FloatImage, components: tuple[int, ...]) -> FloatImage:
    """(H, W, n) components of pixels; gray is in all colors, and alpha is 1 where there is none."""
    n = pixels.shape[2]
    columns = []
    for component in components:
        if component == _ALPHA and n in (1, 3):
            columns.append(np.ones(pixels.shape[:2], np.float32))
        else:
            columns.append(pixels[..., component if n > 2 else int(component == _ALPHA)])
    return np.stack(columns, axis=2)


# Mean difference of red, green and blue, as a share of white, that JPEG leaves of a gray image.
_ROUNDING = 0.01


def check_gray(image: Image, what: str) -> None:
    """Raise where the red, green and blue of an image differ, so that none of them is the map."""
    colors = image.pixels[..., :3]
    if image.pixels.shape[2] < 3:
        return
    with np.errstate(invalid="ignore"):
        apart = colors.max(axis=2) - colors.min(axis=2)
    if float(np.nan_to_num(apart).mean()) > _ROUNDING:
        raise OptionError(
            f"{image.name}: {what} is one number per texel, and red, green and blue of this image "
            "differ; give a gray image, such as one that texbake split-channels makes of it"
        )


def gltf_images(materials: Materials, *, threads: int | None = None) -> Materials:
    """Return materials whose channels share images in the layout that glTF reads."""
    arranger = _Arranger(threads)
    changed = tuple(arranger.arranged(i, item) for i, item in enumerate(materials.materials))
    return replace(materials, materials=changed, missing=tuple(arranger.missing))


@dataclass(eq=False)
class _Arranger:
    """Rearranges the images of materials, each file decoded once."""

    threads: int | None
    missing: list[tuple[str, str]] = field(default_factory=list)  # as in `Materials`; appended to
    _decoded: dict[str, tuple[FloatImage, int] | str] = field(default_factory=dict)

    def arranged(self, number: int, material: MeshMaterial) -> MeshMaterial:
        """Return a material whose images have the layout that glTF reads."""
        for slot in SLOTS:
            if not slot.fits(material):
                material = self._sound(slot, material)
                material = self._gray(slot, material)
            if not slot.fits(material):
                material = self._packed(slot, material, number)
        return material

    def _sound(self, slot: Slot, material: MeshMaterial) -> MeshMaterial:
        """Leave out images that cannot be decoded, or lie at another place than the first."""
        channels = dict(material.channels)
        first = None
        for where, source in slot.sources(material):
            if source.image is None:
                continue
            found = self._pixels(source.image, where)
            line = found if isinstance(found, str) else ""
            if not line and first is not None and not _shares(source.image, first):
                line = f"{source.image.name}: glTF cannot place it apart from {first.name}"
            if line:
                line = f"{material.name}: {line}; the material keeps its factors"
                self.missing.append((where.name, line))
                channels[where.name] = replace(source, image=None, offset=0.0)
            else:
                first = first or source.image
        return replace(material, channels=channels)

    def _gray(self, slot: Slot, material: MeshMaterial) -> MeshMaterial:
        """Let channels read any component of gray images, whose components are all the same."""
        channels = dict(material.channels)
        for where, source in slot.sources(material):
            if source.image is None or _ALPHA in (*where.components, *source.image.components):
                continue
            found = self._pixels(source.image, where)
            if not isinstance(found, str) and found[0].shape[2] < 3:
                image = replace(source.image, components=where.components)
                channels[where.name] = replace(source, image=image)
        return replace(material, channels=channels)

    def _packed(self, slot: Slot, material: MeshMaterial, number: int) -> MeshMaterial:
        """Pack the images of a texture into one."""
        first = slot.image(material)
        if first is None:
            return material
        sources = list(slot.sources(material))
        pieces = {}
        bits = 8
        for where, source in sources:
            if source.image is not None:
                found = self._pixels(source.image, where)
                assert not isinstance(found, str)
                values = components_of(found[0], source.image.components)
                pieces[where] = _scaled(values, where, source)
                bits = max(bits, found[1])
        height = max(piece.shape[0] for piece in pieces.values())
        width = max(piece.shape[1] for piece in pieces.values())
        n = 1 + max(max(where.components) for where, _ in sources)
        pixels = np.ones((height, width, max(n, 3)), np.float32)
        for where, piece in pieces.items():
            pixels[..., list(where.components)] = resized(piece, width, height)
        is_color = any(CHANNELS[where.name].is_color for where, _ in sources)
        codes = quantize_unsigned(pixels, bits, threads=self.threads)
        data = b"".join(png_parts(codes, srgb=is_color, threads=self.threads))
        name = f"{slot.texture} of material {number}, {material.name}"
        channels = dict(material.channels)
        for where, source in sources:
            image = replace(first, data=data, name=name, components=where.components)
            if where.name == "normal" and not is_scale(source.factor):
                channels[where.name] = ChannelSource((1.0, 1.0, 1.0), image)
            elif where in pieces or any(source.factor):
                channels[where.name] = replace(source, image=image)
        return replace(material, channels=channels)

    def _pixels(self, image: ChannelImage, where: FileChannel) -> tuple[FloatImage, int] | str:
        """(H, W, C) float32 codes of an image in [0, 1], and their bits; or why there are none."""
        if image.name not in self._decoded:
            try:
                is_color = CHANNELS[where.name].is_color
                codes = image_codes(image, is_color=is_color, threads=self.threads)
                self._decoded[image.name] = codes
            except FileFormatError as error:
                self._decoded[image.name] = str(error)
        return self._decoded[image.name]


def _shares(image: ChannelImage, first: ChannelImage) -> bool:
    """Whether two images lie at the same place of a surface."""
    return same_place(replace(image, data=b""), replace(first, data=b""))


def _scaled(codes: FloatImage, where: FileChannel, source: ChannelSource) -> FloatImage:
    """Codes of normals with their factor applied, where glTF has no factor like it."""
    if where.name != "normal" or is_scale(source.factor):
        return codes
    normals = (2.0 * codes - 1.0) * np.array(source.factor, np.float32)
    lengths = pm.norm(normals, axis=2, keepdims=True)
    return np.asarray(0.5 + 0.5 * normals / np.maximum(lengths, 1e-12), np.float32)


# Formats that programs read beside .mtl files, by their media types.
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg"}


def mtl_images(
    materials: Materials, *, threads: int | None = None
) -> tuple[Materials, tuple[str, ...]]:
    """Return materials as .mtl files have them, and names of what they cannot hold."""
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
    """Return a channel as .mtl files have it; None to leave the channel out."""
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
    return ChannelSource((1.0,) * len(source.factor), replace(made[key], wraps=image.wraps))


def _plain_image(name: str, image: ChannelImage, threads: int | None) -> ChannelImage:
    """Return an image that holds one channel alone, named as its file."""
    components = tuple(range(len(CHANNELS[name].default)))
    suffix = _SUFFIXES.get(media_type(image.data) or "")
    if suffix is not None and image.components == components:
        return replace(image, name=f"{name}{suffix}")
    codes, bits = image_codes(image, is_color=CHANNELS[name].is_color, threads=threads)
    stored = quantize_unsigned(components_of(codes, image.components), bits, threads=threads)
    data = b"".join(png_parts(stored, srgb=CHANNELS[name].is_color, threads=threads))
    return replace(image, data=data, name=f"{name}.png", components=components)
