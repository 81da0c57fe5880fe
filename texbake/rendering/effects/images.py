"""Images of materials: each is read once, with mip levels if its filter needs them.

Two effects: one reads the images that the shading of an object looks up, the other makes mip levels
for images whose filter is trilinear, EWA or the supersampled reference. `look_up` samples them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.points import coordinates_effect, textured_mesh
from texbake.rendering.fragments import Fragments
from texbake.rendering.maps import MapSource, channel_of, colors_from, normals_from
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Compute, Target
from texbake.rendering.scene.material import DEFAULT_MATERIAL, Material
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.textures import (
    FILTERS_WITH_FOOTPRINT,
    FILTERS_WITH_LEVELS,
    ImageTexture,
)
from texbake.texture.image import FloatImage
from texbake.texture.lookup import Wrap, ramp_lookup
from texbake.texture.mipmaps import MipChain, mip_chain, single_level
from texbake.texture.sample import sample

# Slots that hold colors with three channels; the others hold single numbers.
COLOR_SLOTS = ("base_color", "specular", "emission", "light_map", "reflection.strength",
               "refraction.strength")  # fmt: skip
# How far rounding in float32 files may put a coordinate outside the unit square.
_ROUNDING = 1e-6


# The file or array, and how its values are read.
Origin = tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class LoadedImage:
    """An image, ready to be looked up."""

    chain: MipChain  # level 0 alone, or all mip levels
    kind: str  # how its mip levels are computed: as `color`, `data` or `normal`
    filter: str
    wrap: Wrap
    border: Float32Array
    factor: Float32Array
    # turn, offset: (2, 2) and (2,): transform texture coordinates of the mesh to those of the
    # image; None if they are equal
    turn: FloatArray | None
    offset: FloatArray
    space: str = ""  # space of a normal map
    # Further set of texture coordinates that it lies on; None for the first
    uv_set: str | None = None
    # (K, 3): colors for the values from the first to the second number of `range`
    legend: Float32Array | None = None
    range: tuple[float, float] = (0.0, 1.0)
    origin: Origin | None = None  # source of the texels; images of equal origin have equal texels
    is_shared: bool = False  # whether another image holds the same texels in memory

    @property
    def n_bytes(self) -> int:
        """Memory of its texels; 0 where another image counts them."""
        return 0 if self.is_shared else self.chain.texels.nbytes

    def place(self, uvs: FloatArray) -> FloatArray:
        """Transform texture coordinates (..., 2) of the mesh to those of the image."""
        return uvs if self.turn is None else pm.matmul(uvs, self.turn.T) + self.offset

    def direct(self, steps: FloatArray) -> FloatArray:
        """Transform differences (..., 2) of texture coordinates."""
        return steps if self.turn is None else pm.matmul(steps, self.turn.T)

    def change(self, changes: Float32Array) -> Float32Array:
        """Transform derivatives (n, 4) of texture coordinates per pixel."""
        if self.turn is None:
            return changes
        turn = self.turn.T.astype(np.float32)
        return np.asarray(pm.matmul(changes.reshape(-1, 2, 2), turn).reshape(-1, 4))

    @cached_property
    def limits(self) -> tuple[Float32Array, Float32Array]:
        """(C,) and (C,): minimum and maximum of each channel."""
        return self.chain.texels.min(axis=0), self.chain.texels.max(axis=0)


def _reasons(request: RenderRequest, index: int) -> Iterator[str]:
    return (f"{name} is an image" for name, _ in request.textures_of(index, ImageTexture))


def _needs(request: RenderRequest, target: int) -> Iterator[str]:
    images = [image for _, image in request.textures_of(target, ImageTexture)]
    yield from {coordinates_effect(image.uv_set): None for image in images}
    if any(map(request.wants_footprint, images)):
        yield "derivatives"


def without_textures(kind: type, scene: Scene) -> Scene:
    """Return a scene without the textures of a kind in the slots and maps of its materials."""

    def bare(material: Material) -> Material:
        changes: dict[str, Any] = {}
        for item in fields(material):
            value = getattr(material, item.name)
            if isinstance(value, kind) or isinstance(getattr(value, "texture", None), kind):
                changes[item.name] = getattr(DEFAULT_MATERIAL, item.name)
            elif isinstance(getattr(value, "strength", None), kind):
                changes[item.name] = replace(value, strength=1.0)
        return replace(material, **changes)

    return scene.with_materials(bare)


def _load_images(state: RenderState, target: int) -> dict[str, LoadedImage]:
    found: dict[str, LoadedImage] = {}
    for name, texture in state.request.textures_of(target, ImageTexture):
        origin = _origin(state, target, name, texture)
        alike = (each for each in _loaded(state, _load_images, found) if each.origin == origin)
        known = next(alike, None)
        if known is None:
            pixels, kind, space = _pixels(state, target, name, texture)
        else:
            pixels, kind, space = known.chain.level(0), known.kind, known.space
        image = placed_image(
            texture,
            pixels,
            kind=kind,
            filter_name=state.request.filter_of(texture),
            uvs=textured_mesh(state, target).on_uv_set(texture.uv_set).uvs,
            name=name,
            space=space,
        )
        found[name] = replace(image, origin=origin, is_shared=known is not None)
    return found


def _loaded(
    state: RenderState, load: Compute[dict[str, LoadedImage]], found: dict[str, LoadedImage]
) -> Iterator[LoadedImage]:
    """Images of other targets, and of this one so far; equal images share texels."""
    for images in (*state.results.all(load).values(), found):
        yield from images.values()


def _origin(state: RenderState, target: int, name: str, texture: ImageTexture) -> Origin:
    source = texture.image
    place = os.fspath(source) if isinstance(source, str | os.PathLike) else id(source)
    if name == "normal_map.texture":
        holder = state.request.material(target).normal_map
        assert holder is not None
        return place, "normal", holder.convention, holder.space
    channel = 0 if texture.channel is None and texture.colors else texture.channel
    return place, name in COLOR_SLOTS, channel, texture.color


def placed_image(
    texture: ImageTexture,
    pixels: FloatImage,
    *,
    kind: str,
    filter_name: str,
    uvs: FloatArray | None,
    name: str,
    space: str = "",
) -> LoadedImage:
    """Read a texture at level 0; its wrap mode follows from `uvs` if it sets none."""
    n_channels = pixels.shape[2]
    radians = math.radians(texture.rotate)
    turn = np.array(
        [[pm.cos(radians), -pm.sin(radians)], [pm.sin(radians), pm.cos(radians)]]
    ) * np.asarray(texture.scale)
    plain = np.array_equal(turn, np.eye(2)) and tuple(texture.offset) == (0.0, 0.0)
    return LoadedImage(
        chain=single_level(pixels),
        kind=kind,
        filter=filter_name,
        wrap=texture.wrap
        or wrap_of(
            uvs if plain else None if uvs is None else pm.matmul(uvs, turn.T) + texture.offset
        ),
        border=_broadcast(texture.border, n_channels, f"{name}.border"),
        factor=_broadcast(texture.factor, 3 if texture.colors else n_channels, f"{name}.factor"),
        turn=None if plain else turn,
        offset=np.asarray(texture.offset, np.float64),
        space=space,
        uv_set=texture.uv_set,
        legend=np.asarray(texture.colors, np.float32) if texture.colors else None,
        range=texture.range,
    )


def _pixels(
    state: RenderState, target: int, name: str, texture: ImageTexture
) -> tuple[FloatImage, str, str]:
    """Return the texels of an image, their kind and, for normals, their space."""
    if name == "normal_map.texture":
        holder = state.request.material(target).normal_map
        assert holder is not None
        normals, space = normals_from(
            texture.image, convention=holder.convention, space=holder.space
        )
        return normals, "normal", space
    is_color = name in COLOR_SLOTS
    source: MapSource = texture.image
    if texture.colors is not None and not is_color:
        raise OptionError(f"{name}.colors: it takes numbers; leave the colors out")
    if texture.channel is not None or texture.colors is not None:
        return channel_of(source, texture.channel or 0, color=texture.color or False), "data", ""
    if is_color:
        return colors_from(source, color=texture.color is not False), "color", ""
    return channel_of(source, 0, color=bool(texture.color)), "data", ""


def _broadcast(value: float | tuple[float, ...], n_channels: int, name: str) -> Float32Array:
    numbers = np.atleast_1d(np.asarray(value, np.float32))
    if len(numbers) not in (1, n_channels):
        raise OptionError(f"{name}: {value} are not 1 or {n_channels} numbers")
    return np.broadcast_to(numbers, n_channels).astype(np.float32)


def wrap_of(uvs: FloatArray | None) -> str:
    """Choose "repeat" if coordinates leave the unit square, else "clamp" to blend no borders."""
    if uvs is None or len(uvs) == 0:
        return "clamp"
    inside = float(uvs.min()) >= -_ROUNDING and float(uvs.max()) <= 1.0 + _ROUNDING
    return "clamp" if inside else "repeat"


def _mip_reasons(request: RenderRequest, index: int) -> Iterator[str]:
    for name, texture in request.textures_of(index, ImageTexture):
        kind = request.filter_of(texture)
        if kind in FILTERS_WITH_LEVELS:
            yield f"{name} is filtered {kind}"


def _load_mip_levels(state: RenderState, target: Target) -> dict[str, LoadedImage]:
    """Make the mip levels of the images whose filter needs them."""
    found: dict[str, LoadedImage] = {}
    for name, image in state.of(_load_images, target).items():
        if image.filter not in FILTERS_WITH_LEVELS:
            continue
        alike = (
            other
            for other in _loaded(state, _load_mip_levels, found)
            if (other.origin, other.wrap) == (image.origin, image.wrap)
        )
        known = next(alike, None)
        chain = with_levels(image, threads=state.threads).chain if known is None else known.chain
        found[name] = replace(image, chain=chain, is_shared=known is not None)
    return found


def filtered_image(image: LoadedImage, *, threads: int | None = None) -> LoadedImage:
    """Return an image with its mip levels if its filter has a footprint."""
    return with_levels(image, threads=threads) if image.filter in FILTERS_WITH_FOOTPRINT else image


def with_levels(image: LoadedImage, *, threads: int | None = None) -> LoadedImage:
    """Return an image with all its mip levels."""
    chain = mip_chain(image.chain.level(0), kind=image.kind, wrap=image.wrap, threads=threads)
    return replace(image, chain=chain)


def image_of(state: RenderState, target: int, name: str) -> LoadedImage:
    """Return the image of a slot, with its mip levels if its filter needs them."""
    with_levels_too = state.get(_load_mip_levels, target) or {}
    return with_levels_too.get(name) or state.of(_load_images, target)[name]


def look_up(fragments: Fragments, state: RenderState, name: str) -> Float32Array:
    """(n, C) float32: values of an image at fragments."""
    image = image_of(state, fragments.target, name)
    at, changes = fragments.coordinates[image.uv_set]
    wanted = image.filter in FILTERS_WITH_FOOTPRINT
    return image_values(image, at, changes if wanted else None)


def image_values(image: LoadedImage, at: FloatArray, changes: Float32Array | None) -> Float32Array:
    """(n, C) values of an image at uvs; `changes` (n, 4) per pixel for filters with a footprint."""
    values = sample(
        image.chain,
        image.place(at),
        None if changes is None else image.change(changes),
        filter=image.filter,
        wrap=image.wrap,
        border=image.border,
        threads=1,
    )
    if image.filter == "bicubic":  # overshoots at edges
        np.clip(values, *image.limits, out=values)
    if image.legend is not None:
        low, high = image.range
        shares = ((values[:, 0] - low) / (high - low)).astype(np.float32)
        values = ramp_lookup(image.legend, shares, threads=1)
    if (image.factor != 1.0).any():
        values *= image.factor
    return values


IMAGES = Effect(
    name="images",
    does="reads the images of materials",
    after="further texture coordinates",
    reasons=_reasons,
    left_out="no material in the picture has an image",
    needs=(_needs,),
    without=partial(without_textures, ImageTexture),
    load=_load_images,
)

MIP_MAPS = Effect(
    name="mip maps",
    does="makes mip levels of images",
    after="images",
    reasons=_mip_reasons,
    left_out="no image has a filter with mip levels",
    needs=("images",),
    load=_load_mip_levels,
)
