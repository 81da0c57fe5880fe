"""How slopes are taken from heights, and with which step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.waves import texel_grid, wave_heights, wave_normals
from texbake.texture.height_options import HeightToNormalOptions
from texbake.texture.heights_and_normals import height_to_normal
from texbake.texture.lookup import lookup

_SIZES = (64, 128, 256, 512, 1024)
_QUICK_SIZES = (32, 64)
_FORWARD, _ANALYTIC = "forward", "analytic"
_METHODS = (_FORWARD, "central", "sobel", "scharr", _ANALYTIC)

Floats = npt.NDArray[np.float32]


def _prepare(case: Case) -> Bench:
    sizes = case.choose(_SIZES, _QUICK_SIZES)
    grids = {size: tuple(axis.astype(np.float32) for axis in texel_grid(size)) for size in sizes}
    # The heights themselves are exact: only what is made of them is judged.
    heights = {size: wave_heights(*texel_grid(size)).astype(np.float32) for size in sizes}
    points = np.random.default_rng(0).random((case.choose(200_000, 5_000), 2))
    truth = wave_normals(points[:, 0], points[:, 1])

    def work(value: tuple[str, int]) -> Floats:
        method, size = value
        if method == _ANALYTIC:
            return np.asarray(wave_normals(*grids[size]), np.float32)
        if method == _FORWARD:
            return forward_normals(heights[size])
        options = HeightToNormalOptions(scale=1.0, derivative=method)
        return height_to_normal(heights[size], options)

    def judge(value: tuple[str, int], normals: Floats) -> Outcome:
        read = lookup(normals, points, threads=case.threads).astype(np.float64)
        angles = angles_deg(read, truth)
        light = np.array([-0.5, 0.5, 0.707], np.float32)
        shade = np.clip(normals @ light, 0.0, 1.0)[..., None].repeat(3, axis=2)
        return Outcome(
            error=float(angles.mean()),
            picture=crop(shade[: max(len(shade) // 4, 1), : max(len(shade) // 4, 1)]),
            figures={"angle, maximum (°)": float(angles.max())},
        )

    return Bench(
        subject="four waves over the unit square, as heights in float32",
        truth="closed form",
        truth_text="The slopes of the waves by calculus, at points between texels, where the "
        "normals are read bilinearly.",
        settings=tuple(
            Setting(f"{method} 1/{size}", (method, size), method)
            for size in sizes
            for method in _METHODS
        ),
        work=work,
        judge=judge,
    )


def forward_normals(heights: Floats) -> Floats:
    """(H, W, 3) normals by the difference to the next texel, as textbooks of bump mapping have it.

    It is the slope half a texel further on, and so wrong in proportion to the step, where a central
    difference is in proportion to its square.
    """
    along_x = (np.roll(heights, -1, axis=1) - heights) * np.float32(heights.shape[1])
    up_y = (np.roll(heights, 1, axis=0) - heights) * np.float32(heights.shape[0])
    normals = np.stack([-along_x, -up_y, np.ones_like(heights)], axis=-1)
    return np.asarray(normals / np.sqrt(np.square(normals).sum(axis=-1, keepdims=True)))


KNOB = Knob(
    name="bump-gradient",
    title="Gradient of a bump map",
    about="Slopes of a height map by differences of one texel (1/64 to 1/1024 of its width), and "
    "by calculus. A forward difference looks half a texel too far; Sobel and Scharr average "
    "across, which helps against noise and blurs what is exact.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    needs="nothing",
    prepare=_prepare,
)
