"""Textures of a glTF material, each with the channels that it holds, and what fits into them.

glTF reads roughness from the green and metallic from the blue of one image, alpha from the image of
the base color. Other formats have an image for each channel. `texbake.texture.gltf_images` puts
such images where glTF reads them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby

from texbake.mesh.files.conversion import media_type
from texbake.mesh.files.gltf_channels import GLTF_CHANNELS, GltfChannel
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, MeshMaterial


@dataclass(frozen=True)
class Slot:
    """A texture of glTF materials.

    Attributes
    ----------
    owner, texture : str
        As in `GltfChannel`.
    channels : tuple of GltfChannel
        Those that it holds.
    """

    owner: str
    texture: str
    channels: tuple[GltfChannel, ...]

    def sources(self, material: MeshMaterial) -> Iterator[tuple[GltfChannel, ChannelSource]]:
        """Yield where each channel of it comes from; the default, where the material is silent."""
        for where in self.channels:
            if where.name == "alpha" and material.alpha_mode == "opaque":
                continue
            default = ChannelSource(CHANNELS[where.name].default)
            yield where, material.channels.get(where.name, default)

    def image(self, material: MeshMaterial) -> ChannelImage | None:
        """Return the first image of its channels."""
        images = (source.image for _, source in self.sources(material))
        return next((image for image in images if image is not None), None)

    def holds(self, material: MeshMaterial) -> bool:
        """Whether glTF has the images of a material's channels, all in one and where it reads."""
        first = self.image(material)
        return first is None or (
            media_type(first.data) is not None
            and all(_is_read(where, source, first) for where, source in self.sources(material))
        )

    def fits(self, material: MeshMaterial) -> bool:
        """Whether glTF also shows the channels that have no image as the material does.

        It would multiply them by what stands in the image.
        """
        alone = (source for _, source in self.sources(material) if source.image is None)
        has_image = self.image(material) is not None
        return self.holds(material) and not (has_image and any(any(s.factor) for s in alone))


def _is_read(where: GltfChannel, source: ChannelSource, first: ChannelImage) -> bool:
    """Whether glTF reads the image of a channel, if it has one, as the material does."""
    if source.image is None:
        return True
    if source.image.components != where.components or not same_place(source.image, first):
        return False
    return where.name != "normal" or is_scale(source.factor)


def is_scale(factor: tuple[float, ...]) -> bool:
    """Whether a factor of normals is a scale of glTF, which acts on x and y alike."""
    return factor == (factor[0], factor[0], 1.0)


def same_place(a: ChannelImage, b: ChannelImage) -> bool:
    """Whether two channels read an image file at the same places."""
    common = {"components": (), "name": ""}
    return replace(a, **common) == replace(b, **common)  # type: ignore[arg-type]


SLOTS = tuple(
    Slot(owner, texture, tuple(channels))
    for (owner, texture), channels in groupby(
        GLTF_CHANNELS, key=lambda channel: (channel.owner, channel.texture)
    )
)
