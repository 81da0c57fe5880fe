"""Materials of an unwrapped mesh: images for each variant, and those of glTF extensions.

The images of extensions that texbake carries along, such as a thickness, have no maps of their own.
Each is baked as a channel with as many components, whose values are linear or sRGB like its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from texbake.baking.result import BakedMap, BakeResult
from texbake.jobs.light_images import Picture
from texbake.jobs.material_transfer import (
    LAYOUTS,
    ImageLayout,
    encoded_channels,
    shared_materials,
    transferred_channels,
)
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import ByteArray, Float32Array, Mesh
from texbake.records import dataclass
from texbake.texture.encoding import encode_normals
from texbake.texture.image_files import encode_image

_MOST_VARIANTS = 8  # that are baked
_FLAT = 128, 128, 255  # texel of a normal map
_ANISOTROPY = "KHR_materials_anisotropy"
_DIFFUSE = "KHR_materials_diffuse_transmission"
_IRIDESCENCE = "KHR_materials_iridescence"
# Properties of extensions by the channels that they are baked as, and components of their images.
_CARRIERS = {
    "roughness": ("KHR_materials_volume", "thicknessTexture", (1,)),
    "clearcoat": (_IRIDESCENCE, "iridescenceTexture", (0,)),
    "clearcoat-roughness": (_IRIDESCENCE, "iridescenceThicknessTexture", (1,)),
    "base-color": (_DIFFUSE, "diffuseTransmissionColorTexture", (0, 1, 2)),
    "transmission": (_DIFFUSE, "diffuseTransmissionTexture", (3,)),
}
_CARRIER_LAYOUTS = (
    ImageLayout("thickness", (("roughness", 1),)),
    ImageLayout("iridescence", (("clearcoat", 0), ("clearcoat-roughness", 1))),
    ImageLayout(
        "diffuse_transmission", (("base-color", 0), ("transmission", 3)), is_color=True
    ),
)  # fmt: skip

Channels = dict[str, ChannelSource]
Maps = Mapping[str, BakedMap]


def many_images(materials: Materials, mesh: str) -> str:
    """Why a mesh cannot be baked, if more variants need images of their own than are; else ""."""
    n = len(materials.variants)
    one_face_each = replace(materials, face_materials=np.unique(materials.face_materials))
    if (
        n <= _MOST_VARIANTS
        or sum(_needs_images(one_face_each, number) for number in range(n)) <= _MOST_VARIANTS
    ):
        return ""
    return (
        f"uvs: {mesh} has {n} variants of its materials, and images of {_MOST_VARIANTS} at most "
        "are baked; use keep"
    )


def _needs_images(materials: Materials, number: int) -> bool:
    """Whether a variant has images that differ from those shown by default."""
    for part, layouts in ((materials, LAYOUTS), (_carriers(materials), _CARRIER_LAYOUTS)):
        shown, changed = _of_variant(part, number, layouts)
        if "normal" in changed or transferred_channels(shown):
            return True
    return False


def _of_variant(
    materials: Materials, number: int, layouts: Sequence[ImageLayout]
) -> tuple[Materials, set[str]]:
    """Materials of a variant, with the channels that are not as by default, and these."""
    changed = _changed_channels(materials, number, layouts)
    shown = materials.in_variant(number).only(changed)
    has_vertex_colors = shown.has_vertex_colors and "base-color" in changed
    return replace(shown, has_vertex_colors=has_vertex_colors), changed


def needs_bake(materials: Materials) -> bool:
    """Whether variants or extensions have images that are baked."""
    shown = transferred_channels(materials.in_variant(None))
    return _carriers(materials).has_images or (not shown and bool(transferred_channels(materials)))


def unbaked_images(materials: Materials) -> tuple[str, ...]:
    """Return a warning that names images of extensions that are not baked, if there are any."""
    owners = (item.extensions.get(_ANISOTROPY, {}) for item in materials.materials)
    if not any("anisotropyTexture" in owner for owner in owners):
        return ()
    return (
        "anisotropyTexture left out: its directions are those of the texture coordinates of the "
        "model; to keep it, set `uvs` to keep",
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialBaker:
    """Bakes the materials of a model onto an unwrapped mesh."""

    low: Mesh
    high: Mesh
    materials: Materials
    name: str  # of the model; images and materials are named after it
    bake: Callable[[tuple[str, ...], Materials], BakeResult]  # bakes channels
    has_normals: bool  # whether normals are baked, whatever the materials
    threads: int | None = None
    pictures: list[Picture] = field(default_factory=list)  # of the images; appended to

    def baked(self, maps: Maps) -> Materials:
        """Return the materials of the mesh; `maps` are those of what is shown by default."""
        parts = [self._part(None, self.name, maps)]
        for number, (title, _) in enumerate(self.materials.variants):
            parts.append(self._part(number, f"{self.name} {title}", None, parts[0][1:]))
        names = [title for title, _ in self.materials.variants]
        return _with_variants([materials for materials, *_ in parts], names)

    def _part(
        self,
        number: int | None,
        title: str,
        maps: Maps | None,
        defaults: Sequence[Channels | None] = (None, None),
    ) -> tuple[Materials, Channels, Channels]:
        """Materials of a variant, and their channels and those of the carriers."""
        own = self._channels(self.materials, LAYOUTS, number, maps, defaults[0])
        carried = self._channels(
            _carriers(self.materials), _CARRIER_LAYOUTS, number, None, defaults[1]
        )
        shown = self.materials.in_variant(number)
        shared = shared_materials(self.low, self.high, shown, own, title, threads=self.threads)
        items = tuple(_with_carried(item, carried) for item in shared.materials)
        return replace(shared, materials=items), own, carried

    def _channels(
        self,
        materials: Materials,
        layouts: Sequence[ImageLayout],
        number: int | None,
        maps: Maps | None,
        default: Channels | None,
    ) -> Channels:
        """Channels of a variant; those that are as by default share its images."""
        is_own, has_normals, name = layouts is LAYOUTS, False, self.name
        if number is not None and default is not None:
            shown, changed = _of_variant(materials, number, layouts)
            name = f"{name}_variant_{number + 1}"
            default = {key: source for key, source in default.items() if key not in changed}
            has_normals = is_own and "normal" in changed and self.has_normals
        else:
            shown = materials.in_variant(number)
        if maps is None:
            wanted = transferred_channels(shown)
            if has_normals or any(shown.sources("normal")):
                wanted = ("normal", *wanted)
            maps = self.bake(wanted, shown).maps if wanted else {}
        whole = () if is_own else [layout.name for layout in layouts]
        made = encoded_channels(
            maps, shown, name, encode=self._keep, threads=self.threads, whole=whole,
            layouts=layouts,
        )  # fmt: skip
        if "normal" in made and _is_flat(self.pictures[-1].codes):
            del made["normal"], self.pictures[-1]
        return {**(default or {}), **made}

    def _keep(self, name: str, codes: ByteArray, is_color: bool) -> bytes:
        self.pictures.append(Picture(name, codes, is_color, is_normal=name.endswith("_normal")))
        return b""


def _is_flat(codes: ByteArray) -> bool:
    """Whether a normal map changes nothing."""
    return bool((codes == _FLAT).all())


def _carriers(materials: Materials) -> Materials:
    """Return materials whose channels have the images of extensions."""
    images = [
        {
            carrier: replace(image, components=components)
            for carrier, (owner, key, components) in _CARRIERS.items()
            if (image := item.extensions.get(owner, {}).get(key)) is not None
        }
        for item in materials.materials
    ]
    used = {carrier for found in images for carrier in found}
    items = tuple(
        MeshMaterial(
            name=item.name,
            channels={
                carrier: ChannelSource((1.0,) * len(CHANNELS[carrier].default), found.get(carrier))
                for carrier in _CARRIERS
                if carrier in used
            },
        )
        for item, found in zip(materials.materials, images, strict=True)
    )
    return replace(materials, materials=items, has_vertex_colors=False)


def _with_carried(material: MeshMaterial, carried: Channels) -> MeshMaterial:
    """Return a material whose extensions have the images of carriers."""
    extensions = {owner: dict(content) for owner, content in material.extensions.items()}
    for carrier, source in carried.items():
        owner, key, _ = _CARRIERS[carrier]
        if owner in extensions and source.image is not None:
            extensions[owner][key] = source.image
    return replace(material, extensions=extensions)


def _changed_channels(
    materials: Materials, number: int, layouts: Sequence[ImageLayout]
) -> set[str]:
    """Channels of images in which a variant differs from what is shown by default."""
    _, table = materials.variants[number]
    items = materials.materials
    pairs = [(items[i], items[table[i]]) for i in np.unique(materials.face_materials).tolist()]
    changed: set[str] = set()
    for names in (["normal"], *([name for name, _ in layout.channels] for layout in layouts)):
        if any(_differ(one, other, name) for one, other in pairs for name in names):
            changed |= set(names)
    return changed


def _differ(one: MeshMaterial, other: MeshMaterial, name: str) -> bool:
    modes = {(item.alpha_mode, item.alpha_cutoff) for item in (one, other)}
    is_same_mode = name != "alpha" or len(modes) == 1
    return one.channels.get(name) != other.channels.get(name) or not is_same_mode


def with_normals_of(
    materials: Materials, normals: Float32Array, name: str, threads: int | None
) -> Materials:
    """Return materials that share a normal map, of (H, W, 3) normals in tangent space.

    They have none if it is flat.
    """
    codes = encode_normals(normals, bits=8, convention="opengl", threads=threads)
    if _is_flat(codes):
        return materials.only(CHANNELS.keys() - {"normal"})
    image = ChannelImage(encode_image(codes, "png", threads=threads), name)
    channel = {"normal": ChannelSource((1.0, 1.0, 1.0), image)}
    items = (replace(each, channels={**each.channels, **channel}) for each in materials.materials)
    return replace(materials, materials=tuple(items))


def _with_variants(parts: Sequence[Materials], names: Sequence[str]) -> Materials:
    """Return the first of some materials of the same faces, with the others as variants."""
    if not names:
        return parts[0]
    starts = np.cumsum([0, *(len(part.materials) for part in parts)])
    ids = [part.face_materials + start for part, start in zip(parts, starts, strict=False)]
    rows, numbers = np.unique(np.stack(ids, axis=1), axis=0, return_inverse=True)
    items = [item for part in parts for item in part.materials]
    n = len(rows)
    of_variants = range(n, n + len(items))
    tables = (n + rows[:, 1:]).T.tolist()
    return Materials(
        face_materials=numbers.ravel().astype(np.int32),
        materials=(*(items[row] for row in rows[:, 0].tolist()), *items),
        variants=tuple(
            (name, (*table, *of_variants)) for name, table in zip(names, tables, strict=True)
        ),
    ).used()
