"""Sample images at texture coordinates with any filter; docs/explanation/textures.md lists them.

`trilinear`, `ewa` and `supersampled` need the derivatives of the coordinates, which give the area
of the image that a pixel covers.

Based on: the OpenGL 4.6 specification, section 8.14, for nearest lookup and the level of detail;
Korobov, "The Approximate Computation of Multiple Integrals", 1959, for the lattice of supersamples.
The kernels, `core/texture_lookup.c` and `core/elliptical_weighted_average.c`, name the sources of
the filters.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, require_known, require_least
from texbake.mesh.mesh import AnyArray, Float32Array
from texbake.parallel import run_bands
from texbake.texture.lookup import Wrap, border_values, wrap_codes
from texbake.texture.mipmaps import MipChain, mip_chain, single_level

FILTERS = ("nearest", "bilinear", "bicubic", "trilinear", "ewa", "supersampled")
FILTERS_WITH_FOOTPRINT = ("trilinear", "ewa", "supersampled")

# Lookups per band: a few milliseconds of work.
_BAND = 1 << 16

# Of `ewa`: weights over r², the squared distance from the center with 1 on the ellipse:
# exp(-2 r²), lowered so that it ends at 0.
_N_WEIGHTS = 1024
_SQUARED = (np.arange(_N_WEIGHTS) + 0.5) / _N_WEIGHTS
EWA_WEIGHTS = (pm.exp(-2.0 * _SQUARED) - pm.exp(-2.0)).astype(np.float32)
EWA_WEIGHTS.flags.writeable = False

# Squared radius of the ellipse in steps of a pixel, with which the variance along an axis is 1/12,
# that of a square pixel: the weights' own is 0.136 of it.
PIXEL_RADIUS_SQUARED = float(2.0 / 12.0 * EWA_WEIGHTS.sum() / (EWA_WEIGHTS * _SQUARED).sum())

# Of `supersampled`: (256, 2) points of [-1/2, 1/2]², as many to either side of the middle, and as
# far. They form a rank-1 lattice, whose points all differ in both coordinates: the rows of a
# regular 16 x 16 grid would fall on the same phase of a regular texture over and over. The
# multiplier was chosen among all odd ones for small errors over waves of up to 40 periods.
_N_SAMPLES = 256
_MULTIPLIER = 111
_LATTICE_STEPS = np.arange(_N_SAMPLES) + 0.5
SUPERSAMPLES = (
    np.stack([_LATTICE_STEPS, _MULTIPLIER * _LATTICE_STEPS % _N_SAMPLES], axis=1) / _N_SAMPLES - 0.5
)
SUPERSAMPLES.flags.writeable = False


def sample(
    chain: MipChain,
    uvs: AnyArray,
    derivatives: AnyArray | None = None,
    *,
    filter: str = "trilinear",  # noqa: A002  # what the field calls it
    wrap: Wrap = "repeat",
    border: npt.ArrayLike | None = None,
    max_anisotropy: float = 16.0,
    threads: int | None = None,
) -> Float32Array:
    """Sample a chain at uvs (n, 2); derivatives (n, 4) are du/dx, dv/dx, du/dy, dv/dy per pixel."""
    require_known("filter", filter, FILTERS)
    code = wrap_codes(wrap)
    require_least("max_anisotropy", max_anisotropy)
    uvs = _readable(uvs, np.float64, 2, "uvs")
    changes = None
    if filter in FILTERS_WITH_FOOTPRINT:
        if derivatives is None:
            raise OptionError(f"derivatives: {filter} filtering needs them; give them or bilinear")
        changes = _readable(derivatives, np.float32, 4, "derivatives")
        if len(changes) != len(uvs):
            raise OptionError(f"derivatives: {len(changes)} rows for {len(uvs)} coordinates")
    outside = border_values(border, chain.n_channels)
    out = np.empty((len(uvs), chain.n_channels), np.float32)
    texels, offsets, sizes = chain.texels, chain.offsets, chain.sizes

    def work(start: int, stop: int) -> None:
        rows = out, start, stop
        if filter == "nearest":
            core.sample_nearest(texels, sizes, uvs, code, outside, *rows)
        elif filter == "bicubic":
            core.sample_bicubic(texels, sizes, uvs, code, outside, *rows)
        elif filter == "ewa":
            core.sample_ellipses(
                texels, offsets, sizes, uvs, changes, float(max_anisotropy), code, outside,
                EWA_WEIGHTS, PIXEL_RADIUS_SQUARED, *rows,
            )  # fmt: skip
        elif filter == "supersampled":
            core.sample_supersampled(
                texels, sizes, uvs, changes, SUPERSAMPLES, code, outside, *rows
            )
        else:
            core.sample_trilinear(texels, offsets, sizes, uvs, changes, code, outside, *rows)

    run_bands(work, len(uvs), band=_BAND, threads=threads)
    return out


def sample_texture(
    texture: MipChain | AnyArray,
    uvs: AnyArray,
    derivatives: AnyArray | None = None,
    *,
    filter: str = "bilinear",  # noqa: A002
    wrap: Wrap = "repeat",
    border: npt.ArrayLike | None = None,
    max_anisotropy: float = 16.0,
    threads: int | None = None,
) -> Float32Array:
    """(..., C) of an image (H, W, C) or a mip chain, linear, at uvs (..., 2) of any shape."""
    if not isinstance(texture, MipChain):
        wanted = filter in ("trilinear", "ewa")
        texture = (
            mip_chain(texture, wrap=wrap, threads=threads) if wanted else single_level(texture)
        )
    uvs = np.asarray(uvs)
    if uvs.ndim == 0 or uvs.shape[-1] != 2:
        raise OptionError(f"uvs: the shape {uvs.shape} is not (..., 2)")
    if derivatives is not None:
        derivatives = np.asarray(derivatives)
        if derivatives.shape != (*uvs.shape[:-1], 4):
            raise OptionError(
                f"derivatives: the shape {derivatives.shape} is not {(*uvs.shape[:-1], 4)}"
            )
        derivatives = derivatives.reshape(-1, 4)
    values = sample(
        texture, uvs.reshape(-1, 2), derivatives, filter=filter, wrap=wrap, border=border,
        max_anisotropy=max_anisotropy, threads=threads,
    )  # fmt: skip
    return values.reshape(*uvs.shape[:-1], texture.n_channels)


def mip_levels(
    derivatives: AnyArray, width: int, height: int, *, threads: int | None = None
) -> Float32Array:
    """(n,) mip level that `trilinear` reads, by derivatives (n, 4); negative if magnified."""
    changes = _readable(derivatives, np.float32, 4, "derivatives")
    out = np.empty(len(changes), np.float32)
    work = partial(core.find_mip_levels, changes, width, height, out)
    run_bands(work, len(changes), band=_BAND, threads=threads)
    return out


def _readable(values: AnyArray, dtype: Any, columns: int, name: str) -> AnyArray:
    """Return a contiguous array; raise `OptionError` if it has another number of columns."""
    array = np.require(values, dtype, ["C", "A"])
    if array.ndim != 2 or array.shape[1] != columns:
        raise OptionError(f"{name}: the shape {array.shape} is not (n, {columns})")
    return array
