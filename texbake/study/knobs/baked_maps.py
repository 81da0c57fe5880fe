"""Knobs of baked maps: their size, samples per texel, bits of their files, and kinds of maps."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import ADAPTIVE, SAMPLES, BakeOptions
from texbake.baking.result import BakedMap, BakeResult
from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray
from texbake.study.knob import Case, Evaluation, Experiment, Knob, Setting
from texbake.study.truth.pictures import close_up
from texbake.study.truth.probes import N_RAYS, angles_deg, mean_normals, probe, truth_of
from texbake.texture.encoding import decode_normals, encode_normals
from texbake.texture.image import read_image, write_image
from texbake.unfinished import scratch_prefix

_SIZES = (256, 512, 1024, 2048, 4096, 8192)
_QUICK_SIZES = (32, 64, 128)


def _prepare_texture_size(case: Case) -> Experiment:
    pair = case.pair
    probes = probe(pair, case.choose(100_000, 5_000), threads=case.threads)

    def work(size: int) -> BakeResult:
        options = BakeOptions(size=size, maps=("normal", "displacement"), threads=case.threads)
        return bake(pair.high, pair.low, options)

    def judge(size: int, result: BakeResult) -> Evaluation:
        normals = result.maps["normal"].values
        angles = probes.normal_errors(normals)
        heights = probes.height_errors(result.maps["displacement"].values)
        return Evaluation(
            error=float(angles.mean()),
            picture=close_up(pair.low, normal_map=normals, zoom=12.0, threads=case.threads),
            figures={
                "angle, 95th percentile (°)": float(np.quantile(angles, 0.95)),
                "height, mean (% of diagonal)": 100.0 * float(heights.mean()) / pair.low.diagonal,
            },
        )

    truth, words = truth_of(pair, probes)
    return Experiment(
        subject=pair.subject,
        truth=truth,
        truth_text=words,
        settings=tuple(Setting(str(size), size) for size in case.choose(_SIZES, _QUICK_SIZES)),
        work=work,
        judge=judge,
    )


TEXTURE_SIZE_KNOB = Knob(
    name="texture-size",
    title="Texture size",
    about="Texels along one side of a normal and a displacement map. Four times the texels cost "
    "about four times the time and memory; what they gain depends on how fine the detail is.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_texture_size,
)


# Bounds on the estimated error of a texel with adaptive samples, in degrees.
_BOUNDS = (2.0, 1.0, 0.5, 0.25, 0.12)
_QUICK_BOUNDS = (1.0,)
_FIXED, _BUDGET = "fixed samples", "time budget"
# Time budgets, as shares of the time of 16 samples per texel.
_BUDGETS = (0.5, 1.0, 2.0)
_QUICK_BUDGETS = (1.0,)


def _prepare_samples(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(1024, 32)
    truth, known = mean_normals(pair, size, threads=case.threads)

    def work(options: BakeOptions) -> BakeResult:
        return bake(pair.high, pair.low, options)

    def judge(options: BakeOptions, result: BakeResult) -> Evaluation:
        values = result.maps["normal"].values
        compared = known & result.has_data
        angles = angles_deg(values[compared].astype(np.float64), truth[compared])
        return Evaluation(
            error=float(np.sqrt((angles**2).mean())),
            picture=close_up(pair.low, normal_map=values, zoom=12.0, threads=case.threads),
            figures={
                "angle, mean (°)": float(angles.mean()),
                "angle, 95th percentile (°)": float(np.quantile(angles, 0.95)),
                "angle, maximum (°)": float(angles.max()),
            },
        )

    return Experiment(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="converged",
        truth_text="The mean normal over the covered part of each texel, from a grid of "
        f"{N_RAYS:,} rays, all added up before the sum is normalized. Where edges run through "
        "texels, its own error is about half that of 64 samples.",
        settings=_settings(case, size, work),
        work=work,
        judge=judge,
    )


def _settings(
    case: Case, size: int, work: Callable[[BakeOptions], BakeResult]
) -> tuple[Setting, ...]:
    """Return fixed samples, bounds, and budgets as shares of the time of 16 samples."""
    same = BakeOptions(size=size, threads=case.threads)
    sixteen = replace(same, samples=16)
    work(sixteen)  # compiles
    start = time.perf_counter()
    work(sixteen)
    seconds = time.perf_counter() - start
    fixed = [Setting(str(n), replace(same, samples=n), _FIXED) for n in SAMPLES]
    bounds = [
        Setting(
            f"{ADAPTIVE} {bound:g}°",
            replace(same, samples=ADAPTIVE, max_error=f"{bound:g}deg"),
            ADAPTIVE,
        )
        for bound in case.choose(_BOUNDS, _QUICK_BOUNDS)
    ]
    budgets = [
        Setting(f"budget {budget:.2g} s", replace(same, time_budget=f"{budget:.2g}s"), _BUDGET)
        for budget in (share * seconds for share in case.choose(_BUDGETS, _QUICK_BUDGETS))
    ]
    return (*fixed, *bounds, *budgets)


SAMPLES_KNOB = Knob(
    name="samples",
    title="Samples per texel",
    about="Rays averaged into each texel. Detail finer than a texel turns into noise with one ray "
    "and into its mean with many; where there is no such detail, more rays gain nothing. Adaptive "
    "samples go where neighbors disagree, until the estimated error of each texel is below the "
    "bound, or until a time budget is spent.",
    error="angle to the texel's mean normal, root mean square",
    unit="°",
    kind="angle",
    prepare=_prepare_samples,
    baseline=_FIXED,
)


# Side in texels of the areas over which the eye averages; errors that remain there are banding.
_AREA = 8
# 1 / g and 1 / g² for g³ = g + 1: Roberts's sequence, which spreads values evenly over neighbors.
_STEPS = (0.7548776662466927, 0.5698402909980532)
# One offset per channel, so that they do not move together.
_OFFSETS = (0.0, 1.0 / 3.0, 2.0 / 3.0)

_CODINGS = {"8": (8, False), "8 dithered": (8, True), "16": (16, False), "float": (32, False)}


def _prepare_bit_depth(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(2048, 128)
    baked = bake(pair.high, pair.low, BakeOptions(size=size, threads=case.threads))
    truth, known = baked.maps["normal"].values, baked.has_data
    folder = tempfile.TemporaryDirectory(prefix=scratch_prefix(Path(tempfile.gettempdir())))

    def work(coding: str) -> Path:
        bits, dithered = _CODINGS[coding]
        path = Path(folder.name) / f"{coding}{'.exr' if bits == 32 else '.png'}"
        values = _dithered(truth, bits) if dithered else truth
        codes = encode_normals(values, bits=bits, threads=case.threads)
        write_image(codes, path, bits=bits, threads=case.threads)
        return path

    def judge(coding: str, path: Path) -> Evaluation:
        values = decode_normals(read_image(path, color=False).pixels)
        exact = truth[known].astype(np.float64)
        angles = angles_deg(values[known].astype(np.float64), exact / _lengths(exact))
        return Evaluation(
            error=float(angles.mean()),
            picture=close_up(pair.low, normal_map=values, zoom=8.0, threads=case.threads),
            figures={
                f"banding: angle of the mean over {_AREA} x {_AREA} texels (°)": _banding(
                    values, truth, known
                ),
                "angle, maximum (°)": float(angles.max()),
                "file (MB)": path.stat().st_size / 1e6,
            },
        )

    return Experiment(
        subject=f"{pair.subject}, its normal map at {size} x {size}",
        truth="exact values",
        truth_text="The values themselves before they were encoded.",
        settings=tuple(Setting(name, name) for name in _CODINGS),
        work=work,
        judge=judge,
        close=folder.cleanup,
    )


def _dithered(values: Float32Array, bits: int) -> Float32Array:
    """Move values by up to half a step of the codes, differently in each texel and channel."""
    height, width = values.shape[:2]
    rows, columns = np.arange(height)[:, None, None], np.arange(width)[None, :, None]
    share = (columns * _STEPS[0] + rows * _STEPS[1] + np.array(_OFFSETS)) % 1.0 - 0.5
    return np.asarray(values + share * (2.0 / ((1 << bits) - 1)), np.float32)


def _banding(values: Float32Array, truth: Float32Array, known: BoolArray) -> float:
    """Return the mean angle between both once the eye has averaged over small areas."""
    height, width = (length // _AREA * _AREA for length in known.shape)

    def averaged(image: Float32Array) -> FloatArray:
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


def _lengths(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(pm.vecdot(vectors, vectors)))[:, None]


BIT_DEPTH_KNOB = Knob(
    name="bit-depth",
    title="Bit depth and dithering",
    about="Encoding and writing one normal map. Eight bits round each texel by a sixth of a "
    "degree, and neighbors on a smooth surface the same way, which shows as bands in reflections; "
    "dithering makes single texels worse but their mean right.",
    error="angle of the normal read back, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_bit_depth,
)


# Maps that a surface may do without, from the cheapest to those that cast rays of their own.
_MAPS = ("normal", "displacement", "curvature", "ao", "bent-normal", "thickness")
# Half a step of 8 bits: of shares from 0 to 1, and of the components of normals.
_SHARE, _COMPONENT = 0.5 / 255.0, 1.0 / 255.0
# Side in pixels of the pictures.
_SIDE = 200
# Lengths below this share of the mesh's size do not show.
_LENGTH = 0.5 / 65535.0


def _prepare_map_kind(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(1024, 64)
    extent = float(np.ptp(pair.low.bounds, axis=0).max())

    def work(name: str) -> BakeResult:
        return bake(pair.high, pair.low, BakeOptions(size=size, maps=(name,), threads=case.threads))

    def judge(name: str, result: BakeResult) -> Evaluation:
        found = result.maps[name]
        differs, largest = _differs(found, extent)
        counts = result.report.counts
        return Evaluation(
            error=100.0 * float(1.0 - differs.mean()),
            picture=_shown(found),
            figures={
                "texels that the map changes (%)": 100.0 * float(differs.mean()),
                f"largest change ({_unit_of(found)})": largest,
                "rays (million)": (counts.rays_cast + counts.secondary_rays) / 1e6,
            },
        )

    return Experiment(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="exact values",
        truth_text="The value that a surface has without the map: a flat normal, a height of 0, "
        "no curvature, an open surface, no thickness.",
        settings=tuple(Setting(name, name) for name in _MAPS),
        work=work,
        judge=judge,
    )


def _differs(found: BakedMap, extent: float) -> tuple[np.ndarray, float]:
    """(n,) bool: texels that differ from no map; and the largest difference."""
    values = found.values[found.has_data]
    changes = np.abs(values - np.array(found.kind.neutral(found.options))).max(axis=1)
    if found.kind.coding == "mask":
        least = _SHARE
    elif found.kind.coding == "normal":
        least = _COMPONENT
    elif found.kind.coding == "curvature":  # one over a length
        least, changes = _LENGTH, changes * extent
    else:
        least = _LENGTH * extent
    return changes > least, float(changes.max(initial=0.0))


def _shown(found: BakedMap) -> Float32Array:
    """(200, 200, 3): the whole map; normals as colors, other values from black to white."""
    rows, columns = (np.arange(_SIDE) * side // _SIDE for side in found.values.shape[:2])
    values = found.values[rows[:, None], columns]
    if found.kind.coding == "normal":
        return np.asarray(0.5 + 0.5 * values, np.float32)
    low, high = float(values.min()), float(values.max())
    gray = (values[..., :1] - low) / max(high - low, 1e-30)
    return np.repeat(gray, 3, axis=2).astype(np.float32)


def _unit_of(found: BakedMap) -> str:
    words = {"mask": "of 1", "normal": "of a component", "curvature": "over the mesh's size"}
    return words.get(found.kind.coding, "model units")


MAP_KIND_KNOB = Knob(
    name="map-kind",
    title="Kinds of maps",
    about="One map at a time: what it costs to bake, and how many of its texels differ from what "
    "a surface has without it. A map that changes few texels is not worth its rays.",
    error="texels that the map leaves as they are",
    unit="%",
    kind="texels",
    prepare=_prepare_map_kind,
)
