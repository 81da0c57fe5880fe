"""Images of materials rearranged as glTF reads them: several channels in one image.

An image that stands as glTF reads it stays as it is, byte for byte. Others are taken apart and
become one PNG image for each texture of a material: with the roughness of one file in its green and
the metallic of another in its blue, for instance. Images of formats that glTF does not have, such
as TGA or TIFF, become PNG as well. Integer codes keep their values; floats become codes of 16 bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError
from texbake.mesh.files.channels import FileChannel
from texbake.mesh.files.gltf_materials import SLOTS, Slot, is_scale, same_place
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.texture.channel_codes import components_of, image_codes
from texbake.texture.encoding import quantize_unsigned
from texbake.texture.image import FloatImage
from texbake.texture.pack import resized
from texbake.texture.png_files import png_parts

_ALPHA = 3


def gltf_images(materials: Materials, *, threads: int | None = None) -> Materials:
    """Return materials whose images stand where glTF reads them.

    Channels that share a texture in glTF share an image.
    """
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
        """Return a material whose images stand where glTF reads them."""
        for slot in SLOTS:
            if not slot.fits(material):
                material = self._sound(slot, material)
                material = self._gray(slot, material)
            if not slot.fits(material):
                material = self._packed(slot, material, number)
        return material

    def _sound(self, slot: Slot, material: MeshMaterial) -> MeshMaterial:
        """Leave out images that cannot be decoded, or not share the place of the first."""
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
