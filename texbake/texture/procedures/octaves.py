"""Sums of gradient noise at ever finer scales: fractal sum and turbulence.

    fractal(p) = sum of g^i noise(l^i p + i c),   turbulence(p) = sum of g^i |noise(l^i p)|

over i = 0 ... octaves - 1, with lacunarity l = 2 and gain g = 1/2 where nothing else is asked for.
About the origin all octaves of noise(l^i p) have the same slope, which adds up to a streak; c moves
them apart by whole cells. Sums of |noise| show none and are left as they were defined.
An octave that is too fine for the pixel fades to its mean, 0 or the mean of |noise|.

`octave_sum` can be called from the kernels of other modules.

Based on: Perlin, "An Image Synthesizer", 1985; Apodaca and Gritz, "Advanced RenderMan", 2000, for
the fading.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.procedures.gradient_noise import WEIGHTS, gradients, noise_at
from texbake.texture.procedures.lattice import lattice
from texbake.texture.procedures.options import checked_parameters
from texbake.texture.procedures.samples import (
    BAND,
    Samples,
    Work,
    checked_points,
    checked_widths,
    coordinates,
    kept_of,
    widest,
)

# Cells that each octave of a fractal sum is moved along x, y and z beyond the one before it.
OCTAVE_SHIFT = (37, 17, 59)


@kernel
def octave_sum(permutation, slopes, quintic, octaves, ratios, mean, x, y, z, width):  # type: ignore[no-untyped-def]
    """Sum of octaves at a point, and the share of their squared amplitudes that faded.

    Parameters
    ----------
    permutation, slopes, quintic
        As `noise_at` takes them.
    octaves : int
    ratios : (float, float)
        Lacunarity and gain.
    mean : float
        What an octave of |noise| fades to; below 0: of the noise itself, which fades to 0.
    x, y, z : float
        Finite.
    width : float
        Of the pixel; 0: nothing fades.

    Returns
    -------
    (float, float)
        The sum; and over all octaves the sum of amplitude^2 (1 - kept^2).
    """
    lacunarity, gain = ratios
    scale = 1.0
    amplitude = 1.0
    total = 0.0
    lost = 0.0
    for octave in range(octaves):
        shift = octave if mean < 0.0 else 0
        kept = kept_of(width * scale) if width > 0.0 else 1.0
        value = 0.0
        if kept > 0.0:
            value = noise_at(
                permutation, slopes, quintic,
                x * scale + shift * OCTAVE_SHIFT[0],
                y * scale + shift * OCTAVE_SHIFT[1],
                z * scale + shift * OCTAVE_SHIFT[2],
            )  # fmt: skip
        if mean >= 0.0:
            value = mean + kept * (abs(value) - mean)
        else:
            value *= kept
        total += amplitude * value
        lost += amplitude * amplitude * (1.0 - kept * kept)
        scale *= lacunarity
        amplitude *= gain
    return total, lost


def squared_amplitudes(octaves: int, gain: float) -> float:
    """Sum of the squared amplitudes of octaves."""
    return sum(gain ** (2 * i) for i in range(octaves))


@kernel
def _sums_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, ratios, mean, sums, start, stop
):
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        sums[i], _ = octave_sum(
            permutation, slopes, quintic, octaves, ratios, mean, x, y, z, widest(widths, i)
        )


@kernel
def _values_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, ratios, mean, offset, scale, out,
    start, stop,
):  # fmt: skip
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        total, _ = octave_sum(
            permutation, slopes, quintic, octaves, ratios, mean, x, y, z, widest(widths, i)
        )
        out[i, 0] = min(max(offset + scale * total, 0.0), 1.0)


def signed_noise(
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None = None,
    *,
    weight: str = "cubic",
    seed: int = 0,
    threads: int | None = None,
) -> npt.NDArray[np.float64]:
    """Signed gradient noise.

    Parameters
    ----------
    points : (n, 3) or (n, 2) float64
        A cell of the lattice is a unit cube. Two coordinates: z = 0. A coordinate that is not
        finite, or larger than 2^50, counts as 0.
    footprint : (n,) or (n, 3) float, optional
        Width of the pixel at each point, along all axes or along each.
    weight
        "cubic" (1985, C1) or "quintic" (2002, C2).
    seed
        Any whole number.
    threads
        None for every processor.

    Returns
    -------
    (n,) float64
        Within ±0.867 (cubic) or ±1.037 (quintic), of mean 0; 0 at lattice points.

    Raises
    ------
    OptionError
        A parameter is not as above, or an array has another shape.

    Examples
    --------
    >>> bool(abs(signed_noise([[3.0, -7.0, 1e9]])[0]) == 0.0)
    True
    """
    parameters = checked_parameters("noise", {"weight": weight, "seed": seed})
    return _signed(points, footprint, _NO_OCTAVES | parameters, absolute=False, threads=threads)


def fractal_sum(
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None = None,
    *,
    threads: int | None = None,
    **parameters: Any,
) -> npt.NDArray[np.float64]:
    """Sum of g^i noise(l^i p + i c), signed; parameters of `fractal`, rest of `signed_noise`."""
    full = checked_parameters("fractal", parameters)
    return _signed(points, footprint, full, absolute=False, threads=threads)


def turbulence_sum(
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None = None,
    *,
    threads: int | None = None,
    **parameters: Any,
) -> npt.NDArray[np.float64]:
    """Sum of g^i |noise(l^i p)|; parameters of `turbulence`, rest of `signed_noise`."""
    full = checked_parameters("turbulence", parameters)
    return _signed(points, footprint, full, absolute=True, threads=threads)


_NO_OCTAVES = {"octaves": 1, "lacunarity": 1.0, "gain": 1.0}


def _tables(
    parameters: dict[str, Any], n_dimensions: int, absolute: bool
) -> tuple[Any, Any, bool, int, tuple[float, float], float]:
    """What `octave_sum` takes before the point."""
    weight, seed = WEIGHTS[parameters["weight"]], parameters["seed"]
    return (
        lattice(seed).permutation,
        gradients(parameters["weight"], seed),
        weight.quintic,
        parameters["octaves"],
        (parameters["lacunarity"], parameters["gain"]),
        weight.size[n_dimensions - 2] if absolute else -1.0,
    )


def _signed(
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None,
    parameters: dict[str, Any],
    *,
    absolute: bool,
    threads: int | None,
) -> npt.NDArray[np.float64]:
    rows = checked_points(points)
    widths = checked_widths(footprint, rows)
    tables = _tables(parameters, rows.shape[1], absolute)
    sums = np.empty(len(rows))

    def work(start: int, stop: int) -> None:
        _sums_kernel(rows, widths, *tables, sums, start, stop)

    run_bands(work, len(rows), band=BAND, threads=threads)
    return sums


def fractal(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Return 1/2 + fractal(p) / (2 bound a), clamped to [0, 1]; a^2 is the sum of g^2i."""
    return _as_values(samples, parameters, absolute=False)


def turbulence(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Return turbulence(p) / (bound a), clamped to [0, 1]; a^2 is the sum of g^2i."""
    return _as_values(samples, parameters, absolute=True)


def _as_values(samples: Samples, parameters: dict[str, Any], *, absolute: bool) -> Work:
    tables = _tables(parameters, samples.n_dimensions, absolute)
    squares = squared_amplitudes(parameters["octaves"], parameters["gain"])
    scale = 1.0 / (WEIGHTS[parameters["weight"]].bound * squares**0.5)
    offset, scale = (0.0, scale) if absolute else (0.5, 0.5 * scale)

    def work(start: int, stop: int) -> None:
        _values_kernel(
            samples.points, samples.widths, *tables, offset, scale, samples.out, start, stop
        )

    return work
