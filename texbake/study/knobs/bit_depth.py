"""Bits of a normal map's file, with and without dither."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import close_up
from texbake.study.truth.probes import angles_deg
from texbake.texture.encoding import decode_normals, encode_normals
from texbake.texture.image import read_image, write_image

# Texels a side over which the eye takes the mean: what is left of an error there is banding.
_AREA = 8
# 1 / g and 1 / g² for g³ = g + 1: Roberts's sequence, which spreads values evenly over neighbors.
_STEPS = (0.7548776662466927, 0.5698402909980532)
# Of each channel, so that they do not move together.
_OFFSETS = (0.0, 1.0 / 3.0, 2.0 / 3.0)

_CODINGS = {"8": (8, False), "8 dithered": (8, True), "16": (16, False), "float": (32, False)}


def _prepare(case: Case) -> Bench:
    pair = case.pair
    size = case.choose(2048, 128)
    baked = bake(pair.high, pair.low, BakeOptions(size=size, threads=case.threads))
    truth, known = baked.maps["normal"].values, baked.has_data
    folder = tempfile.TemporaryDirectory(prefix="texbake-study-")

    def work(coding: str) -> Path:
        bits, dithered = _CODINGS[coding]
        path = Path(folder.name) / f"{coding}{'.exr' if bits == 32 else '.png'}"
        values = _dithered(truth, bits) if dithered else truth
        codes = encode_normals(values, bits=bits, threads=case.threads)
        write_image(codes, path, bits=bits, threads=case.threads)
        return path

    def judge(coding: str, path: Path) -> Outcome:
        values = decode_normals(read_image(path, color=False).pixels)
        exact = truth[known].astype(np.float64)
        angles = angles_deg(values[known].astype(np.float64), exact / _lengths(exact))
        return Outcome(
            error=float(angles.mean()),
            picture=close_up(pair.low, normal_map=values, zoom=8.0, threads=case.threads),
            figures={
                f"banding: of the mean over {_AREA} x {_AREA} texels (°)": _banding(
                    values, truth, known
                ),
                "angle, maximum (°)": float(angles.max()),
                "file (MB)": path.stat().st_size / 1e6,
            },
        )

    return Bench(
        subject=f"{pair.subject}, its normal map at {size} x {size}",
        truth="exact values",
        truth_text="The values themselves before they were coded.",
        settings=tuple(Setting(name, name) for name in _CODINGS),
        work=work,
        judge=judge,
        close=folder.cleanup,
    )


def _dithered(values: npt.NDArray[np.float32], bits: int) -> npt.NDArray[np.float32]:
    """Values moved by up to half a step of the codes, each texel and channel by another share."""
    height, width = values.shape[:2]
    rows, columns = np.arange(height)[:, None, None], np.arange(width)[None, :, None]
    share = (columns * _STEPS[0] + rows * _STEPS[1] + np.array(_OFFSETS)) % 1.0 - 0.5
    return np.asarray(values + share * (2.0 / ((1 << bits) - 1)), np.float32)


def _banding(
    values: npt.NDArray[np.float32], truth: npt.NDArray[np.float32], known: npt.NDArray[np.bool_]
) -> float:
    """Mean angle between both once the eye has averaged over small areas."""
    height, width = (length // _AREA * _AREA for length in known.shape)

    def averaged(image: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        blocks = image[:height, :width].astype(np.float64)
        return np.asarray(
            blocks.reshape(height // _AREA, _AREA, width // _AREA, _AREA, 3).mean(axis=(1, 3))
        )

    whole = known[:height, :width].reshape(height // _AREA, _AREA, width // _AREA, _AREA)
    inside = whole.all(axis=(1, 3))
    if not inside.any():
        return float("nan")
    a, b = averaged(values)[inside], averaged(truth)[inside]
    return float(angles_deg(a, b / _lengths(b)).mean())


def _lengths(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))[:, None]


KNOB = Knob(
    name="bit-depth",
    title="Bit depth and dither",
    about="Coding and writing one normal map. Eight bits round each texel by a sixth of a degree, "
    "all of a smooth surface the same way, which shows as bands in reflections; dither makes "
    "single texels worse and their mean right.",
    error="angle of the normal read back, mean",
    unit="°",
    kind="angle",
    needs="pair",
    prepare=_prepare,
)
