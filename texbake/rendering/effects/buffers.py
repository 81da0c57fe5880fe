"""Buffers of the renderer shown as pictures: depth, normals, texture coordinates and so on.

A single effect draws every buffer of `texbake.rendering.options.BUFFERS`, without any shading. Its
colors are written to the file unchanged: a normal n is shown as the code (n + 1) / 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.mesh.oklch import linear_from_oklch
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import image_of
from texbake.rendering.effects.shading_models import normals_effect
from texbake.rendering.fragments import Fragments
from texbake.rendering.rasterize import rasterize
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb
from texbake.texture.sample import mip_levels

# Width of the texture that `texel-grid` and `mip-level` assume for a material without one.
_TEXELS = 1024
# Number of triangles on one sample at which `overdraw` reaches full brightness.
_MOST_TRIES = 16
# The golden angle in degrees: consecutive hues are far apart, however many there are.
_NEXT_HUE = 137.50776405


def _reasons(request: RenderRequest, index: int) -> Iterator[str]:
    if request.options.buffer is not None:
        yield f"buffer is {request.options.buffer}"


def _has_image(request: RenderRequest, target: int) -> bool:
    return isinstance(request.material(target).base_color, ImageTexture)


def _needs(request: RenderRequest, target: int) -> Iterator[str]:
    buffer = request.options.buffer
    if buffer == "depth":
        yield "positions"
    elif buffer == "normals":
        yield normals_effect(request, target)
    elif buffer == "uv":
        yield "texture coordinates"
    elif buffer in ("mip-level", "texel-grid"):
        yield "derivatives"
        yield "images" if _has_image(request, target) else "texture coordinates"


def _buffer_range(state: RenderState, target: Target) -> FloatArray:
    """Range of distances for `depth`, or triangles per sample for `overdraw`, once for all."""
    if target != min(state.visible.objects):
        return np.empty(0)
    buffer = state.options.buffer
    visibility = state.visible.visibility
    if buffer == "depth":
        shown = visibility.depths[visibility.face_ids >= 0]
        return state.camera.near / np.array([shown.max(), shown.min()], np.float64)
    if buffer == "overdraw":
        height, width = visibility.face_ids.shape
        tries = np.zeros((height, width), np.uint32)
        rasterize(
            state.world,
            state.camera.clip_from_world(width / height),
            width,
            height,
            modes=state.visible.modes,
            tries=tries,
            threads=state.threads,
        )
        return tries.astype(np.float64)
    return np.empty(0)


def _depth(fragments: Fragments, state: RenderState) -> Float32Array:
    """White at the nearest surface, black at the farthest."""
    near, far = state.of(_buffer_range, min(state.visible.objects))
    away = pm.matmul(state.camera.eye - fragments.positions, state.camera.axes[2])
    level = (far - away) / max(far - near, np.finfo(np.float64).tiny)
    return _gray(0.05 + 0.95 * np.clip(level, 0.0, 1.0))


def _normals(fragments: Fragments, state: RenderState) -> Float32Array:
    return decode_srgb(0.5 * fragments.normals + 0.5).astype(np.float32)


def _uv(fragments: Fragments, state: RenderState) -> Float32Array:
    """Texture coordinates: u as red, v as green, each within its tile."""
    uvs, _ = fragments.coordinates[None]
    shown = np.zeros((len(fragments), 3))
    shown[:, :2] = uvs - np.floor(uvs)
    return decode_srgb(shown).astype(np.float32)


def _texels(fragments: Fragments, state: RenderState) -> tuple[FloatArray, Float32Array]:
    """(n, 2): position in texels of the base color's image; (n,): mip level of the pixel."""
    width = height = _TEXELS
    has_image = _has_image(state.request, fragments.target)
    image = image_of(state, fragments.target, "base_color") if has_image else None
    at, changes = fragments.coordinates[None if image is None else image.uv_set]
    if image is not None:
        at, changes = image.place(at), image.change(changes)
        width, height = image.chain.width, image.chain.height
    return at * (width, height), mip_levels(changes, width, height, threads=1)


def _mip_level(fragments: Fragments, state: RenderState) -> Float32Array:
    """A hue for each mip level, blended between levels; gray where the texture is magnified."""
    _, levels = _texels(fragments, state)
    shown = np.clip(levels, 0.0, 30.0)
    chroma = np.where(levels < 0.0, 0.0, 0.14)
    return linear_from_oklch(0.75, chroma, 30.0 + 50.0 * shown).astype(np.float32)


def _overdraw(fragments: Fragments, state: RenderState) -> Float32Array:
    """Number of triangles that cover the pixel's center, brightest from 16 on."""
    tries = state.of(_buffer_range, min(state.visible.objects))
    columns, rows = (fragments.places.T * state.options.supersampling).astype(np.int64)
    return _gray(np.minimum(tries[rows, columns], _MOST_TRIES) / _MOST_TRIES)


def _object_id(fragments: Fragments, state: RenderState) -> Float32Array:
    color = linear_from_oklch(0.72, 0.13, 30.0 + _NEXT_HUE * fragments.target)
    return np.broadcast_to(color.astype(np.float32), (len(fragments), 3))


def _texel_grid(fragments: Fragments, state: RenderState) -> Float32Array:
    """A checkerboard of texels; gray where they are smaller than a pixel."""
    texels, levels = _texels(fragments, state)
    odd = (np.floor(texels).sum(axis=1) % 2.0).astype(np.float32)
    # Fades out between texels of two pixels and texels of one pixel.
    sharp = np.clip(-levels, 0.0, 1.0)
    return _gray(0.5 + (odd - 0.5) * 0.7 * sharp)


def _gray(codes: npt.NDArray[np.floating]) -> Float32Array:
    return np.repeat(decode_srgb(codes)[:, None], 3, axis=1).astype(np.float32)


_PICTURES: dict[str, Callable[[Fragments, RenderState], Float32Array]] = {
    "depth": _depth,
    "normals": _normals,
    "uv": _uv,
    "mip-level": _mip_level,
    "overdraw": _overdraw,
    "object-id": _object_id,
    "texel-grid": _texel_grid,
}


def _shade(fragments: Fragments, state: RenderState) -> None:
    assert state.options.buffer is not None
    fragments.light += _PICTURES[state.options.buffer](fragments, state)


BUFFER = Effect(
    name="buffer",
    does="shows a buffer of the renderer",
    after="transparency",
    among="in_view",
    reasons=_reasons,
    requested_by="the options",
    left_out="the options ask for the picture itself",
    needs=(_needs,),
    prepare=_buffer_range,
    shade=_shade,
    rate="pixel",
)
