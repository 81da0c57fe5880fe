"""The materials of a model, baked for another mesh into one set of images.

Channels that are one number all over become factors, the others images. Channels that glTF reads
from one image share one: occlusion, roughness and metallic; base color and alpha; and so on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from texbake.baking.result import BakedMap
from texbake.errors import first_few
from texbake.files import PathLike
from texbake.mesh.files.unread_parts import unread_parts
from texbake.mesh.frame import LocalFrame
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import ByteArray, Float32Array, IndexArray, IntArray, Mesh
from texbake.mesh.rig import Rig
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.encoding import encode_normals, quantize_srgb, quantize_unsigned
from texbake.texture.image_files import encode_image

# Pixels per side of an image of one value.
_FLAT_SIZE = 4
# Pieces of a map that are looked at one after the other for a value that differs.
_PIECES = 64


@dataclass(frozen=True)
class ImageLayout:
    """Which channels an image holds."""

    name: str  # end of its file name
    channels: tuple[tuple[str, int], ...]  # channels, each with the component at which it begins
    is_color: bool = False  # whether red, green and blue are coded in sRGB


LAYOUTS = (
    ImageLayout("base_color", (("base-color", 0), ("alpha", 3)), is_color=True),
    ImageLayout("orm", (("occlusion", 0), ("roughness", 1), ("metallic", 2))),
    ImageLayout("emissive", (("emissive", 0),), is_color=True),
    ImageLayout("clearcoat", (("clearcoat", 0), ("clearcoat-roughness", 1))),
    ImageLayout("transmission", (("transmission", 0),)),
    ImageLayout("sheen", (("sheen-color", 0), ("sheen-roughness", 3)), is_color=True),
    ImageLayout("specular", (("specular-color", 0), ("specular", 3)), is_color=True),
)


def compared_without(path: PathLike, materials: Materials | None) -> tuple[str, ...]:
    """Return a warning that names images that are missing in both pictures, if any are."""
    if materials is None or not materials.missing_images:
        return ()
    names = ", ".join(first_few(materials.missing_images))
    return (f"{path}: compared without its missing images: {names}",)


def left_out(path: PathLike, rig: Rig | None = None) -> tuple[str, ...]:
    """Return a warning that names what was left out of a model file, if anything was."""
    found = unread_parts(path) if rig is None else rig.passed_over
    return (f"{path}: {', '.join(found)} left out",) if found else ()


def image_names(channels: Iterable[str]) -> list[str]:
    """Return the names of the images that channels are read from, as ends of file names."""
    names = set(channels)
    return [layout.name for layout in LAYOUTS if names & {name for name, _ in layout.channels}]


def image_of(name: str, channels: Mapping[str, ChannelSource]) -> ChannelImage | None:
    """Return an image by the end of its name; None where its channels are only factors."""
    layout = next(layout for layout in LAYOUTS if layout.name == name)
    found = (channels.get(channel) for channel, _ in layout.channels)
    return next((source.image for source in found if source and source.image), None)


def transferred_channels(materials: Materials | None) -> tuple[str, ...]:
    """Channels, without normals, that differ over the mesh or have images."""
    if materials is None:
        return ()
    return tuple(
        name
        for name in _set_channels(materials)
        if constant_source(materials, name) is None and name != "normal"
    )


def channels_of_images(materials: Materials | None, *, embeds: bool) -> list[str]:
    """Channels that images are written for, constant ones too unless the mesh `embeds`."""
    if materials is None:
        return []
    channels = list(transferred_channels(materials))
    for layout in () if embeds else LAYOUTS[:3]:
        for name, _ in layout.channels:
            found = constant_source(materials, name) if name in _set_channels(materials) else None
            if found is not None and found.factor != CHANNELS[name].default:
                channels.append(name)
    return channels


def constant_source(materials: Materials, channel: str) -> ChannelSource | None:
    """Return the one factor of a channel all over the mesh; None where it differs."""
    sources = materials.sources(channel)
    is_of_vertices = materials.has_vertex_colors and channel in ("base-color", "alpha")
    default = CHANNELS[channel].default
    factors = {default if source is None else source.factor for source in sources}
    varies = any(source and (source.image or source.sampler) for source in sources)
    if is_of_vertices or len(factors) > 1 or varies:
        return None
    return ChannelSource(factors.pop())


def _set_channels(materials: Materials) -> list[str]:
    """Channels that any material sets, or the vertex colors."""
    found = [name for name in CHANNELS if any(materials.sources(name))]
    if materials.has_vertex_colors and "base-color" not in found:
        found.insert(0, "base-color")
    is_opaque = all(material.alpha_mode == "opaque" for material in materials.materials)
    return [name for name in found if name != "alpha" or not is_opaque]


@dataclass(frozen=True, eq=False)
class _Picture:
    """An image to be encoded, and the channels that are read from it."""

    name: str
    codes: ByteArray
    is_color: bool
    # Each with the component at which it begins, and its factor.
    channels: tuple[tuple[str, int, float], ...]


def encoded_channels(
    maps: Mapping[str, BakedMap],
    materials: Materials,
    name: str,
    *,
    encode: Callable[[str, ByteArray, bool], bytes] | None = None,
    threads: int | None = None,
    whole: Iterable[str] = (),
    layouts: Sequence[ImageLayout] = LAYOUTS,
) -> dict[str, ChannelSource]:
    """Channels for a mesh from baked maps, as PNG or as `encode` does; `whole` keeps constants."""
    sources: dict[str, ChannelSource] = {}
    for channel in _set_channels(materials):
        constant = constant_source(materials, channel)
        if constant is not None:
            sources[channel] = constant
    values = {}
    for channel in transferred_channels(materials):
        found = _constant_of(maps[channel])
        if found is None:
            values[channel] = maps[channel].values
        else:
            sources[channel] = ChannelSource(found)
    for layout in (layout for layout in layouts if layout.name in whole):
        _fill(layout, values, sources)
    pictures = [_picture(layout, values, threads) for layout in layouts if _present(layout, values)]
    if "normal" in maps:
        codes = encode_normals(maps["normal"].values, bits=8, convention="opengl", threads=threads)
        pictures.append(_Picture("normal", codes, False, (("normal", 0, 1.0),)))
    files: list[bytes] = [b""] * len(pictures)

    def work(start: int, stop: int) -> None:
        for i in range(start, stop):
            picture = pictures[i]
            if encode is None:
                files[i] = encode_image(picture.codes, "png", is_color=picture.is_color)
            else:
                files[i] = encode(f"{name}_{picture.name}", picture.codes, picture.is_color)

    run_bands(work, len(pictures), band=1, threads=threads if encode is None else 1)
    suffix = ".png" if encode is None else ""
    for picture, data in zip(pictures, files, strict=True):
        for channel, first, factor in picture.channels:
            width = len(CHANNELS[channel].default)
            image = ChannelImage(
                data,
                f"{name}_{picture.name}{suffix}",
                components=tuple(range(first, first + width)),
            )
            sources[channel] = ChannelSource((factor,) * width, image)
    return sources


def _fill(
    layout: ImageLayout, values: dict[str, Float32Array], sources: Mapping[str, ChannelSource]
) -> None:
    """Add the channels of an image that have one value; those without a value have the default."""
    present = [values[channel] for channel, _ in layout.channels if channel in values]
    shape = present[0].shape[:2] if present else (_FLAT_SIZE, _FLAT_SIZE)
    for channel, _ in layout.channels:
        if channel not in values and (channel in sources or layout.name == "orm"):
            value = sources[channel].factor if channel in sources else CHANNELS[channel].default
            values[channel] = np.broadcast_to(np.array(value, np.float32), (*shape, len(value)))


def _present(layout: ImageLayout, values: Mapping[str, Float32Array]) -> list[tuple[str, int]]:
    return [(channel, first) for channel, first in layout.channels if channel in values]


def _constant_of(baked: BakedMap) -> tuple[float, ...] | None:
    """Return the value of a map that is the same wherever it has data, to half an 8-bit level."""
    if not baked.has_data.any():
        return CHANNELS[baked.kind.name].default
    least, most = np.array([np.inf]), np.array([-np.inf])
    for rows in np.array_split(np.arange(len(baked.values)), _PIECES):
        values = baked.values[rows][baked.has_data[rows]]
        if len(values):
            least = np.minimum(least, values.min(axis=0))
            most = np.maximum(most, values.max(axis=0))
        if (most - least > 0.5 / 255.0).any():
            return None
    return tuple(float(value) for value in (least + most) / 2.0)


def _picture(
    layout: ImageLayout, values: Mapping[str, Float32Array], threads: int | None
) -> _Picture:
    """Put the channels of a layout into one image."""
    present = _present(layout, values)
    height, width = values[present[0][0]].shape[:2]
    n = max(first + values[channel].shape[2] for channel, first in present)
    # What no channel fills is 1, so that a viewer that reads it anyway multiplies by 1.
    pixels = np.ones((height, width, 4 if n == 4 else 3), np.float32)
    channels = []
    for channel, first in present:
        factor = float(max(1.0, values[channel].max()))
        of_channel = slice(first, first + values[channel].shape[2])
        pixels[:, :, of_channel] = values[channel] / factor
        channels.append((channel, first, factor))
    if layout.is_color:
        codes = quantize_srgb(pixels, 8, n_colors=3, threads=threads)
    else:
        codes = quantize_unsigned(pixels, 8, threads=threads)
    return _Picture(layout.name, codes, layout.is_color, tuple(channels))


def shared_materials(
    low: Mesh,
    high: Mesh,
    materials: Materials,
    channels: dict[str, ChannelSource],
    name: str,
    *,
    threads: int | None = None,
) -> Materials:
    """Return materials that share images, several where a renderer would treat them differently."""
    kinds = materials.materials
    used = np.unique(materials.face_materials).tolist()
    distinct = list(dict.fromkeys(_as_key(kinds[i]) for i in used))
    ids: IntArray = np.zeros(low.n_faces, np.int32)
    if len(distinct) > 1:
        of_material = np.array(
            [distinct.index(key) if (key := _as_key(kind)) in distinct else 0 for kind in kinds],
            np.int32,
        )
        ids = of_material[materials.face_materials[_nearest_faces(low, high, threads)]]
    names = [name] if len(distinct) == 1 else [f"{name} {_title(key)}" for key in distinct]
    return Materials(
        face_materials=ids,
        materials=tuple(
            MeshMaterial(
                name=title,
                channels=_fitting(channels, key),
                alpha_mode=key[0],
                alpha_cutoff=key[1],
                is_double_sided=key[2],
                is_unlit=key[3],
                extensions=json.loads(key[5]),
            )
            for title, key in zip(names, distinct, strict=True)
        ),
    )


_Kind = tuple[str, float, bool, bool, bool, str]


def _as_key(material: MeshMaterial) -> _Kind:
    cutoff = material.alpha_cutoff if material.alpha_mode == "mask" else 0.5
    extensions = json.dumps(material.on_uv_sets(()).extensions, sort_keys=True)
    source = material.channels.get("transmission")
    transmits = source is not None and (any(source.factor) or source.sampler is not None)
    sides = material.is_double_sided, material.is_unlit
    return material.alpha_mode, cutoff, *sides, transmits, extensions


def _title(kind: _Kind) -> str:
    mode, _, is_double_sided, is_unlit, transmits, extensions = kind
    words = [mode, *(["double-sided"] if is_double_sided else []), *(["unlit"] if is_unlit else [])]
    words += ["transmission"] if transmits else []
    words += [name.removeprefix("KHR_materials_") for name in json.loads(extensions)]
    return " ".join(words)


def _fitting(channels: dict[str, ChannelSource], kind: _Kind) -> dict[str, ChannelSource]:
    """Channels of a kind of material: alpha unless it is opaque, transmission if it transmits."""
    mode, *_, transmits, _ = kind
    without = {"alpha"} if mode == "opaque" else set()
    without |= set() if transmits else {"transmission"}
    return {name: found for name, found in channels.items() if name not in without}


def _nearest_faces(low: Mesh, high: Mesh, threads: int | None) -> IndexArray:
    """(F,) face of the source nearest to the center of each face of a mesh."""
    frame = LocalFrame.around(high)
    tree = TriangleTree.build(frame.to_local(high.positions), high.faces, threads=threads)
    centers = frame.to_local(low.positions)[low.faces].mean(axis=1)
    _, nearest, _ = tree.closest_points(centers, threads=threads)
    return nearest.astype(np.intp)


def texture_size(materials: Materials | None, least: int, most: int) -> int:
    """Return a power of two at which an atlas holds about as many texels as the images do."""
    from texbake.texture.image import image_shape

    area = 0
    for material in () if materials is None else materials.materials:
        images = {s.image.name: s.image for s in material.channels.values() if s.image is not None}
        shapes = [image_shape(image.data, image.name) for image in images.values()]
        area += max((width * height for width, height, _ in shapes), default=0)
    side = math.sqrt(area)
    size = least
    while size < side and size < most:
        size *= 2
    return size
